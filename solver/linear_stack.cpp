#include "solver/linear_stack.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/base/status.h"

namespace glasswing {
namespace {

// Brightness takes what is above black to this part more, and noise around black to that part below.
constexpr float kDriftAbove = 0.25f, kDriftBelow = 0.05f;

struct Owned {
  std::shared_ptr<const void> source;
  std::vector<std::vector<std::uint16_t>> frames;
};

// By object and exposure, the first frame of a monitor's black that has rows.
std::map<std::pair<bool, double>, size_t> black_frames(const FrameStack& stack) {
  std::map<std::pair<bool, double>, size_t> black;
  for (size_t i = 0; i < stack.rows.size(); ++i) {
    const v1::Frame& frame = stack.manifest.frames(static_cast<int>(i));
    const v1::Stimulus& stimulus = frame.stimulus();
    const bool dark = stimulus.kind() == "solid" && stimulus.colour_size() == 3 &&
                      std::ranges::all_of(stimulus.colour(), [](double value) { return value == 0.0; });
    if (dark && frame.also_lit().empty() && !stack.rows[i].empty())
      black.emplace(std::pair(frame.object(), frame.exposure_ms()), i);
  }
  return black;
}

}  // namespace

absl::StatusOr<LinearStack> LinearStack::create(const v1::CaptureManifest& manifest) {
  GW_ASSIGN_OR_RETURN(SessionLight light, SessionLight::create(manifest));
  return LinearStack(std::move(light));
}

FrameStack LinearStack::of(FrameStack stack) const {
  const bool drifts = !stack.brightness.empty();
  if (!light_.linearises() && !light_.unmixes() && !drifts) return stack;
  const float low = light_.lowest() - (drifts ? kDriftBelow : 0.0f),
              high = light_.highest() * (drifts ? 1.0f + kDriftAbove : 1.0f);
  stack.unit = (high - low) / static_cast<float>(kSaturatedCode - 1);
  stack.zero = -low / stack.unit;
  const auto code_of = [&](float light) {
    const float code = stack.zero + light / stack.unit + 0.5f;
    return static_cast<std::uint16_t>(std::clamp(code, 0.0f, static_cast<float>(kSaturatedCode - 1)));
  };
  const auto owned = std::make_shared<Owned>();
  owned->source = stack.owner;
  owned->frames.resize(stack.rows.size());
  const auto black = black_frames(stack);
  for (size_t i = 0; i < stack.rows.size(); ++i) {
    const std::span<const std::uint16_t> samples = stack.rows[i];
    const v1::Frame& frame = stack.manifest.frames(static_cast<int>(i));
    const float share = drifts ? 1.0f / stack.brightness[i] : 1.0f;
    const auto dark = black.find({frame.object(), frame.exposure_ms()});
    const bool drifted = share != 1.0f && dark != black.end();
    std::vector<std::uint16_t>& to = owned->frames[i];
    to.resize(samples.size());
    for (size_t at = 0; at + 3 <= samples.size(); at += 3) {
      SessionLight::Pixel pixel = light_.pixel(samples.data() + at);
      if (drifted) {
        const SessionLight::Pixel below = light_.pixel(stack.rows[dark->second].data() + at);
        for (size_t c = 0; c < 3; ++c)
          pixel.light[c] = below.light[c] + (pixel.light[c] - below.light[c]) * share;
      }
      for (size_t c = 0; c < 3; ++c)
        to[at + c] = pixel.saturated[c] ? std::uint16_t{65535} : code_of(pixel.light[c]);
    }
  }
  for (size_t i = 0; i < stack.rows.size(); ++i) stack.rows[i] = owned->frames[i];
  stack.owner = owned;
  if (light_.linearises()) {
    v1::Camera& camera = *stack.manifest.mutable_camera();
    camera.set_read_sd(stack.manifest.camera_calibration().read_sd());
    camera.set_gain(stack.manifest.camera_calibration().shot_gain());
  }
  for (int c = 0; c < kChannels; ++c) stack.noise_factor[static_cast<size_t>(c)] = light_.noise_factor(c);
  return stack;
}

void LinearStack::describe(v1::MatteMetadata& metadata) const {
  metadata.set_linearised(light_.linearises());
  metadata.set_unmixed(light_.unmixes());
  for (const std::string& warning : light_.warnings()) metadata.add_warnings(warning);
}

}  // namespace glasswing
