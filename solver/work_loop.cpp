#include "solver/work_loop.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <condition_variable>
#include <functional>
#include <future>
#include <mutex>
#include <optional>
#include <thread>

#include "core/archive/remote_archive.h"
#include "core/base/status.h"
#include "core/matte/matte_file.h"
#include "core/service/service.h"
#include "glasswing/v1/work_service.grpc.pb.h"
#include "solver/bands.h"
#include "solver/drift.h"
#include "solver/video_solve.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

void wait(std::stop_token stop, milliseconds time) {
  std::mutex mutex;
  std::unique_lock lock(mutex);
  std::condition_variable_any().wait_for(lock, stop, time, [] { return false; });
}

// The server no longer has this lease for us.
bool is_gone(const grpc::Status& status) {
  return status.error_code() == grpc::StatusCode::ABORTED ||
         status.error_code() == grpc::StatusCode::NOT_FOUND;
}

// Renews the lease of a tile while it is worked on, and says when that is in vain: stopped, or the lease went
// to somebody else.
class LeaseKeeper {
 public:
  LeaseKeeper(v1::WorkService::Stub& work, const v1::ClaimTileResponse& tile, std::stop_token stop)
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
            if (is_gone(work.KeepTile(&context, request, &response))) in_vain_.request_stop();
          }
        }) {}
  std::stop_token in_vain() const { return in_vain_.get_token(); }

 private:
  std::stop_source in_vain_;
  std::stop_callback<std::function<void()>> passed_on_;
  std::jthread thread_;
};

RemoteArchive archive_of(const v1::ClaimTileResponse& tile, std::stop_token stop) {
  std::vector<std::string> addresses = {tile.archive_address()};
  addresses.insert(addresses.end(), tile.copy_addresses().begin(), tile.copy_addresses().end());
  return RemoteArchive(addresses, tile.lease().session(), std::move(stop));
}

struct ReadStack {
  FrameStack stack;
  FrameRows rows;  // that it is made of: to be asked for intact() once it is solved
};

absl::StatusOr<ReadStack> read_stack(const v1::ClaimTileResponse& tile, const Method& method,
                                     std::stop_token stop) {
  const RemoteArchive archive = archive_of(tile, std::move(stop));
  GW_ASSIGN_OR_RETURN(v1::CaptureManifest manifest, archive.manifest());
  FrameStack stack{.manifest = std::move(manifest),
                   .first_row = tile.first_row(),
                   .row_count = tile.row_count(),
                   .rows = {},
                   .owner = nullptr};
  GW_ASSIGN_OR_RETURN(const std::vector<int> needed, method.frames_needed(stack.manifest));
  GW_ASSIGN_OR_RETURN(FrameRows rows, archive.rows(stack.manifest, needed, stack.first_row, stack.row_count));
  stack.owner = rows.owner;
  stack.rows.resize(static_cast<size_t>(stack.manifest.frames_size()));
  for (size_t i = 0; i < needed.size(); ++i) stack.rows[static_cast<size_t>(needed[i])] = rows.rows[i];
  GW_ASSIGN_OR_RETURN(stack.brightness,
                      measure_drift(stack.manifest, [&](int row, const std::vector<int>& frames) {
                        return archive.samples(stack.manifest, frames, row, 1);
                      }));
  return ReadStack{.stack = std::move(stack), .rows = std::move(rows)};
}

// What a tile became: the file of its rows, or a file for each of its frames.
struct SolvedFile {
  std::optional<int> frame;
  std::string bytes;
};
struct SolvedTile {
  std::int64_t object_pixel_count = 0, flagged_pixel_count = 0;
  std::vector<SolvedFile> files;
  std::vector<v1::RefusedFrame> refused;

  void count(const Matte& matte) {
    const ObjectCount pixels = count_object(matte);
    object_pixel_count += pixels.all;
    flagged_pixel_count += pixels.flagged;
  }
};

absl::StatusOr<SolvedTile> solve_rows(const v1::ClaimTileResponse& tile, const MethodOptions& options,
                                      int thread_count, std::stop_token stop) {
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<Method> method, make_method(tile.method(), options));
  GW_ASSIGN_OR_RETURN(const ReadStack read, read_stack(tile, *method, stop));
  GW_ASSIGN_OR_RETURN(const Matte matte, solve_in_bands(*method, read.stack, thread_count, stop));
  GW_RETURN_IF_ERROR(read.rows.intact());
  SolvedTile solved;
  solved.count(matte);
  GW_ASSIGN_OR_RETURN(std::string bytes, encode_matte(matte));
  solved.files.push_back({.frame = std::nullopt, .bytes = std::move(bytes)});
  return solved;
}

absl::StatusOr<SolvedTile> solve_frames(const v1::ClaimTileResponse& tile, const MethodOptions& options,
                                        int thread_count, std::stop_token stop) {
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<VideoMethod> method, make_video_method(tile.method(), options));
  if (method == nullptr)
    return absl::InvalidArgumentError(fmt::format("method \"{}\" makes no mattes of frames", tile.method()));
  const RemoteArchive archive = archive_of(tile, stop);
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, archive.manifest());
  const auto read = [&](int frame) {
    return archive.samples(manifest, {frame}, 0, manifest.camera().height_px());
  };
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<VideoSource> video,
                      read_ahead(manifest, tile.first_frame(), tile.frame_count(), read));
  SolvedTile solved;
  // Encoded while the next one is solved: one at a time, so that no more wait in memory.
  std::future<absl::StatusOr<std::string>> encoded;
  int encoding = 0;  // which frame
  const auto take_encoded = [&]() -> absl::Status {
    if (!encoded.valid()) return absl::OkStatus();
    absl::StatusOr<std::string> bytes = encoded.get();
    if (!bytes.ok()) return in_frame(encoding, bytes.status());
    solved.files.push_back({.frame = encoding, .bytes = *std::move(bytes)});
    return absl::OkStatus();
  };
  const auto refuse = [&](int frame, const absl::Status& why) {
    v1::RefusedFrame& refused = solved.refused.emplace_back();
    refused.set_frame(frame);
    refused.set_error(std::string(why.message()));
    return absl::OkStatus();
  };
  GW_RETURN_IF_ERROR(solve_video(*method, *video, tile.first_frame(), tile.frame_count(), thread_count, stop,
                                 [&](int frame, absl::StatusOr<Matte> matte) {
                                   if (!matte.ok()) return refuse(frame, matte.status());
                                   solved.count(*matte);
                                   const absl::Status taken = take_encoded();
                                   encoding = frame;
                                   encoded = std::async(std::launch::async, [of = *std::move(matte)] {
                                     return encode_matte(of);
                                   });
                                   return taken;
                                 }));
  GW_RETURN_IF_ERROR(take_encoded());
  return solved;
}

absl::StatusOr<SolvedTile> solve(const v1::ClaimTileResponse& tile, int thread_count, std::stop_token stop) {
  const MethodOptions options(tile.options().begin(), tile.options().end());
  return tile.frame_count() > 0 ? solve_frames(tile, options, thread_count, stop)
                                : solve_rows(tile, options, thread_count, stop);
}

grpc::Status send(v1::WorkService::Stub& work, const v1::ClaimTileResponse& tile, const SolvedTile& solved) {
  v1::CompleteTileRequest first;
  *first.mutable_lease() = tile.lease();
  first.set_object_pixel_count(solved.object_pixel_count);
  first.set_flagged_pixel_count(solved.flagged_pixel_count);
  for (const v1::RefusedFrame& refused : solved.refused) *first.add_refused() = refused;
  grpc::ClientContext context;
  set_deadline(context, std::chrono::minutes(1) + solved.files.size() * std::chrono::seconds(10));
  v1::CompleteTileResponse response;
  const auto writer = work.CompleteTile(&context, &response);
  bool open = writer->Write(first);
  for (const SolvedFile& file : solved.files) {
    for (size_t at = 0; open && at < file.bytes.size(); at += kChunkBytes) {
      v1::CompleteTileRequest chunk;
      if (file.frame) chunk.set_frame(*file.frame);
      chunk.set_chunk(file.bytes.substr(at, kChunkBytes));
      open = writer->Write(chunk);  // once false, Finish() says why
    }
  }
  writer->WritesDone();
  return writer->Finish();
}

void work_on(v1::WorkService::Stub& work, const v1::ClaimTileResponse& tile, int thread_count,
             std::stop_token stop) {
  const LeaseKeeper keeper(work, tile, stop);
  const std::stop_token in_vain = keeper.in_vain();
  const std::string what = fmt::format("session={} tile={}", tile.lease().session(), tile.lease().tile());
  absl::StatusOr<SolvedTile> solved = solve(tile, thread_count, in_vain);
  // A node that holds the frames may be starting again: its silence is no fault of the tile.
  while (absl::IsUnavailable(solved.status()) && !in_vain.stop_requested()) {
    spdlog::warn("tile waits {} error=\"{}\"", what, std::string(solved.status().message()));
    wait(in_vain, std::chrono::seconds(1));
    solved = solve(tile, thread_count, in_vain);
  }
  if (in_vain.stop_requested()) {
    spdlog::warn("tile given up {}", what);
    return;
  }
  if (!solved.ok()) {
    const absl::Status& status = solved.status();
    spdlog::error("tile not solved {} error=\"{}\"", what, std::string(status.message()));
    v1::FailTileRequest request;
    *request.mutable_lease() = tile.lease();
    request.set_error(std::string(status.message()));
    request.set_permanent(absl::IsInvalidArgument(status) || absl::IsFailedPrecondition(status) ||
                          absl::IsDataLoss(status));
    v1::FailTileResponse response;
    grpc::ClientContext context;
    set_deadline(context, std::chrono::seconds(10));
    (void)work.FailTile(&context, request, &response);  // unheard, the lease runs out
    return;
  }
  while (!stop.stop_requested()) {
    const grpc::Status status = send(work, tile, *solved);
    if (status.ok()) return;
    const bool gone = is_gone(status) || status.error_code() == grpc::StatusCode::INVALID_ARGUMENT;
    spdlog::warn("tile {} {} error=\"{}\"", gone ? "given up" : "kept for another try", what,
                 status.error_message());
    if (gone) return;
    wait(stop, milliseconds(500));
  }
}

}  // namespace

void run_work_loop(const std::string& server_address, const std::string& solver_name, int thread_count,
                   std::stop_token stop) {
  const auto work = v1::WorkService::NewStub(dial(server_address));
  bool reached = true;
  while (!stop.stop_requested()) {
    v1::ClaimTileRequest request;
    request.set_solver(solver_name);
    request.set_wait_ms(2000);
    request.set_version(kVersion);
    v1::ClaimTileResponse tile;
    grpc::ClientContext context;
    set_deadline(context, std::chrono::seconds(5));
    context.set_wait_for_ready(true);
    const std::stop_callback cancel(stop, [&] { context.TryCancel(); });
    const grpc::Status status = work->ClaimTile(&context, request, &tile);
    if (stop.stop_requested()) return;
    if (status.ok() != reached) {
      reached = status.ok();
      if (!reached) spdlog::warn("no work from the server, trying on: {}", status.error_message());
    }
    if (!status.ok()) {
      wait(stop, milliseconds(500));
    } else if (tile.has_lease()) {
      work_on(*work, tile, thread_count, stop);
    }
  }
}

}  // namespace glasswing
