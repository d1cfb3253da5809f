#include "core/archive/copy_archive.h"

#include <absl/cleanup/cleanup.h>
#include <fmt/format.h>
#include <google/protobuf/util/message_differencer.h>

#include <vector>

#include "core/archive/remote_archive.h"
#include "core/base/status.h"
#include "core/frame/archive.h"

namespace glasswing {
namespace {

// In memory at a time, and lost if the copy is interrupted.
constexpr size_t kBatchBytes = size_t{64} << 20;

// The frames of `manifest` that the archive lacks or cannot read.
absl::StatusOr<std::vector<int>> missing_in(Archive& archive, const v1::CaptureManifest& manifest) {
  std::vector<int> missing;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const absl::Status here = archive.map(manifest.frames(i).file()).status();
    if (!here.ok() && !absl::IsNotFound(here) && !absl::IsDataLoss(here)) return here;
    if (!here.ok()) missing.push_back(i);
  }
  return missing;
}

}  // namespace

absl::Status copy_archive(ArchiveStore& store, const v1::CopyArchiveRequest& request, std::stop_token stop,
                          const std::function<bool()>& is_gone,
                          const std::function<bool(const v1::CopyArchiveResponse&)>& tell) {
  GW_RETURN_IF_ERROR(store.begin_copy(request.session(), is_gone));
  const absl::Cleanup end = [&] { store.end_copy(request.session()); };
  const RemoteArchive from({request.from_address()}, request.session(), stop);
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, from.manifest());
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<Archive> archive, store.create(manifest));
  v1::CaptureManifest there = manifest, here = archive->manifest();
  there.clear_frames();
  here.clear_frames();
  there.set_format_version(here.format_version());
  if (!google::protobuf::util::MessageDifferencer::Equals(here, there)) {
    return absl::AlreadyExistsError(
        fmt::format("{} holds another session \"{}\"", archive->directory().string(), request.session()));
  }

  v1::CopyArchiveResponse progress;
  progress.set_frame_count(manifest.frames_size());
  for (const v1::Frame& frame : manifest.frames())
    progress.set_byte_count(progress.byte_count() + frame.size_bytes());
  GW_ASSIGN_OR_RETURN(const std::vector<int> missing, missing_in(*archive, manifest));
  std::int64_t left = 0;
  for (const int frame : missing) left += manifest.frames(frame).size_bytes();
  GW_RETURN_IF_ERROR(store.room().check(left));
  progress.set_frames_done(manifest.frames_size() - static_cast<int>(missing.size()));
  progress.set_bytes_done(progress.byte_count() - left);

  for (size_t next = 0; next < missing.size();) {
    if (is_gone() || !tell(progress)) return absl::CancelledError("the client no longer waits for the copy");
    std::vector<Archive::CopiedFrame> batch;
    absl::Status read;
    for (size_t bytes = 0; next < missing.size() && bytes < kBatchBytes && !stop.stop_requested(); ++next) {
      absl::StatusOr<std::string> frame = from.file(manifest, missing[next]);
      read = frame.status();
      if (!read.ok()) break;
      bytes += frame->size();
      batch.push_back({.record = manifest.frames(missing[next]), .bytes = *std::move(frame)});
    }
    GW_RETURN_IF_ERROR(archive->add_copies(batch));
    GW_RETURN_IF_ERROR(read);
    if (stop.stop_requested()) return absl::CancelledError("this node is stopping");
    progress.set_frames_done(progress.frames_done() + static_cast<int>(batch.size()));
    for (const Archive::CopiedFrame& frame : batch)
      progress.set_bytes_done(progress.bytes_done() + frame.record.size_bytes());
  }
  GW_RETURN_IF_ERROR(archive->seal());
  tell(progress);
  return absl::OkStatus();
}

}  // namespace glasswing
