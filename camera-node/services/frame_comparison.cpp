#include "camera-node/services/frame_comparison.h"

#include <fmt/format.h>

#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr int kMaxComparisons = 64;
constexpr size_t kMaxRead = 16;  // some 0.3 MB each

v1::FrameChange message_of(const PictureChange& change) {
  v1::FrameChange message;
  message.set_known(change.known);
  if (!change.known) return message;
  message.set_gain(change.gain);
  message.set_gain_sd(change.gain_sd);
  message.set_offset(change.offset);
  message.set_offset_sd(change.offset_sd);
  message.set_dx_px(change.dx_px);
  message.set_dx_sd_px(change.dx_sd_px);
  message.set_dy_px(change.dy_px);
  message.set_dy_sd_px(change.dy_sd_px);
  return message;
}

}  // namespace

absl::StatusOr<v1::CompareFramesResponse> FrameComparison::compare(const v1::CompareFramesRequest& request) {
  if (request.comparisons_size() > kMaxComparisons) {
    return absl::InvalidArgumentError(fmt::format("{} comparisons in one call; at most {} are allowed",
                                                  request.comparisons_size(), kMaxComparisons));
  }
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<Archive> archive, store_.find(request.session()));
  v1::CompareFramesResponse response;
  for (const v1::FrameComparison& comparison : request.comparisons()) {
    const absl::StatusOr<Brightness> reference = stored(*archive, comparison.reference_step());
    const absl::StatusOr<Brightness> frame = brightness(*archive, comparison);
    const bool both = reference.ok() && frame.ok() && reference->samples.size() == frame->samples.size();
    *response.add_changes() = message_of(both ? change_between(*reference, *frame) : PictureChange());
  }
  return response;
}

absl::StatusOr<Brightness> FrameComparison::stored(Archive& archive, int step) {
  GW_ASSIGN_OR_RETURN(const v1::Frame frame, archive.frame_of_step(step));
  {
    const std::lock_guard lock(mutex_);
    if (const auto read = read_.find(frame.checksum()); read != read_.end()) return read->second;
  }
  GW_ASSIGN_OR_RETURN(const std::string bytes, archive.read_frame_bytes(frame.file()));
  GW_ASSIGN_OR_RETURN(const Image16 image, decode_tiff(bytes));
  Brightness brightness = brightness_of(image);
  const std::lock_guard lock(mutex_);
  if (read_.size() >= kMaxRead) read_.clear();
  read_[frame.checksum()] = brightness;
  return brightness;
}

absl::StatusOr<Brightness> FrameComparison::brightness(Archive& archive,
                                                       const v1::FrameComparison& comparison) {
  if (comparison.has_step()) return stored(archive, comparison.step());
  const std::optional<CapturedFrame> found = ring_.find(comparison.sequence());
  if (!found) return absl::NotFoundError("the frame has left the ring");
  GW_ASSIGN_OR_RETURN(const Image16 image, found->image());
  return brightness_of(image);
}

}  // namespace glasswing
