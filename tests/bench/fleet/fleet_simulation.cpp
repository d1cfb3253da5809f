// tests/bench/fleet/run: how well one server keeps many solvers busy whose work is a timed wait.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <queue>
#include <thread>

#include "core/base/status.h"
#include "core/frame/archive.h"
#include "core/service/service.h"
#include "glasswing/v1/session_service.grpc.pb.h"
#include "tests/bench/fleet/simulated_solver.h"

namespace glasswing {
namespace {

double seconds(nanoseconds time) {
  return std::chrono::duration<double>(time).count();
}

// Two black frames: solvers that only wait never read them.
absl::Status make_archive(const std::filesystem::path& directory, int width_px, int height_px) {
  v1::CaptureManifest header;
  header.set_format_version(1);
  header.set_session("made");
  v1::Monitor& monitor = *header.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(16);
  monitor.set_height_px(16);
  header.mutable_camera()->set_name("camera");
  header.mutable_camera()->set_width_px(width_px);
  header.mutable_camera()->set_height_px(height_px);
  header.mutable_camera()->set_response("linear");
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<Archive> archive, Archive::create(directory, header));
  std::vector<Archive::NewFrame> frames;
  for (const bool object : {false, true}) {
    Archive::NewFrame& frame =
        frames.emplace_back(Archive::NewFrame{.record = {}, .image = {width_px, height_px}});
    frame.record.set_object(object);
    frame.record.set_step(object ? 1 : 0);
    frame.record.mutable_stimulus()->set_kind("solid");
    frame.record.mutable_stimulus()->set_panel("back");
    for (int i = 0; i < 3; ++i) frame.record.mutable_stimulus()->add_colour(0.0);
  }
  GW_RETURN_IF_ERROR(archive->add(frames).status());
  return archive->seal();
}

// How long the same tiles take if handing them out and taking them costs nothing: each goes to whoever is
// free.
double ideal_makespan_s(const std::vector<double>& waits_s, int solvers) {
  std::priority_queue<double, std::vector<double>, std::greater<>> free_at;
  for (int i = 0; i < solvers; ++i) free_at.push(0.0);
  double last = 0.0;
  for (const double wait : waits_s) {
    const double end = free_at.top() + wait;
    free_at.pop();
    free_at.push(end);
    last = std::max(last, end);
  }
  return last;
}

double quantile(std::vector<double> values, double part) {
  if (values.empty()) return 0.0;
  const auto at = static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[at];
}

struct Tiles {
  std::map<int, nanoseconds> first_claimed;
  std::vector<SolvedTile> all;
};

nlohmann::json figures(const Tiles& tiles, int solvers, nanoseconds began) {
  nanoseconds ended = began, handed_out = began;
  for (const auto& [tile, claimed] : tiles.first_claimed) handed_out = std::max(handed_out, claimed);
  double work_s = 0.0, steady_s = 0.0;
  int counted = 0;
  std::vector<double> claims_ms, answers_ms;
  std::vector<std::pair<nanoseconds, double>> in_order;
  for (const SolvedTile& tile : tiles.all) {
    steady_s += std::max(0.0, seconds(std::min(tile.solved, handed_out) - tile.claimed));
    // The first one of a solver waited for the session to begin.
    if (tile.asked >= began && tile.claimed <= handed_out)
      claims_ms.push_back(1e3 * seconds(tile.claimed - tile.asked));
    answers_ms.push_back(1e3 * seconds(tile.answered - tile.solved));
    if (!tile.counts) continue;
    ++counted;
    const double wait = seconds(tile.solved - tile.claimed);
    work_s += wait;
    in_order.emplace_back(tile.claimed, wait);
    ended = std::max(ended, tile.answered);
  }
  std::sort(in_order.begin(), in_order.end());
  std::vector<double> waits_s;
  for (const auto& [claimed, wait] : in_order) waits_s.push_back(wait);
  const double makespan_s = seconds(ended - began), until_handed_out_s = seconds(handed_out - began);
  return {{"solvers", solvers},
          {"tiles", counted},
          {"solved_twice", static_cast<int>(tiles.all.size()) - counted},
          {"work_s", work_s},
          {"makespan_s", makespan_s},
          {"efficiency", work_s / (solvers * makespan_s)},
          {"ideal_efficiency", work_s / (solvers * ideal_makespan_s(waits_s, solvers))},
          {"steady_efficiency", steady_s / (solvers * until_handed_out_s)},
          {"tail_s", makespan_s - until_handed_out_s},
          {"tiles_per_s", counted / makespan_s},
          {"claim_p50_ms", quantile(claims_ms, 0.5)},
          {"claim_p99_ms", quantile(claims_ms, 0.99)},
          {"answer_p50_ms", quantile(answers_ms, 0.5)},
          {"answer_p99_ms", quantile(answers_ms, 0.99)}};
}

absl::Status simulate(const SimulatedWork& work, int solvers) {
  std::vector<SolverLog> logs(solvers);
  std::vector<std::jthread> threads;
  for (int i = 0; i < solvers; ++i) {
    threads.emplace_back([&, i](std::stop_token stop) {
      logs[i] = run_simulated_solver(work, fmt::format("simulated-{}", i + 1), stop);
    });
  }
  const auto stub = v1::SessionService::NewStub(dial(work.server));
  const nanoseconds began = monotonic_now();
  {
    v1::SolveSessionRequest request;
    request.set_name(work.session);
    v1::SolveSessionResponse response;
    grpc::ClientContext context;
    set_deadline(context, std::chrono::minutes(1));
    GW_RETURN_IF_ERROR(from_grpc(stub->SolveSession(&context, request, &response), "the server"));
  }
  v1::WatchSessionRequest watch;
  watch.set_name(work.session);
  v1::WatchSessionResponse now;
  grpc::ClientContext context;
  const auto reader = stub->WatchSession(&context, watch);
  while (reader->Read(&now)) {
  }
  GW_RETURN_IF_ERROR(from_grpc(reader->Finish(), "the server"));
  const nanoseconds done = monotonic_now();
  for (std::jthread& thread : threads) thread.request_stop();
  threads.clear();
  if (now.session().state() != v1::SESSION_STATE_DONE) return absl::InternalError(now.session().reason());

  Tiles tiles;
  std::vector<std::string> errors;
  for (const SolverLog& log : logs) {
    errors.insert(errors.end(), log.errors.begin(), log.errors.end());
    for (const SolvedTile& tile : log.tiles) {
      tiles.all.push_back(tile);
      const auto [known, is_new] = tiles.first_claimed.emplace(tile.tile, tile.claimed);
      if (!is_new) known->second = std::min(known->second, tile.claimed);
    }
  }
  nlohmann::json told = figures(tiles, solvers, began);
  told["until_done_s"] = seconds(done - began);
  told["errors"] = errors;
  std::cout << told.dump() << "\n";
  return absl::OkStatus();
}

int run(int argc, char** argv) {
  CLI::App app(
      "One solve of a session by simulated solvers, whose work is a timed wait; tests/bench/fleet/run starts "
      "all that it needs.");
  SimulatedWork work;
  int solvers = 64;
  std::string archive;
  app.add_option("--server", work.server, "host:port of glasswing-server");
  app.add_option("--session", work.session, "captured or imported");
  app.add_option("--width", work.width_px, "px of its camera's picture")->required();
  app.add_option("--height", work.height_px, "likewise")->required();
  app.add_option("--solvers", solvers, "how many")->check(CLI::Range(1, 4096))->capture_default_str();
  app.add_option("--seed", work.seed, "of the waits")->capture_default_str();
  app.add_option("--row-seconds", work.row_s, "what surveys say that a row takes")->capture_default_str();
  app.add_option("--make-archive", archive, "only make one of such a picture in this directory");
  CLI11_PARSE(app, argc, argv);
  const absl::Status status =
      archive.empty() ? simulate(work, solvers) : make_archive(archive, work.width_px, work.height_px);
  if (!status.ok()) std::cerr << status.message() << "\n";
  return status.ok() ? 0 : 1;
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  return glasswing::run(argc, argv);
}
