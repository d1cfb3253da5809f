#include "solver/method/linear_stack.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "core/base/status.h"
#include "core/image/image.h"
#include "core/import/photograph_response.h"
#include "solver/method/exposure_merge.h"
#include "solver/method/frame_correction.h"

namespace glasswing {
namespace {

// Removing the drift raises light above 1 by at most this much, and noise around black below 0 by that much.
constexpr float kDriftAbove = 0.25f, kDriftBelow = 0.05f;

constexpr float kGraysAbove = 1.5f;  // of white, above which grays are used

constexpr float kMaxPedestal = 0.25f;
constexpr double kSameCrosstalk = 0.02;

// The light of the lowest unsaturated sample, but not below the reach of noise: a curve's end may run far
// below that.
float lowest(const FrameLight& light) {
  float darkest = 0.0f;
  for (int c = 0; c < kChannels; ++c) darkest = std::min(darkest, light.light(0, c));
  return std::max(darkest, -kMaxPedestal);
}

// The light of the camera's lowest code, in the brightest channel.
float cut_off(const FrameLight& light) {
  float brightest = light.light(0, 0);
  for (int c = 1; c < kChannels; ++c) brightest = std::max(brightest, light.light(0, c));
  return brightest;
}

// For users: reasons to distrust this light.
std::vector<std::string> warnings_of(const v1::CaptureManifest& manifest, const PrimaryMix& mix) {
  std::vector<std::string> warnings;
  if (mix.spread() > kSameCrosstalk) {
    warnings.push_back(
        fmt::format("the monitors' primaries differ by up to {:.1f} % of white as the camera sees them; "
                    "composites use their mean",
                    100.0 * mix.spread()));
  }
  if (!manifest.has_camera_calibration()) {
    if (manifest.camera().response() == "unknown") {
      warnings.push_back(
          fmt::format("camera \"{}\" was not calibrated: its samples were treated as linear light, which may "
                      "be wrong; `glasswing calibrate camera` measures it",
                      manifest.camera().name()));
    }
    return warnings;
  }
  const v1::CameraCalibration& calibration = manifest.camera_calibration();
  for (const v1::Frame& frame : manifest.frames()) {
    if (calibration.gain() <= 0.0 || frame.gain() <= 0.0) continue;
    if (std::abs(frame.gain() / calibration.gain() - 1.0) <= 0.01) continue;
    warnings.push_back(fmt::format("{} was taken with a gain of {}; camera \"{}\" was calibrated with {}",
                                   frame.file(), frame.gain(), calibration.camera(), calibration.gain()));
    break;
  }
  return warnings;
}

struct Owned {
  std::shared_ptr<const void> source;
  std::vector<std::vector<std::uint16_t>> frames;
};

bool has_grays(const FrameCorrections* corrections) {
  return corrections != nullptr && std::ranges::any_of(corrections->of_frame, [](const FrameCorrection& own) {
           return own.grays.gray >= 0;
         });
}

constexpr std::array<float, 3> kUnchanged{1.0f, 1.0f, 1.0f};

}  // namespace

absl::StatusOr<LinearStack> LinearStack::create(const v1::CaptureManifest& manifest) {
  GW_ASSIGN_OR_RETURN(FrameLight light, FrameLight::create(manifest));
  GW_ASSIGN_OR_RETURN(PrimaryMix mix, PrimaryMix::create(manifest));
  LinearStack linear(std::move(light), std::move(mix));
  linear.warnings_ = warnings_of(manifest, linear.mix_);
  for (const v1::Frame& frame : manifest.frames())
    linear.frames_.push_back({.key = {frame.object(), frame.exposure_ms()}, .black = is_black(frame)});
  return linear;
}

absl::Status LinearStack::decode(const std::string& response) {
  GW_ASSIGN_OR_RETURN(const PhotographResponse curve, PhotographResponse::create(response, 0.0));
  Image16 codes(256, 256, 1);
  std::iota(codes.samples.begin(), codes.samples.end(), std::uint16_t{0});
  curve.linearise(codes);
  light_ = FrameLight::of_samples(codes.samples);
  return absl::OkStatus();
}

std::map<LinearStack::BlackKey, size_t> LinearStack::black_frames(const FrameStack& stack) const {
  std::map<BlackKey, size_t> black;
  for (size_t i = 0; i < stack.rows.size(); ++i) {
    if (frames_[i].black && !stack.rows[i].empty()) black.emplace(frames_[i].key, i);
  }
  return black;
}

std::vector<float> LinearStack::corrected(const FrameStack& stack, size_t frame) const {
  std::vector<float> corrected;
  if (stack.corrections == nullptr) return corrected;
  const FrameCorrection& own = stack.corrections->of_frame[frame];
  const std::span<const std::uint16_t> samples = stack.rows[frame];
  corrected.resize(samples.size());
  for (size_t at = 0; at < samples.size(); ++at)
    corrected[at] = light_.saturated(samples[at]) ? NAN : light_.light(samples[at], stack.channel_at(at));
  for (size_t k = 0; k < own.before.size(); ++k) {
    const float share = stack.corrections->ghost[k];
    if (share == 0.0f || own.before[k] < 0) continue;
    const std::span<const std::uint16_t> last = stack.rows[own.before[k]];
    if (last.size() != samples.size()) continue;
    for (size_t at = 0; at < samples.size(); ++at)
      corrected[at] -= share * light_.light(last[at], stack.channel_at(at));
  }
  for (size_t at = 0; at < samples.size(); ++at) {
    const size_t channel = stack.channel_at(at);
    corrected[at] = (corrected[at] - own.offset[channel]) / own.gain[channel];
  }
  if (own.grays.gray >= 0 && std::ranges::any_of(corrected, [](float light) { return std::isnan(light); })) {
    const std::vector<float> gray = this->corrected(stack, static_cast<size_t>(own.grays.gray)),
                             black = this->corrected(stack, static_cast<size_t>(own.grays.black));
    if (gray.size() != samples.size() || black.size() != samples.size()) return corrected;
    for (size_t at = 0; at < samples.size(); ++at) {
      if (std::isnan(corrected[at])) corrected[at] = black[at] + (gray[at] - black[at]) / own.grays.level;
    }
  }
  return corrected;
}

FrameStack LinearStack::of(FrameStack stack) const {
  const bool drifts = !stack.brightness.empty() || stack.corrections != nullptr;
  if (light_.is_identity() && !drifts) return stack;
  // Saturated samples keep the light of full scale: a monitor's white is often exactly that.
  const float low = lowest(light_) - (drifts ? kDriftBelow : 0.0f),
              high = has_grays(stack.corrections.get()) ? kGraysAbove
                     : stack.brightness.empty()         ? 1.0f
                                                        : 1.0f + kDriftAbove;
  stack.unit = (high - low) / static_cast<float>(kSaturatedCode - 1);
  stack.zero = -low / stack.unit;
  stack.full = 1.0f;
  stack.cut_off = cut_off(light_) + stack.unit;
  const auto code_of = [&](float light) {
    const float code = stack.zero + light / stack.unit + 0.5f;
    return static_cast<std::uint16_t>(std::clamp(code, 0.0f, static_cast<float>(kSaturatedCode - 1)));
  };
  const auto owned = std::make_shared<Owned>();
  owned->source = stack.owner;
  owned->frames.resize(stack.rows.size());
  const auto black = !stack.brightness.empty() ? black_frames(stack) : std::map<BlackKey, size_t>();
  for (size_t i = 0; i < stack.rows.size(); ++i) {
    const std::span<const std::uint16_t> samples = stack.rows[i];
    const std::array<float, 3> brightness = stack.brightness.empty() ? kUnchanged : stack.brightness[i];
    const auto dark = black.find(frames_[i].key);
    const bool changed = brightness != kUnchanged;
    const bool drifted = changed && dark != black.end(), exposed = changed && black.empty();
    const std::vector<float> light_of_frame = corrected(stack, i);
    std::vector<std::uint16_t>& to = owned->frames[i];
    to.resize(samples.size());
    for (size_t at = 0; at < samples.size(); ++at) {
      const int channel = stack.channel_at(at);
      float light = light_of_frame.empty() ? light_.light(samples[at], channel) : light_of_frame[at];
      if (drifted) {
        const float below = light_.light(stack.rows[dark->second][at], channel);
        light = below + (light - below) / brightness[channel];
      }
      if (exposed) light /= brightness[channel];
      const bool saturated =
          light_of_frame.empty() ? light_.saturated(samples[at]) : !(light_of_frame[at] < kGraysAbove);
      to[at] = saturated ? std::uint16_t{65535} : code_of(light);
    }
  }
  for (size_t i = 0; i < stack.rows.size(); ++i) stack.rows[i] = owned->frames[i];
  stack.owner = owned;
  return stack;
}

v1::CaptureManifest LinearStack::manifest_of_light(v1::CaptureManifest manifest) const {
  if (!manifest.has_camera_calibration()) return manifest;
  v1::Camera& camera = *manifest.mutable_camera();
  camera.set_read_sd(manifest.camera_calibration().read_sd());
  camera.set_gain(manifest.camera_calibration().shot_gain());
  return manifest;
}

void LinearStack::describe(v1::MatteMetadata& metadata) const {
  metadata.set_linearised(!light_.is_identity());
  mix_.describe(metadata);
  for (const std::string& warning : warnings_) metadata.add_warnings(warning);
}

}  // namespace glasswing
