#include "camera-node/services/patch_proof.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/status.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

// Cameras report the actual exposure, which differs slightly from the requested one.
bool same_exposure(double a_ms, double b_ms) {
  return std::abs(a_ms - b_ms) <= 0.02 * std::max(a_ms, b_ms);
}

}  // namespace

absl::Status PatchProof::learn_from(Archive& archive) {
  const v1::CaptureManifest manifest = archive.manifest();
  for (const v1::Frame& frame : manifest.frames()) {
    if (kind_of(frame.stimulus()) != StimulusKind::kPatch) continue;
    GW_ASSIGN_OR_RETURN(const std::string bytes, archive.read_frame_bytes(frame.file()));
    GW_ASSIGN_OR_RETURN(Image16 image, decode_tiff(bytes));
    (void)add({.record = frame, .image = std::move(image)});  // a set that shows no patch was accepted unseen
  }
  return absl::OkStatus();
}

std::optional<PatchProof::LearningSet> PatchProof::add(Archive::NewFrame frame) {
  const v1::Frame newest = frame.record;
  const auto belongs = [&](const Archive::NewFrame& other) {
    return other.record.stimulus().panel() == newest.stimulus().panel() &&
           other.record.object() == newest.object() &&
           same_exposure(other.record.exposure_ms(), newest.exposure_ms());
  };
  std::erase_if(waiting_, [&](const Archive::NewFrame& other) {
    return belongs(other) && other.record.stimulus().patch_id() == newest.stimulus().patch_id();
  });
  waiting_.push_back(std::move(frame));
  LearningSet set;
  for (const std::uint16_t id : patch_learning_ids()) {
    const auto found = std::find_if(waiting_.begin(), waiting_.end(), [&](const Archive::NewFrame& other) {
      return belongs(other) && other.record.stimulus().patch_id() == id;
    });
    if (found == waiting_.end()) return std::nullopt;
    set.frames.push_back(*found);
  }
  std::erase_if(waiting_, belongs);
  set.learned = learn(set.frames);
  return set;
}

absl::Status PatchProof::learn(const std::vector<Archive::NewFrame>& frames) {
  std::vector<Image16> images;
  for (const Archive::NewFrame& frame : frames) images.push_back(frame.image);
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

PatchVerdict PatchProof::judge(v1::Frame& record, const Image16& image) const {
  if (!record.has_patch_id()) return PatchVerdict::kAgrees;
  for (const Known& known : known_) {
    if (known.object != record.object() || !same_exposure(known.exposure_ms, record.exposure_ms())) continue;
    const std::optional<std::uint16_t> id = known.reader.read(image);
    if (!id) return PatchVerdict::kUnreadable;
    if (*id != record.patch_id()) return PatchVerdict::kOtherId;
    if (known.monitor == record.stimulus().panel()) record.set_proof(v1::PROOF_TIME_AND_PATCH);
  }
  return PatchVerdict::kAgrees;
}

}  // namespace glasswing
