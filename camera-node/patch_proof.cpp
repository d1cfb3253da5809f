#include "camera-node/patch_proof.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "core/base/status.h"

namespace glasswing {
namespace {

// Cameras report what they did, which is a little off what was asked.
bool same_exposure(double a_ms, double b_ms) {
  return std::abs(a_ms - b_ms) <= 0.02 * std::max(a_ms, b_ms);
}

}  // namespace

absl::Status PatchProof::learn_from(Archive& archive) {
  std::map<std::tuple<bool, long, std::string>, std::vector<Archive::NewFrame>> lessons;
  const v1::CaptureManifest manifest = archive.manifest();
  for (const v1::Frame& frame : manifest.frames()) {
    if (frame.stimulus().kind() != "patch") continue;
    GW_ASSIGN_OR_RETURN(const std::string bytes, archive.read_frame_bytes(frame.file()));
    GW_ASSIGN_OR_RETURN(Image16 image, decode_tiff(bytes));
    const long exposure_us = std::lround(1000.0 * frame.exposure_ms());
    lessons[{frame.object(), exposure_us, frame.stimulus().panel()}].push_back(
        {.record = frame, .image = std::move(image)});
  }
  for (const auto& [key, frames] : lessons) {
    (void)learn(frames);  // if it teaches nothing, that was accepted
  }
  return absl::OkStatus();
}

absl::Status PatchProof::learn(std::span<const Archive::NewFrame> frames) {
  std::vector<Image16> images;
  for (const std::uint16_t id : patch_learning_ids()) {
    const auto found = std::find_if(frames.begin(), frames.end(), [id](const Archive::NewFrame& frame) {
      return frame.record.stimulus().patch_id() == id;
    });
    if (found == frames.end())
      return absl::FailedPreconditionError(fmt::format("there is no frame of the id patch {:#06x}", id));
    images.push_back(found->image);
  }
  const v1::Frame& first = frames.front().record;
  Known known{.object = first.object(),
              .exposure_ms = first.exposure_ms(),
              .monitor = first.stimulus().panel(),
              .reader = {}};
  GW_ASSIGN_OR_RETURN(known.reader, PatchReader::learn(images));
  std::erase_if(known_, [&](const Known& other) {
    return other.object == known.object && other.monitor == known.monitor &&
           same_exposure(other.exposure_ms, known.exposure_ms);
  });
  known_.push_back(std::move(known));
  return absl::OkStatus();
}

bool PatchProof::agrees(v1::Frame& record, const Image16& image) const {
  if (!record.has_patch_id()) return true;
  for (const Known& known : known_) {
    if (known.object != record.object() || !same_exposure(known.exposure_ms, record.exposure_ms())) continue;
    if (known.reader.read(image) != record.patch_id()) return false;
    if (known.monitor == record.stimulus().panel()) record.set_proof(v1::PROOF_TIME_AND_PATCH);
  }
  return true;
}

}  // namespace glasswing
