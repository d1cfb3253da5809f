#include "solver/alpha/backings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/base/status.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

using Light = std::array<double, 3>;

constexpr double kMinColour = 0.1;  // by which a backing's colour must dominate, of full scale

bool is_dark(const Light& light) {
  return light == Light{};
}

// By how much the key channel exceeds the others.
double colour_in(const Light& light, int key) {
  double other = 0.0;
  for (int c = 0; c < kChannels; ++c) {
    if (c != key) other = std::max(other, light[c]);
  }
  return light[key] - other;
}

int key_of(const Light& light) {
  return static_cast<int>(std::ranges::max_element(light) - light.begin());
}

double key_signal(const Samples3& sample, const Vlahos& constants) {
  double other = 0.0;
  for (int c = 0; c < kChannels; ++c) {
    if (c != constants.key) other = std::max(other, sample[c]);
  }
  return sample[constants.key] - constants.a2 * other;
}

}  // namespace

absl::StatusOr<BackingLayout> lay_out_backings(const v1::CaptureManifest& manifest, int count) {
  GW_ASSIGN_OR_RETURN(const Exposures exposures, Exposures::of(manifest));
  BackingLayout layout;
  layout.stage = lay_out_stage(manifest, exposures);
  Backing black;
  std::map<std::string, std::map<Light, Backing>> shown;  // by monitor
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    if (!is_pattern(frame) || kind_of(frame.stimulus()) != StimulusKind::kSolid) continue;
    const Light light{colour_of(frame.stimulus(), 0), colour_of(frame.stimulus(), 1),
                      colour_of(frame.stimulus(), 2)};
    Backing& backing = is_dark(light) ? black : shown[frame.stimulus().panel()][light];
    backing.light = light;
    (frame.object() ? backing.object : backing.empty).push_back(exposures.exposed(manifest, i));
  }
  const auto whole = [](const Backing& backing) { return !backing.object.empty() && !backing.empty.empty(); };
  for (int texture = 0; texture < manifest.monitors_size(); ++texture) {
    layout.texture = texture;
    layout.backings.clear();
    if (whole(black) && count == 2) layout.backings.push_back(black);
    for (const auto& [light, backing] : shown[manifest.monitors(texture).name()]) {
      if (whole(backing)) layout.backings.push_back(backing);
    }
    if (count == 2 && layout.backings.size() >= 2) return layout;
    if (count == 2 || layout.backings.empty()) continue;
    const auto colour = [](const Backing& backing) {
      return colour_in(backing.light, key_of(backing.light));
    };
    const Backing strongest = *std::ranges::max_element(layout.backings, {}, colour);
    if (colour(strongest) < kMinColour) continue;
    layout.backings = {strongest};
    layout.key = key_of(strongest.light);
    return layout;
  }
  return absl::FailedPreconditionError(
      count == 2
          ? "no monitor showed two solids of different light both with and without the object (kind solid; "
            "black is one)"
          : fmt::format(
                "no monitor showed a solid of one colour, {} brighter in a channel than in the others, "
                "both with and without the object (kind solid, such as colour 0 0 1)",
                kMinColour));
}

std::vector<int> frames_of(const BackingLayout& layout) {
  const std::vector<int> stage = frames_of(layout.stage);
  std::set<int> frames(stage.begin(), stage.end());
  for (const Backing& backing : layout.backings) {
    for (const Shot& shot : {backing.object, backing.empty}) {
      for (const ExposedFrame& exposed : shot) frames.insert(exposed.frame);
    }
  }
  return {frames.begin(), frames.end()};
}

Cover triangulate(std::span<const BackingSample> samples) {
  struct Mean {
    double weight = 0.0, object = 0.0, empty = 0.0;
  };
  std::array<Mean, kChannels> means;
  double top = 0.0, bottom = 0.0, squares = 0.0;
  for (size_t c = 0; c < kChannels; ++c) {
    Mean& mean = means[c];
    for (const BackingSample& sample : samples) {
      const double weight = 1.0 / sample.variance[c];
      mean.weight += weight;
      mean.object += weight * sample.object[c];
      mean.empty += weight * sample.empty[c];
    }
    mean.object /= mean.weight;
    mean.empty /= mean.weight;
    for (const BackingSample& sample : samples) {
      const double off = sample.empty[c] - mean.empty, weight = 1.0 / sample.variance[c];
      top += weight * off * (sample.object[c] - mean.object);
      bottom += weight * off * off;
    }
  }
  Cover cover;
  if (bottom > 0.0) {
    cover.straight = std::clamp(top / bottom, 0.0, 1.0);
    cover.straight_sd = 1.0 / std::sqrt(bottom);
  }
  for (size_t c = 0; c < kChannels; ++c) {
    cover.foreground[c] = means[c].object - cover.straight * means[c].empty;
    for (const BackingSample& sample : samples) {
      const double miss = sample.object[c] - cover.foreground[c] - cover.straight * sample.empty[c];
      squares += miss * miss;
    }
  }
  cover.rms = std::sqrt(squares / static_cast<double>(kChannels * samples.size()));
  return cover;
}

Cover key_out(const BackingSample& sample, const Vlahos& constants) {
  Cover cover;
  const double backing = key_signal(sample.empty, constants);
  if (backing > 0.0)
    cover.straight = std::clamp(constants.a1 * key_signal(sample.object, constants) / backing, 0.0, 1.0);
  for (size_t c = 0; c < kChannels; ++c)
    cover.foreground[c] = std::max(sample.object[c] - cover.straight * sample.empty[c], 0.0);
  return cover;
}

}  // namespace glasswing
