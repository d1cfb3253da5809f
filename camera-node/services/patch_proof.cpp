#include "camera-node/services/patch_proof.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>

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

std::optional<PatchProof::LearningSet> PatchProof::add(Archive::NewFrame frame,
                                                       std::optional<CapturedFrame> last) {
  const v1::Frame newest = frame.record;
  const auto belongs = [&](const Waiting& other) {
    const v1::Frame& record = other.frame.record;
    return record.stimulus().panel() == newest.stimulus().panel() && record.object() == newest.object() &&
           same_exposure(record.exposure_ms(), newest.exposure_ms());
  };
  const auto shows = [](std::uint32_t id) {
    return [id](const Waiting& other) { return other.frame.record.stimulus().patch_id() == id; };
  };
  std::erase_if(waiting_, [&](const Waiting& other) {
    return belongs(other) && shows(newest.stimulus().patch_id())(other);
  });
  waiting_.push_back({.frame = std::move(frame), .last = std::move(last)});
  const auto own = std::stable_partition(waiting_.begin(), waiting_.end(), std::not_fn(belongs));
  std::vector<std::vector<Waiting>::iterator> found;  // by learning id
  for (const std::uint16_t id : patch_learning_ids()) {
    found.push_back(std::find_if(own, waiting_.end(), shows(id)));
    if (found.back() == waiting_.end()) return std::nullopt;
  }
  std::vector<Waiting> set;
  for (const auto& member : found) set.push_back(std::move(*member));
  waiting_.erase(own, waiting_.end());
  LearningSet result{.frames = {}, .learned = learn(set)};
  for (Waiting& member : set) result.frames.push_back(std::move(member.frame));
  return result;
}

absl::Status PatchProof::learn(const std::vector<Waiting>& set) {
  std::vector<Image16> images;
  for (const Waiting& member : set) images.push_back(member.frame.image);
  const v1::Frame& first = set.front().frame.record;
  Known known{.object = first.object(),
              .exposure_ms = first.exposure_ms(),
              .monitor = first.stimulus().panel(),
              .reader = {}};
  GW_ASSIGN_OR_RETURN(known.reader, PatchReader::learn(images));
  for (const Waiting& member : set) {
    if (!member.last) continue;
    const absl::StatusOr<Image16> image = member.last->image();
    if (absl::IsUnavailable(image.status())) continue;  // lost
    GW_RETURN_IF_ERROR(image.status());
    const std::optional<std::uint16_t> id = known.reader.read(*image);
    if (!id || !known.shows(*id, member.frame.record.stimulus().patch_id()))
      return absl::OutOfRangeError("the id patch changes before the reported time");
  }
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
    if (!known.shows(*id, record.patch_id())) return PatchVerdict::kOtherId;
    if (known.monitor == record.stimulus().panel()) record.set_proof(v1::PROOF_TIME_AND_PATCH);
  }
  return PatchVerdict::kAgrees;
}

}  // namespace glasswing
