#include "solver/work_loop.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <condition_variable>
#include <cstring>
#include <functional>
#include <mutex>
#include <thread>

#include "core/base/status.h"
#include "core/matte/matte_file.h"
#include "core/service/service.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/work_service.grpc.pb.h"
#include "solver/bands.h"
#include "solver/drift.h"

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

// A session's frames on the node that holds them.
class RemoteArchive {
 public:
  RemoteArchive(const v1::ClaimTileResponse& tile, std::stop_token stop)
      : peer_("camera node at " + tile.archive_address()),
        session_(tile.lease().session()),
        stub_(v1::ArchiveService::NewStub(dial(tile.archive_address()))),
        stop_(std::move(stop)) {}

  absl::StatusOr<v1::CaptureManifest> manifest() const {
    v1::GetManifestRequest get;
    get.set_session(session_);
    v1::GetManifestResponse got;
    grpc::ClientContext context;
    set_deadline(context, std::chrono::seconds(30));
    GW_RETURN_IF_ERROR(from_grpc(stub_->GetManifest(&context, get, &got), peer_));
    return std::move(*got.mutable_manifest());
  }

  // Of each of these frames, one after another.
  absl::StatusOr<std::vector<std::uint16_t>> rows(const v1::CaptureManifest& manifest,
                                                  const std::vector<int>& frames, int first_row,
                                                  int row_count) const {
    const size_t frame_bytes =
        static_cast<size_t>(row_count) * static_cast<size_t>(manifest.camera().width_px()) * 6;
    v1::ReadRowsRequest read;
    read.set_session(session_);
    read.set_first_row(first_row);
    read.set_row_count(row_count);
    for (const int frame : frames) read.add_files(manifest.frames(frame).file());
    std::vector<std::uint16_t> samples(frames.size() * frame_bytes / 2);
    grpc::ClientContext context;
    set_deadline(context, std::chrono::minutes(5));
    const std::stop_callback cancel(stop_, [&] { context.TryCancel(); });
    const auto reader = stub_->ReadRows(&context, read);
    v1::ReadRowsResponse response;
    size_t received = 0;
    while (reader->Read(&response)) {
      const auto index = static_cast<size_t>(response.file_index());
      const auto offset = static_cast<size_t>(response.offset_bytes());
      if (index >= frames.size() || offset + response.chunk().size() > frame_bytes) {
        context.TryCancel();
        return absl::DataLossError(peer_ + " sent rows that were not asked for");
      }
      auto* bytes = reinterpret_cast<char*>(samples.data()) + index * frame_bytes;
      std::memcpy(bytes + offset, response.chunk().data(), response.chunk().size());
      received += response.chunk().size();
    }
    GW_RETURN_IF_ERROR(from_grpc(reader->Finish(), peer_));
    if (received != frames.size() * frame_bytes)
      return absl::UnavailableError(peer_ + " sent fewer rows than asked for");
    return samples;
  }

 private:
  std::string peer_, session_;
  std::unique_ptr<v1::ArchiveService::Stub> stub_;
  std::stop_token stop_;
};

absl::StatusOr<FrameStack> read_stack(const v1::ClaimTileResponse& tile, const Method& method,
                                      std::stop_token stop) {
  const RemoteArchive archive(tile, std::move(stop));
  GW_ASSIGN_OR_RETURN(v1::CaptureManifest manifest, archive.manifest());
  FrameStack stack{.manifest = std::move(manifest),
                   .first_row = tile.first_row(),
                   .row_count = tile.row_count(),
                   .rows = {},
                   .owner = nullptr};
  GW_ASSIGN_OR_RETURN(const std::vector<int> needed, method.frames_needed(stack.manifest));
  GW_ASSIGN_OR_RETURN(std::vector<std::uint16_t> samples,
                      archive.rows(stack.manifest, needed, stack.first_row, stack.row_count));
  const auto owned = std::make_shared<const std::vector<std::uint16_t>>(std::move(samples));
  stack.owner = owned;
  stack.rows.resize(static_cast<size_t>(stack.manifest.frames_size()));
  const size_t frame_samples = owned->size() / std::max<size_t>(needed.size(), 1);
  for (size_t i = 0; i < needed.size(); ++i) {
    stack.rows[static_cast<size_t>(needed[i])] = std::span(*owned).subspan(i * frame_samples, frame_samples);
  }
  GW_ASSIGN_OR_RETURN(stack.brightness,
                      measure_drift(stack.manifest, [&](int row, const std::vector<int>& frames) {
                        return archive.rows(stack.manifest, frames, row, 1);
                      }));
  return stack;
}

absl::StatusOr<Matte> solve(const v1::ClaimTileResponse& tile, int thread_count, std::stop_token stop) {
  const MethodOptions options(tile.options().begin(), tile.options().end());
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<Method> method, make_method(tile.method(), options));
  GW_ASSIGN_OR_RETURN(const FrameStack stack, read_stack(tile, *method, stop));
  return solve_in_bands(*method, stack, thread_count, stop);
}

grpc::Status send(v1::WorkService::Stub& work, const v1::ClaimTileResponse& tile, const Matte& matte,
                  const std::string& bytes) {
  v1::CompleteTileRequest first;
  *first.mutable_lease() = tile.lease();
  std::int64_t object = 0, flagged = 0;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      object += matte.coverage(x, y) > 0.0f ? 1 : 0;
      flagged += matte.flags(x, y) != kFlagNone ? 1 : 0;
    }
  }
  first.set_object_pixel_count(object);
  first.set_flagged_pixel_count(flagged);
  grpc::ClientContext context;
  set_deadline(context, std::chrono::minutes(1));
  v1::CompleteTileResponse response;
  const auto writer = work.CompleteTile(&context, &response);
  writer->Write(first);
  for (size_t at = 0; at < bytes.size(); at += kChunkBytes) {
    v1::CompleteTileRequest chunk;
    chunk.set_chunk(bytes.substr(at, kChunkBytes));
    if (!writer->Write(chunk)) break;
  }
  writer->WritesDone();
  return writer->Finish();
}

void work_on(v1::WorkService::Stub& work, const v1::ClaimTileResponse& tile, int thread_count,
             std::stop_token stop) {
  const LeaseKeeper keeper(work, tile, stop);
  const std::stop_token in_vain = keeper.in_vain();
  const std::string what = fmt::format("session={} tile={}", tile.lease().session(), tile.lease().tile());
  absl::StatusOr<Matte> matte = solve(tile, thread_count, in_vain);
  // A node that holds the frames may be starting again: its silence is no fault of the tile.
  while (absl::IsUnavailable(matte.status()) && !in_vain.stop_requested()) {
    spdlog::warn("tile waits {} error=\"{}\"", what, std::string(matte.status().message()));
    wait(in_vain, std::chrono::seconds(1));
    matte = solve(tile, thread_count, in_vain);
  }
  if (in_vain.stop_requested()) {
    spdlog::warn("tile given up {}", what);
    return;
  }
  absl::StatusOr<std::string> bytes =
      matte.ok() ? encode_matte(*matte) : absl::StatusOr<std::string>(matte.status());
  if (!bytes.ok()) {
    const absl::Status& status = bytes.status();
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
    const grpc::Status status = send(work, tile, *matte, *bytes);
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
