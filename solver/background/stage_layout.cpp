#include "solver/background/stage_layout.h"

#include <map>
#include <set>
#include <tuple>

#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

std::vector<std::vector<int>> patches_of(const v1::CaptureManifest& manifest) {
  std::map<std::tuple<bool, double, std::string>, std::vector<int>> patches;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    if (kind_of(frame.stimulus()) != StimulusKind::kPatch) continue;
    patches[{frame.object(), frame.exposure_ms(), frame.stimulus().panel()}].push_back(i);
  }
  std::vector<std::vector<int>> lists;
  for (auto& [key, frames] : patches) lists.push_back(std::move(frames));
  return lists;
}

}  // namespace

double colour_of(const v1::Stimulus& stimulus, int channel) {
  return stimulus.colour_size() == 3 ? stimulus.colour(channel) : 1.0;
}

double gray_of(const v1::Stimulus& stimulus) {
  const double red = colour_of(stimulus, 0);
  return red == colour_of(stimulus, 1) && red == colour_of(stimulus, 2) ? red : -1.0;
}

int texture_of(const v1::CaptureManifest& manifest, const std::string& panel) {
  for (int i = 0; i < manifest.monitors_size(); ++i) {
    if (manifest.monitors(i).name() == panel) return i;
  }
  return -1;
}

StageLayout lay_out_stage(const v1::CaptureManifest& manifest, const Exposures& exposures) {
  StageLayout layout;
  std::map<std::string, StageLayout::Pair> pairs;  // by serialised stimulus
  bool object = false, empty = false;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    if (!is_pattern(frame)) continue;
    const ExposedFrame exposed = exposures.exposed(manifest, i);
    (frame.object() ? object : empty) = true;
    StageLayout::Pair& pair = pairs[frame.stimulus().SerializeAsString()];
    (frame.object() ? pair.object : pair.empty).push_back(exposed);
    if (frame.object() && kind_of(frame.stimulus()) == StimulusKind::kSolid &&
        gray_of(frame.stimulus()) == 0.0)
      layout.black.push_back(exposed);
  }
  for (auto& [stimulus, pair] : pairs) {
    if (!pair.object.empty() && !pair.empty.empty()) layout.pairs.push_back(std::move(pair));
  }
  layout.bare = empty && !object;
  layout.patches = patches_of(manifest);
  layout.monitors = lay_out_empty_stage(manifest);
  layout.camera = manifest.camera();
  return layout;
}

bool changed_by_object(const FrameStack& stack, const StageLayout& layout, const SilhouetteTest& test,
                       const SampleNoise& noise, int x, int y) {
  if (layout.bare) return false;
  std::vector<SilhouetteTest::Pair> pairs;
  pairs.reserve(layout.pairs.size() * kChannels);
  for (const StageLayout::Pair& pair : layout.pairs) {
    for (const int c : stack.channels(x, y)) {
      const size_t index = stack.sample_index(x, y, c);
      const MergedSample object = merge(stack, pair.object, index, noise);
      const MergedSample empty = merge(stack, pair.empty, index, noise);
      pairs.push_back({.object = object.radiance,
                       .empty = empty.radiance,
                       .variance = object.variance + empty.variance,
                       .saturated = object.saturated && empty.saturated});
    }
  }
  return test.test(pairs).object;
}

absl::Status check_black(const StageLayout& layout) {
  if (!layout.black.empty()) return absl::OkStatus();
  return absl::FailedPreconditionError(
      "the archive has no frame of the object before black (kind solid, colour 0 0 0)");
}

std::vector<int> frames_of(const StageLayout& layout) {
  std::set<int> frames;
  const auto need = [&](const Shot& shot) {
    for (const ExposedFrame& exposed : shot) frames.insert(exposed.frame);
  };
  for (const StageLayout::Pair& pair : layout.pairs) {
    need(pair.object);
    need(pair.empty);
  }
  need(layout.black);
  for (const std::vector<int>& patch : layout.patches) frames.insert(patch.begin(), patch.end());
  for (const int frame : frames_of(layout.monitors)) frames.insert(frame);
  return {frames.begin(), frames.end()};
}

}  // namespace glasswing
