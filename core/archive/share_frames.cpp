#include "core/archive/share_frames.h"

#include <fmt/format.h>
#include <google/protobuf/util/message_differencer.h>

#include <filesystem>
#include <system_error>

#include "core/base/status.h"
#include "core/file/file.h"
#include "core/frame/archive.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using google::protobuf::util::MessageDifferencer;

// What decides whether frames of the empty stage are the same.
v1::CaptureManifest rig_and_plan(const v1::CaptureManifest& manifest) {
  v1::CaptureManifest part;
  *part.mutable_monitors() = manifest.monitors();
  *part.mutable_camera() = manifest.camera();
  *part.mutable_plan() = manifest.plan();
  part.mutable_plan()->clear_rounds();
  return part;
}

// Links one frame's file into the other archive under a temporary name.
absl::StatusOr<fs::path> linked(Archive& from, const Archive& to, const v1::Frame& frame) {
  GW_RETURN_IF_ERROR(from.map(frame.file()).status());  // verified
  const fs::path path = to.directory() / "frames" / fmt::format(".shared-{}.tmp", frame.step());
  std::error_code error;
  fs::remove(path, error);
  fs::create_hard_link(from.directory() / frame.file(), path, error);
  if (!error) return path;
  GW_ASSIGN_OR_RETURN(const std::string bytes, from.read_frame_bytes(frame.file()));
  GW_RETURN_IF_ERROR(write_file_flushed(path, bytes));
  return path;
}

}  // namespace

absl::Status share_frames(ArchiveStore& store, const v1::ShareFramesRequest& request) {
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<Archive> to, store.find(request.session()));
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<Archive> from, store.find(request.from_session()));
  const v1::CaptureManifest there = from->manifest(), here = to->manifest();
  if (!MessageDifferencer::Equals(rig_and_plan(there), rig_and_plan(here))) {
    return absl::FailedPreconditionError(fmt::format(
        "session \"{}\" cannot take the empty stage of session \"{}\": plan, camera or monitors of "
        "the two differ",
        request.session(), request.from_session()));
  }
  std::vector<Archive::ArrivedFrame> frames;
  for (const v1::Frame& frame : there.frames()) {
    if (frame.object() || frame.step() < 0 || to->frame_of_step(frame.step()).ok()) continue;
    GW_ASSIGN_OR_RETURN(const fs::path file, linked(*from, *to, frame));
    frames.push_back({.record = frame, .file = file});
  }
  GW_RETURN_IF_ERROR(to->add_arrived(frames));
  std::error_code none;  // a name that was there already, of a call that broke off, leaves its temporary one
  for (const Archive::ArrivedFrame& frame : frames) fs::remove(frame.file, none);
  return absl::OkStatus();
}

}  // namespace glasswing
