#include "solver/worker/work_loop.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "core/base/checksum.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "core/base/version.h"
#include "core/file/fault_point.h"
#include "core/method/methods.h"
#include "core/process/low_priority.h"
#include "core/service/message_limits.h"
#include "core/service/service.h"
#include "glasswing/v1/work_service.grpc.pb.h"
#include "solver/worker/solver_metrics.h"
#include "solver/worker/tile_solver.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using Stub = v1::WorkService::Stub;

// How long a stopping solver still tries to deliver finished results.
constexpr seconds kDeliveryGrace(10);
// The limit on results kept for an unreachable server. Until then work for other servers continues.
constexpr size_t kMaxPendingBytes = size_t{512} << 20;

// Solves take turns, by tiles: opening a source measures the whole picture, which takes as long as some
// tiles.
constexpr size_t kMaxSources = 2;

struct OpenSource {
  std::int64_t job = 0;
  std::shared_ptr<const SolveSource> source;
};

void wait(std::stop_token stop, milliseconds time) {
  std::mutex mutex;
  std::unique_lock lock(mutex);
  std::condition_variable_any().wait_for(lock, stop, time, [] { return false; });
}

// The server has given this lease up.
bool is_gone(const grpc::Status& status) {
  return status.error_code() == grpc::StatusCode::ABORTED ||
         status.error_code() == grpc::StatusCode::NOT_FOUND;
}

std::string describe(const v1::TileLease& lease) {
  return fmt::format("session={} job={} tile={} attempt={}", lease.session(), lease.job(), lease.tile(),
                     lease.attempt());
}

// Renews the lease of a tile while it is solved. in_vain() is requested when solving has become pointless: on
// stop, or when the lease went to another solver.
class LeaseRenewer {
 public:
  LeaseRenewer(Stub& work, const v1::ClaimTileResponse& tile, std::stop_token stop)
      : passed_on_(stop, [this] { in_vain_.request_stop(); }),
        thread_([&work, this, lease = tile.lease(),
                 every = milliseconds(tile.lease_ms() / 3)](std::stop_token end) {
          while (!end.stop_requested()) {
            wait(end, every);
            if (end.stop_requested()) return;
            v1::KeepTileRequest request;
            *request.mutable_lease() = lease;
            v1::KeepTileResponse response;
            grpc::ClientContext context;
            set_deadline(context, every);
            const std::stop_callback cancel(end, [&] { context.TryCancel(); });
            if (is_gone(work.KeepTile(&context, request, &response))) in_vain_.request_stop();
          }
        }) {}
  std::stop_token in_vain() const { return in_vain_.get_token(); }

 private:
  std::stop_source in_vain_;
  std::stop_callback<std::function<void()>> passed_on_;
  std::jthread thread_;
};

// A tile of this solver, from its claim to the server's answer to its result.
struct OwnTile {
  v1::ClaimTileResponse claim;
  std::chrono::steady_clock::time_point since = std::chrono::steady_clock::now();
  std::unique_ptr<LeaseRenewer> renewer;
  std::future<absl::StatusOr<TileInHand>> read;

  double age() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - since).count();
  }
};

// Drafts yield to the capture that they are made during.
template <typename T>
absl::StatusOr<T> at_priority_of(const OwnTile& tile, const std::function<absl::StatusOr<T>()>& work) {
  if (!tile.claim.has_draft()) return work();
  absl::StatusOr<T> result;
  run_at_low_priority([&] { result = work(); });
  return result;
}

class WorkLoop {
 public:
  WorkLoop(const WorkOptions& options, std::stop_token stop)
      : options_(options),
        stop_(std::move(stop)),
        asked_(v1::WorkService::NewStub(dial(options.server, only(Role::kServer)))) {}

  absl::Status run();

 private:
  // Null: no work. UNAVAILABLE: the server cannot be reached.
  absl::StatusOr<std::unique_ptr<OwnTile>> claim(bool ahead);
  void start(OwnTile& tile);
  absl::StatusOr<std::shared_ptr<const SolveSource>> source_of(const v1::ClaimTileResponse& tile);
  absl::StatusOr<TileInHand> read(const v1::ClaimTileResponse& tile);
  // Repeats `call` while a node that holds the frames is unreachable: the tile is not at fault.
  template <typename T>
  absl::StatusOr<T> patiently(const OwnTile& tile, const std::function<absl::StatusOr<T>()>& call);
  // Returns the tile that was read ahead meanwhile, if any.
  std::unique_ptr<OwnTile> work_on(std::unique_ptr<OwnTile> tile);
  std::unique_ptr<OwnTile> claim_ahead();
  void survey_for(OwnTile& tile);
  void deliver(std::unique_ptr<OwnTile> tile, SolvedTile solved);
  void deliver_in_background(std::unique_ptr<OwnTile> tile, SolvedTile solved);
  void give_up(const OwnTile& tile, const absl::Status& why);
  void return_tile(const OwnTile& tile);
  void fail(const OwnTile& tile, v1::FailTileRequest request);
  // Repeats the call until the server answers it or has given the lease up.
  void insist(const OwnTile& tile, const std::function<grpc::Status(grpc::ClientContext&)>& call);
  // The server that owns the tile's session.
  Stub& owner_of(const v1::ClaimTileResponse& tile);

  const WorkOptions options_;
  const std::stop_token stop_;
  const std::unique_ptr<Stub> asked_;
  std::mutex mutex_;
  std::map<std::string, std::unique_ptr<Stub>> owners_;  // by address; guarded by mutex_
  std::mutex source_mutex_;
  std::vector<OpenSource> sources_;  // the last used one at the end; guarded by source_mutex_
  std::vector<std::future<void>> deliveries_;
  std::atomic<size_t> pending_bytes_ = 0;  // of their results
  bool reached_ = true;
  std::string claim_id_;  // of the claim that the server has not answered yet; one claim runs at a time
};

Stub& WorkLoop::owner_of(const v1::ClaimTileResponse& tile) {
  if (tile.server_address().empty()) return *asked_;
  const std::lock_guard lock(mutex_);
  std::unique_ptr<Stub>& stub = owners_[tile.server_address()];
  if (stub == nullptr) stub = v1::WorkService::NewStub(dial(tile.server_address(), only(Role::kServer)));
  return *stub;
}

absl::StatusOr<std::unique_ptr<OwnTile>> WorkLoop::claim(bool ahead) {
  v1::ClaimTileRequest request;
  request.set_solver(options_.name);
  request.set_wait_ms(ahead ? 0 : 2000);
  request.set_version(kVersion);
  request.set_ahead(ahead);
  if (claim_id_.empty()) claim_id_ = random_token();
  request.set_request_id(claim_id_);
  for (const auto& [method, version] : method_versions())
    (*request.mutable_method_versions())[method] = version;
  auto tile = std::make_unique<OwnTile>();
  grpc::ClientContext context;
  set_deadline(context, ahead ? milliseconds(1000) : options_.claim_time);
  context.set_wait_for_ready(!ahead);
  const std::stop_callback cancel(stop_, [&] { context.TryCancel(); });
  const grpc::Status status = asked_->ClaimTile(&context, request, &tile->claim);
  if (!status.ok()) return from_grpc(status);  // the next claim asks for the tile that this one may have got
  claim_id_.clear();
  if (!tile->claim.has_lease()) return nullptr;
  fault_point("tile claimed");
  tile->since = std::chrono::steady_clock::now();
  tile->renewer = std::make_unique<LeaseRenewer>(*asked_, tile->claim, stop_);
  return tile;
}

absl::StatusOr<std::shared_ptr<const SolveSource>> WorkLoop::source_of(const v1::ClaimTileResponse& tile) {
  const std::lock_guard lock(source_mutex_);
  const auto known = std::ranges::find(sources_, tile.lease().job(), &OpenSource::job);
  if (known != sources_.end()) {
    std::rotate(known, known + 1, sources_.end());
    return sources_.back().source;
  }
  if (sources_.size() >= kMaxSources) sources_.erase(sources_.begin());
  GW_ASSIGN_OR_RETURN(std::shared_ptr<const SolveSource> source, SolveSource::open(tile, stop_));
  sources_.push_back({.job = tile.lease().job(), .source = std::move(source)});
  return sources_.back().source;
}

template <typename T>
absl::StatusOr<T> WorkLoop::patiently(const OwnTile& tile, const std::function<absl::StatusOr<T>()>& call) {
  const std::stop_token in_vain = tile.renewer->in_vain();
  while (true) {
    absl::StatusOr<T> result = call();
    if (in_vain.stop_requested()) return absl::CancelledError("in vain");
    if (!absl::IsUnavailable(result.status())) return result;
    spdlog::warn("tile waits {} error=\"{}\"", describe(tile.claim.lease()),
                 std::string(result.status().message()));
    wait(in_vain, seconds(1));
  }
}

absl::StatusOr<TileInHand> WorkLoop::read(const v1::ClaimTileResponse& tile) {
  GW_ASSIGN_OR_RETURN(std::shared_ptr<const SolveSource> source, source_of(tile));
  return TileInHand::read(tile, std::move(source));
}

void WorkLoop::start(OwnTile& tile) {
  tile.read = std::async(std::launch::async, [this, &tile] {
    return patiently<TileInHand>(
        tile, [&] { return at_priority_of<TileInHand>(tile, [&] { return read(tile.claim); }); });
  });
}

void WorkLoop::insist(const OwnTile& tile, const std::function<grpc::Status(grpc::ClientContext&)>& call) {
  std::optional<nanoseconds> end;
  while (!end || monotonic_now() < *end) {
    if (stop_.stop_requested() && !end) end = monotonic_now() + kDeliveryGrace;
    grpc::ClientContext context;
    const grpc::Status status = call(context);
    if (status.ok()) {
      solver_metrics().solved.Increment();
      spdlog::info("{} {} seconds={:.2f}", tile.claim.survey_rows().empty() ? "tile done" : "surveyed",
                   describe(tile.claim.lease()), tile.age());
      return;
    }
    const bool gone = is_gone(status) || status.error_code() == grpc::StatusCode::INVALID_ARGUMENT;
    spdlog::warn("tile {} {} error=\"{}\"", gone ? "given up" : "kept for another try",
                 describe(tile.claim.lease()), status.error_message());
    if (gone) return solver_metrics().lost.Increment();
    wait(stop_.stop_requested() ? std::stop_token() : stop_, milliseconds(500));
  }
}

void WorkLoop::deliver(std::unique_ptr<OwnTile> tile, SolvedTile solved) {
  Stub& owner = owner_of(tile->claim);
  insist(*tile, [&](grpc::ClientContext& context) {
    v1::CompleteTileRequest first;
    *first.mutable_lease() = tile->claim.lease();
    first.set_solver(options_.name);
    first.set_seconds(tile->age());
    first.set_object_pixel_count(solved.pixels.object);
    first.set_flagged_pixel_count(solved.pixels.flagged);
    first.set_unsolved_pixel_count(solved.pixels.unsolved);
    for (const v1::RefusedFrame& refused : solved.refused) *first.add_refused() = refused;
    if (tile->claim.frame_count() == 0) first.set_checksum(checksum_of(solved.files.front().bytes));
    set_deadline(context, options_.result_time * (6 + static_cast<int>(solved.files.size())) / 6);
    v1::CompleteTileResponse response;
    const auto writer = owner.CompleteTile(&context, &response);
    bool open = writer->Write(first);
    for (const SolvedFile& file : solved.files) {
      for (size_t at = 0; open && at < file.bytes.size(); at += kChunkBytes) {
        v1::CompleteTileRequest chunk;
        if (file.frame) chunk.set_frame(*file.frame);
        if (file.frame && at == 0) chunk.set_checksum(checksum_of(file.bytes));
        chunk.set_chunk(file.bytes.substr(at, kChunkBytes));
        open = writer->Write(chunk);  // once false, Finish() says why
      }
    }
    writer->WritesDone();
    return writer->Finish();
  });
  fault_point("tile sent");
}

void WorkLoop::deliver_in_background(std::unique_ptr<OwnTile> tile, SolvedTile solved) {
  std::erase_if(deliveries_, [](const std::future<void>& result) {
    return result.wait_for(seconds(0)) == std::future_status::ready;
  });
  if (pending_bytes_ > kMaxPendingBytes && !deliveries_.empty()) deliveries_.front().wait();
  size_t bytes = 0;
  for (const SolvedFile& file : solved.files) bytes += file.bytes.size();
  pending_bytes_ += bytes;
  deliveries_.push_back(std::async(
      std::launch::async, [this, bytes, own = std::move(tile), result = std::move(solved)]() mutable {
        deliver(std::move(own), std::move(result));
        pending_bytes_ -= bytes;
      }));
}

void WorkLoop::survey_for(OwnTile& tile) {
  const std::stop_token in_vain = tile.renewer->in_vain();
  const absl::StatusOr<std::vector<double>> row_seconds =
      patiently<std::vector<double>>(tile, [&]() -> absl::StatusOr<std::vector<double>> {
        GW_ASSIGN_OR_RETURN(const std::shared_ptr<const SolveSource> source, source_of(tile.claim));
        return survey(tile.claim, *source, options_.threads, in_vain);
      });
  if (!row_seconds.ok()) return give_up(tile, row_seconds.status());
  v1::CompleteSurveyRequest request;
  *request.mutable_lease() = tile.claim.lease();
  request.set_solver(options_.name);
  request.mutable_row_seconds()->Add(row_seconds->begin(), row_seconds->end());
  insist(tile, [&](grpc::ClientContext& context) {
    set_deadline(context, options_.result_time);
    v1::CompleteSurveyResponse response;
    return owner_of(tile.claim).CompleteSurvey(&context, request, &response);
  });
}

void WorkLoop::fail(const OwnTile& tile, v1::FailTileRequest request) {
  *request.mutable_lease() = tile.claim.lease();
  request.set_solver(options_.name);
  v1::FailTileResponse response;
  grpc::ClientContext context;
  set_deadline(context, seconds(5));
  (void)owner_of(tile.claim).FailTile(&context, request, &response);  // if this is lost, the lease expires
}

void WorkLoop::return_tile(const OwnTile& tile) {
  solver_metrics().handed_back.Increment();
  spdlog::info("tile handed back {}", describe(tile.claim.lease()));
  v1::FailTileRequest request;
  request.set_handed_back(true);
  fail(tile, request);
}

void WorkLoop::give_up(const OwnTile& tile, const absl::Status& why) {
  if (stop_.stop_requested()) return return_tile(tile);
  if (tile.renewer->in_vain().stop_requested()) {
    solver_metrics().lost.Increment();
    spdlog::warn("tile given up {}: the lease was lost, or another solver was quicker",
                 describe(tile.claim.lease()));
    return;
  }
  solver_metrics().failed.Increment();
  spdlog::error("tile not solved {} error=\"{}\"", describe(tile.claim.lease()), std::string(why.message()));
  v1::FailTileRequest request;
  request.set_error(fitted(std::string(why.message())));
  request.set_permanent(absl::IsInvalidArgument(why) || absl::IsFailedPrecondition(why) ||
                        absl::IsDataLoss(why));
  fail(tile, request);
}

std::unique_ptr<OwnTile> WorkLoop::claim_ahead() {
  absl::StatusOr<std::unique_ptr<OwnTile>> claimed = claim(true);
  if (!claimed.ok() || *claimed == nullptr) return nullptr;
  if ((*claimed)->claim.survey_rows().empty()) start(**claimed);
  return *std::move(claimed);
}

std::unique_ptr<OwnTile> WorkLoop::work_on(std::unique_ptr<OwnTile> tile) {
  absl::StatusOr<TileInHand> in_hand = tile->read.get();
  if (!in_hand.ok()) {
    give_up(*tile, in_hand.status());
    return nullptr;
  }
  fault_point("tile read");
  // A video reads its frames while it solves them: no tile ahead.
  std::future<std::unique_ptr<OwnTile>> ahead;
  if (tile->claim.frame_count() == 0)
    ahead = std::async(std::launch::async, [this] { return claim_ahead(); });
  const std::stop_token in_vain = tile->renewer->in_vain();
  absl::StatusOr<SolvedTile> solved = patiently<SolvedTile>(*tile, [&]() -> absl::StatusOr<SolvedTile> {
    if (!in_hand.ok()) in_hand = read(tile->claim);
    GW_RETURN_IF_ERROR(in_hand.status());
    absl::StatusOr<SolvedTile> result =
        at_priority_of<SolvedTile>(*tile, [&] { return in_hand->solve(options_.threads, in_vain); });
    // The rows that were read cannot be trusted then.
    if (absl::IsUnavailable(result.status())) in_hand = result.status();
    return result;
  });
  in_hand = absl::CancelledError();  // frees its memory for the next tile
  if (solved.ok()) {
    fault_point("tile solved");
    deliver_in_background(std::move(tile), *std::move(solved));
  } else {
    give_up(*tile, solved.status());
  }
  return ahead.valid() ? ahead.get() : nullptr;
}

absl::Status WorkLoop::run() {
  std::unique_ptr<OwnTile> next;
  auto busy = std::chrono::steady_clock::now();
  while (!stop_.stop_requested()) {
    if (next == nullptr) {
      absl::StatusOr<std::unique_ptr<OwnTile>> claimed = claim(false);
      if (stop_.stop_requested() && !(claimed.ok() && *claimed != nullptr)) break;
      if (claimed.ok() != reached_) {
        reached_ = claimed.ok();
        if (!reached_)
          spdlog::warn("no work from the server, trying on: {}", std::string(claimed.status().message()));
      }
      const bool refused = absl::IsFailedPrecondition(claimed.status());
      if (refused && options_.until_idle.count() > 0) return claimed.status();
      if (!claimed.ok() || *claimed == nullptr) {
        const bool idle = std::chrono::steady_clock::now() - busy >= options_.until_idle;
        if (options_.until_idle.count() > 0 && idle) return absl::OkStatus();
        if (!claimed.ok()) wait(stop_, refused ? milliseconds(5000) : milliseconds(500));
        continue;
      }
      next = *std::move(claimed);
      if (next->claim.survey_rows().empty()) start(*next);
    }
    std::unique_ptr<OwnTile> tile = std::exchange(next, nullptr);
    busy = std::chrono::steady_clock::now();
    if (tile->claim.survey_rows().empty()) {
      next = work_on(std::move(tile));
    } else {
      survey_for(*tile);
    }
    busy = std::chrono::steady_clock::now();
  }
  if (next != nullptr) {
    if (next->read.valid()) next->read.wait();
    return_tile(*next);
  }
  for (const std::future<void>& result : deliveries_) result.wait();
  return absl::OkStatus();
}

}  // namespace

absl::Status run_work_loop(const WorkOptions& options, std::stop_token stop) {
  return WorkLoop(options, std::move(stop)).run();
}

}  // namespace glasswing
