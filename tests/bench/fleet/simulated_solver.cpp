#include "tests/bench/fleet/simulated_solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <random>

#include "core/base/checksum.h"
#include "core/base/version.h"
#include "core/matte/matte_file.h"
#include "core/method/methods.h"
#include "core/service/service.h"
#include "glasswing/v1/work_service.grpc.pb.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

// False: it was stopped.
bool wait_for(std::stop_token stop, nanoseconds time) {
  std::mutex mutex;
  std::unique_lock lock(mutex);
  std::condition_variable_any().wait_for(lock, stop, time, [] { return false; });
  return !stop.stop_requested();
}

std::string tile_matte(const SimulatedWork& work, const v1::ClaimTileResponse& tile) {
  Matte matte(0, tile.first_row(), work.width_px, tile.row_count(), 1);
  matte.metadata.set_format_version(1);
  matte.metadata.set_session(work.session);
  matte.metadata.set_method(tile.method());
  matte.metadata.add_monitors()->set_name("back");
  matte.metadata.set_width_px(work.width_px);
  matte.metadata.set_height_px(work.height_px);
  return encode_matte(matte).value();
}

class SimulatedSolver {
 public:
  SimulatedSolver(const SimulatedWork& work, std::string name, std::stop_token stop)
      : work_(work),
        name_(std::move(name)),
        stop_(std::move(stop)),
        stub_(v1::WorkService::NewStub(dial(work.server))) {}

  SolverLog run() {
    while (!stop_.stop_requested()) {
      const nanoseconds asked = monotonic_now();
      const v1::ClaimTileResponse tile = claim();
      if (!tile.has_lease()) continue;
      if (tile.survey_rows_size() > 0) {
        survey(tile);
        continue;
      }
      SolvedTile solved{.tile = tile.lease().tile(), .asked = asked, .claimed = monotonic_now()};
      if (!solve(tile)) continue;
      solved.solved = monotonic_now();
      solved.counts = send(tile);
      solved.answered = monotonic_now();
      log_.tiles.push_back(solved);
    }
    return std::move(log_);
  }

 private:
  v1::ClaimTileResponse claim() {
    v1::ClaimTileRequest request;
    request.set_solver(name_);
    request.set_wait_ms(2000);
    request.set_version(kVersion);
    for (const auto& [method, version] : method_versions())
      (*request.mutable_method_versions())[method] = version;
    v1::ClaimTileResponse tile;
    grpc::ClientContext context;
    set_deadline(context, std::chrono::seconds(30));
    context.set_wait_for_ready(true);
    const std::stop_callback cancel(stop_, [&] { context.TryCancel(); });
    note("ClaimTile", stub_->ClaimTile(&context, request, &tile));
    return tile;
  }

  void survey(const v1::ClaimTileResponse& tile) {
    v1::CompleteSurveyRequest request;
    *request.mutable_lease() = tile.lease();
    request.set_solver(name_);
    for (int i = 0; i < tile.survey_rows_size(); ++i) request.add_row_seconds(work_.row_s);
    v1::CompleteSurveyResponse response;
    grpc::ClientContext context;
    set_deadline(context, std::chrono::seconds(30));
    note("CompleteSurvey", stub_->CompleteSurvey(&context, request, &response));
  }

  // Waits as long as the tile takes, and keeps its lease meanwhile. False: in vain.
  bool solve(const v1::ClaimTileResponse& tile) {
    const nanoseconds due =
        monotonic_now() + std::chrono::duration_cast<nanoseconds>(
                              std::chrono::duration<double>(wait_s(work_, tile.first_row())));
    const nanoseconds every = milliseconds(tile.lease_ms() / 3);
    while (monotonic_now() < due) {
      if (!wait_for(stop_, std::min(every, due - monotonic_now()))) return false;
      if (monotonic_now() >= due) break;
      v1::KeepTileRequest request;
      *request.mutable_lease() = tile.lease();
      v1::KeepTileResponse response;
      grpc::ClientContext context;
      set_deadline(context, std::chrono::seconds(10));
      const grpc::Status kept = stub_->KeepTile(&context, request, &response);
      if (kept.error_code() == grpc::StatusCode::ABORTED) return false;
      note("KeepTile", kept);
    }
    return true;
  }

  bool send(const v1::ClaimTileResponse& tile) {
    v1::CompleteTileRequest request;
    *request.mutable_lease() = tile.lease();
    request.set_solver(name_);
    request.set_seconds(wait_s(work_, tile.first_row()));
    request.set_chunk(tile_matte(work_, tile));
    request.set_checksum(checksum_of(request.chunk()));
    v1::CompleteTileResponse response;
    grpc::ClientContext context;
    set_deadline(context, std::chrono::minutes(1));
    const auto writer = stub_->CompleteTile(&context, &response);
    writer->Write(request);
    writer->WritesDone();
    const grpc::Status sent = writer->Finish();
    if (sent.error_code() != grpc::StatusCode::ABORTED) note("CompleteTile", sent);
    return sent.ok();
  }

  void note(const char* call, const grpc::Status& status) {
    if (!status.ok() && !stop_.stop_requested())
      log_.errors.push_back(fmt::format("{}: {}", call, status.error_message()));
  }

  const SimulatedWork& work_;
  const std::string name_;
  const std::stop_token stop_;
  const std::unique_ptr<v1::WorkService::Stub> stub_;
  SolverLog log_;
};

}  // namespace

double wait_s(const SimulatedWork& work, int first_row) {
  std::mt19937_64 random(work.seed * 1000003 + static_cast<std::uint64_t>(first_row));
  return std::min(work.min_s + std::exponential_distribution<double>(1.0 / work.more_s)(random), work.max_s);
}

SolverLog run_simulated_solver(const SimulatedWork& work, const std::string& name, std::stop_token stop) {
  return SimulatedSolver(work, name, std::move(stop)).run();
}

}  // namespace glasswing
