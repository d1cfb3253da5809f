#include "camera-node/services/frame_keeper.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "camera-node/camera_metrics.h"
#include "core/base/status.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

constexpr int kMaxBatch = 4096;
constexpr size_t kMaxPictures_bytes = 256 << 20;  // in memory at a time, in addition to the ring's frames

bool is_patch_learning_frame(const v1::Frame& frame) {
  return kind_of(frame.stimulus()) == StimulusKind::kPatch;
}

// Disk space to check for. Frames of a video may use the reserve: a video cannot be continued later.
std::int64_t bytes_of(const std::vector<Archive::NewFrame>& frames) {
  size_t bytes = 0;
  for (const Archive::NewFrame& frame : frames) {
    const bool of_video = frame.record.object() && kind_of(frame.record.stimulus()) == StimulusKind::kRamp;
    if (!of_video) bytes += tiff_size_bytes(shape_of(frame.image));
  }
  return static_cast<std::int64_t>(bytes);
}

v1::UnseenPatch unseen_patch(const PatchProof::LearningSet& set) {
  v1::UnseenPatch patch;
  patch.set_monitor(set.frames.front().record.stimulus().panel());
  patch.set_reason(std::string(set.learned.message()));
  patch.set_dark(absl::IsNotFound(set.learned));
  patch.set_contradicts(absl::IsOutOfRange(set.learned));
  return patch;
}

}  // namespace

absl::StatusOr<std::vector<FrameKeeper::Held>> FrameKeeper::find(const Frames& wanted) const {
  if (wanted.size() > kMaxBatch) {
    return absl::InvalidArgumentError(
        fmt::format("{} frames are requested at once; at most {} are allowed", wanted.size(), kMaxBatch));
  }
  std::vector<Held> frames;
  for (const v1::Frame& record : wanted) {
    if (record.step() < 0 || !record.file().empty())
      return absl::InvalidArgumentError("a frame to keep needs a step of 0 or more, and no file");
    std::optional<CapturedFrame> found = ring_.find(record.sequence());
    if (!found) continue;
    // A frame without timestamps is proven only by its pixels.
    const v1::Proof proof = found->taken.untimed() ? v1::PROOF_UNSPECIFIED : v1::PROOF_TIME;
    frames.push_back({.record = record, .frame = *std::move(found)});
    frames.back().record.set_proof(proof);
  }
  return frames;
}

absl::StatusOr<std::vector<Archive::NewFrame>> FrameKeeper::find_pictures(const Frames& wanted) const {
  GW_ASSIGN_OR_RETURN(const std::vector<Held> held, find(wanted));
  std::vector<Archive::NewFrame> frames;
  for (const Held& each : held) {
    absl::StatusOr<Image16> image = each.frame.image();
    if (absl::IsUnavailable(image.status())) continue;  // lost, as if it had left the ring
    GW_RETURN_IF_ERROR(image.status());
    frames.push_back({.record = each.record, .image = *std::move(image)});
  }
  return frames;
}

std::map<std::int64_t, CapturedFrame> FrameKeeper::find_last(const v1::LearnPatchesRequest& request) const {
  std::map<std::int64_t, CapturedFrame> last;
  for (int i = 0; i < std::min(request.frames_size(), request.last_sequences_size()); ++i) {
    if (std::optional<CapturedFrame> found = ring_.find(request.last_sequences(i)))
      last.emplace(request.frames(i).sequence(), *std::move(found));
  }
  return last;
}

nanoseconds FrameKeeper::wait_of(const Frames& wanted) const {
  const std::optional<CapturedFrame> newest = ring_.newest();
  nanoseconds waited{};
  for (const v1::Frame& record : wanted) {
    const std::optional<CapturedFrame> found = ring_.find(record.sequence());
    if (!newest || !found) continue;
    waited = std::max(waited, nanoseconds(newest->taken.exposure_end_ns() - found->taken.exposure_end_ns()));
  }
  return waited;
}

absl::Status FrameKeeper::use_proof_of(const std::string& session, Archive& archive) {
  if (proof_session_ == session) return absl::OkStatus();
  proof_ = {};
  GW_RETURN_IF_ERROR(proof_.learn_from(archive));
  of_calibration_ = archive.manifest().plan().has_calibration();
  proof_session_ = session;
  learning_since_ = std::numeric_limits<std::int64_t>::max();
  return absl::OkStatus();
}

absl::StatusOr<std::vector<v1::Frame>> FrameKeeper::store(Archive& archive,
                                                          const std::vector<Archive::NewFrame>& frames,
                                                          nanoseconds waited) {
  GW_RETURN_IF_ERROR(store_.room().check(bytes_of(frames)));
  const FrameForm form = of_calibration_ ? FrameForm::kPlain : form_.choose(waited);
  const nanoseconds begin = monotonic_now();
  GW_ASSIGN_OR_RETURN(std::vector<v1::Frame> stored, archive.add(frames, form));
  form_.learn(form, frames.size() * tiff_size_bytes(archive.shape()), monotonic_now() - begin);
  camera_metrics().kept.Increment(static_cast<double>(stored.size()));
  return stored;
}

absl::StatusOr<v1::KeepFramesResponse> FrameKeeper::keep(const v1::KeepFramesRequest& request) {
  if (std::ranges::any_of(request.frames(), is_patch_learning_frame))
    return absl::InvalidArgumentError("KeepFrames got a frame of kind \"patch\"; send it with LearnPatches");
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<Archive> archive, store_.find(request.session()));
  const nanoseconds waited = wait_of(request.frames());
  // From here on they may leave the ring.
  GW_ASSIGN_OR_RETURN(std::vector<Held> held, find(request.frames()));
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(use_proof_of(request.session(), *archive));
  v1::KeepFramesResponse response;
  std::vector<Archive::NewFrame> frames;
  size_t bytes = 0;
  for (size_t i = 0; i < held.size(); ++i) {
    absl::StatusOr<Image16> image = held[i].frame.image();
    if (image.ok()) {
      bytes += image->samples.size() * sizeof(std::uint16_t);
      frames.push_back({.record = std::move(held[i].record), .image = *std::move(image)});
    } else if (!absl::IsUnavailable(image.status())) {  // else lost, as if it had left the ring
      return image.status();
    }
    held[i].frame = {};  // its buffer
    if (bytes < kMaxPictures_bytes && i + 1 < held.size()) continue;
    GW_RETURN_IF_ERROR(judge_and_store(*archive, std::exchange(frames, {}), waited, response));
    bytes = 0;
  }
  camera_metrics().refused.Increment(response.refused());
  return response;
}

absl::Status FrameKeeper::judge_and_store(Archive& archive, std::vector<Archive::NewFrame> frames,
                                          nanoseconds waited, v1::KeepFramesResponse& response) {
  std::vector<Archive::NewFrame> proven;
  for (Archive::NewFrame& frame : frames) {
    PatchVerdict verdict = proof_.judge(frame.record, frame.image);
    if (frame.record.proof() == v1::PROOF_UNSPECIFIED && verdict == PatchVerdict::kAgrees)
      verdict = PatchVerdict::kUnreadable;
    if (verdict == PatchVerdict::kAgrees) {
      proven.push_back(std::move(frame));
      continue;
    }
    response.add_refused_steps(frame.record.step());
    if (verdict == PatchVerdict::kUnreadable) response.add_unreadable_steps(frame.record.step());
  }
  response.set_refused(response.refused() + static_cast<int>(frames.size() - proven.size()));
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Frame> stored, store(archive, proven, waited));
  for (const v1::Frame& frame : stored) *response.add_frames() = frame;
  return absl::OkStatus();
}

absl::StatusOr<v1::LearnPatchesResponse> FrameKeeper::learn(const v1::LearnPatchesRequest& request) {
  if (!std::ranges::all_of(request.frames(), is_patch_learning_frame))
    return absl::InvalidArgumentError(
        "LearnPatches takes frames of kind \"patch\"; send others with KeepFrames");
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<Archive> archive, store_.find(request.session()));
  GW_ASSIGN_OR_RETURN(std::vector<Archive::NewFrame> frames, find_pictures(request.frames()));
  const std::map<std::int64_t, CapturedFrame> last = find_last(request);
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(use_proof_of(request.session(), *archive));
  v1::LearnPatchesResponse response;
  std::vector<Archive::NewFrame> proven;
  std::set<int> waiting;
  for (Archive::NewFrame& frame : frames) {
    waiting.insert(frame.record.step());
    learning_since_ = std::min(learning_since_, frame.record.sequence());
    const auto later = last.find(frame.record.sequence());
    std::optional<PatchProof::LearningSet> set =
        later == last.end() ? proof_.add(std::move(frame)) : proof_.add(std::move(frame), later->second);
    if (!set) continue;
    const bool learned = set->learned.ok();
    const bool kept = learned || accepts(request, *set, response);
    for (Archive::NewFrame& member : set->frames) {
      waiting.erase(member.record.step());
      // Learning succeeds only if every frame shows the id of its step.
      if (learned) member.record.set_proof(v1::PROOF_TIME_AND_PATCH);
      if (kept) proven.push_back(std::move(member));
    }
  }
  for (const int step : waiting) response.add_waiting_steps(step);
  // They had to wait for each other.
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Frame> stored, store(*archive, proven, nanoseconds(0)));
  for (const v1::Frame& frame : stored) *response.add_frames() = frame;
  return response;
}

bool FrameKeeper::accepts(const v1::LearnPatchesRequest& request, const PatchProof::LearningSet& set,
                          v1::LearnPatchesResponse& response) const {
  v1::UnseenPatch& patch = *response.add_unseen_patches() = unseen_patch(set);
  if (set.frames.front().record.proof() == v1::PROOF_UNSPECIFIED) return false;
  if (patch.contradicts() || std::ranges::find(request.accept_unseen_patches(), patch.monitor()) ==
                                 request.accept_unseen_patches().end())
    return false;
  patch.set_frozen(patch.dark() && !has_changed_from(set.frames.front().image));
  return !patch.frozen();
}

bool FrameKeeper::has_changed_from(const Image16& image) const {
  return std::ranges::any_of(ring_.all(), [&](const CapturedFrame& frame) {
    if (frame.taken.sequence() < learning_since_) return false;
    const absl::StatusOr<Image16> other = frame.image();
    return other.ok() && shape_of(*other) == shape_of(image) && differs(*other, image);
  });
}

absl::StatusOr<v1::LookForPatchesResponse> FrameKeeper::look(const v1::LookForPatchesRequest& request) const {
  GW_ASSIGN_OR_RETURN(std::vector<Archive::NewFrame> frames, find_pictures(request.frames()));
  PatchProof proof;
  std::map<std::string, v1::UnseenPatch> unseen;  // by monitor
  for (const v1::Frame& frame : request.frames()) {
    v1::UnseenPatch& patch = unseen[frame.stimulus().panel()];
    patch.set_monitor(frame.stimulus().panel());
    patch.set_reason("not all frames of its id patch are still with the camera");
  }
  for (Archive::NewFrame& frame : frames) {
    const std::optional<PatchProof::LearningSet> set = proof.add(std::move(frame));
    if (!set) continue;
    const std::string& monitor = set->frames.front().record.stimulus().panel();
    if (set->learned.ok()) {
      unseen.erase(monitor);
    } else {
      unseen[monitor] = unseen_patch(*set);
    }
  }
  v1::LookForPatchesResponse response;
  for (auto& [monitor, patch] : unseen) *response.add_unseen_patches() = std::move(patch);
  return response;
}

}  // namespace glasswing
