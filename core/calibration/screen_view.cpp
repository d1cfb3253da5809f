#include "core/calibration/screen_view.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <optional>
#include <set>

#include "core/base/status.h"
#include "core/image/image.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

constexpr size_t kMinScreenPixels = 300;
constexpr double kMinLight = 0.01;         // of white above black, of the camera's full scale
constexpr double kGoodLight = 0.7;         // of white, recommended
constexpr double kMaxCutOff = 0.01;        // of the pixels that see white
constexpr double kPixelsCutOff = 1e-4;     // of the pixels that see a solid
constexpr double kBrightestShare = 0.001;  // of the picture; a monitor fills more
constexpr double kMinError = 1e-7;         // of a mean; below any rounding

// One of the ramp's codes is always 0.5 or more, and one 0.5 or less. So relative to white, one channel
// exceeds code 0.5 at gamma 4, and one is below code 0.5 at gamma 1 with a crosstalk of 0.2. A lit patch has
// 1 in all channels, a dark one 0.
constexpr float kMinRamp = 0.06f, kMaxRamp = 0.8f;

std::vector<ShownFrame> taken(const std::vector<ShownFrame>& frames, double exposure_ms,
                              std::optional<int> code = std::nullopt) {
  std::vector<ShownFrame> some;
  std::copy_if(frames.begin(), frames.end(), std::back_inserter(some), [&](const ShownFrame& shown) {
    return shown.exposure_ms == exposure_ms &&
           (!code || shown.code == std::array<int, 3>{*code, *code, *code});
  });
  return some;
}

std::span<const std::uint16_t> samples_of(const MappedArchive& archive, const ShownFrame& shown) {
  return archive.rows(shown.frame, 0, archive.manifest().camera().height_px());
}

// White minus black, over the whole picture.
struct WhiteLight {
  RadianceImage light;
  std::vector<bool> cut_off;  // by pixel: in any of the frames
};
WhiteLight white_light(const MappedArchive& archive, const FrameLight& light,
                       const std::vector<ShownFrame>& whites, const std::vector<ShownFrame>& blacks) {
  const v1::Camera& camera = archive.manifest().camera();
  WhiteLight white{.light = RadianceImage(camera.width_px(), camera.height_px()), .cut_off = {}};
  std::vector<float>& sum = white.light.samples;
  white.cut_off.resize(sum.size() / 3);
  const auto add = [&](const std::vector<ShownFrame>& frames, float sign) {
    const float share = sign / static_cast<float>(frames.size());
    for (const ShownFrame& shown : frames) {
      const auto samples = samples_of(archive, shown);
      for (size_t i = 0; i < sum.size(); ++i) {
        sum[i] += share * light.light(samples[i], static_cast<int>(i % 3));
        if (light.saturated(samples[i])) white.cut_off[i / 3] = true;
      }
    }
  };
  add(whites, 1.0f);
  add(blacks, -1.0f);
  return white;
}

// The light below which all but the brightest thousandth of pixels stay, by channel.
ScreenView::Light brightest(const RadianceImage& image) {
  ScreenView::Light light{};
  std::vector<float> channel(image.samples.size() / 3);
  for (size_t c = 0; c < 3; ++c) {
    for (size_t i = 0; i < channel.size(); ++i) channel[i] = image.samples[3 * i + c];
    const auto at =
        static_cast<std::ptrdiff_t>((1.0 - kBrightestShare) * static_cast<double>(channel.size() - 1));
    std::nth_element(channel.begin(), channel.begin() + at, channel.end());
    light[c] = channel[at];
  }
  return light;
}

// Mean light of a pixel over these frames.
float mean_light(const MappedArchive& archive, const FrameLight& light, const std::vector<ShownFrame>& frames,
                 std::uint32_t pixel, size_t c) {
  float sum = 0.0f;
  for (const ShownFrame& shown : frames)
    sum += light.light(samples_of(archive, shown)[3 * size_t{pixel} + c], static_cast<int>(c));
  return sum / static_cast<float>(frames.size());
}

bool is_ramp(const ScreenView::Light& ramp, const ScreenView::Light& white) {
  float min = 1.0f, max = 0.0f;
  for (size_t c = 0; c < 3; ++c) {
    min = std::min(min, ramp[c] / white[c]);
    max = std::max(max, ramp[c] / white[c]);
  }
  return min < kMaxRamp && max > kMinRamp;
}

// True if a pixel and all its neighbours within the picture are marked.
bool all_around(const std::vector<bool>& marked, int x, int y, int width_px, int height_px) {
  for (int v = std::max(y - 1, 0); v <= std::min(y + 1, height_px - 1); ++v) {
    for (int u = std::max(x - 1, 0); u <= std::min(x + 1, width_px - 1); ++u) {
      if (!marked[static_cast<size_t>(v) * width_px + u]) return false;
    }
  }
  return true;
}

// `seen`: the pixels where white is bright enough and not clipped.
absl::StatusOr<ScreenView> view_of(const MappedArchive& archive, const FrameLight& light,
                                   const ShownFrames& shown, double exposure_ms, const RadianceImage& white,
                                   std::vector<bool> seen) {
  const std::vector<ShownFrame> ramps = taken(shown.ramps, exposure_ms);
  const std::vector<ShownFrame> blacks = taken(shown.solids, exposure_ms, 0);
  if (ramps.empty()) return absl::FailedPreconditionError("the ramp was not shown");
  const auto white_at = [&](std::uint32_t pixel) {
    const float* at = &white.samples[3 * size_t{pixel}];
    return ScreenView::Light{at[0], at[1], at[2]};
  };
  const auto ramp_at = [&](std::uint32_t pixel) {
    ScreenView::Light ramp{};
    for (size_t c = 0; c < 3; ++c)
      ramp[c] = mean_light(archive, light, ramps, pixel, c) - mean_light(archive, light, blacks, pixel, c);
    return ramp;
  };
  for (std::uint32_t pixel = 0; pixel < seen.size(); ++pixel) {
    if (seen[pixel]) seen[pixel] = is_ramp(ramp_at(pixel), white_at(pixel));
  }
  ScreenView view{
      .exposure_ms = exposure_ms, .width_px = white.width_px, .pixels = {}, .white = {}, .ramp = {}};
  for (std::uint32_t pixel = 0; pixel < seen.size(); ++pixel) {
    const int width_px = white.width_px;
    const int x = static_cast<int>(pixel) % width_px, y = static_cast<int>(pixel) / width_px;
    if (!all_around(seen, x, y, width_px, white.height_px)) continue;
    view.pixels.push_back(pixel);
    view.white.push_back(white_at(pixel));
    view.ramp.push_back(ramp_at(pixel));
  }
  if (view.pixels.size() < kMinScreenPixels) {
    return absl::FailedPreconditionError(
        fmt::format("only {} of the camera's pixels see its picture; it must be {} or more: bring it into "
                    "view, and closer",
                    view.pixels.size(), kMinScreenPixels));
  }
  return view;
}

}  // namespace

ShownFrames shown_frames(const v1::CaptureManifest& manifest, const v1::Monitor& monitor) {
  const double highest = std::exp2(bits_of(monitor)) - 1.0;
  ShownFrames shown;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    const v1::Stimulus& stimulus = frame.stimulus();
    if (stimulus.panel() != monitor.name() || !stimulus.codes() || frame.object()) continue;
    ShownFrame of{.frame = i,
                  .code = {},
                  .exposure_ms = frame.exposure_ms(),
                  .at = nanoseconds(frame.exposure_start_ns())};
    for (int c = 0; c < 3; ++c) {
      const double share = c < stimulus.colour_size() ? stimulus.colour(c) : 1.0;
      of.code[c] = static_cast<int>(std::lround(share * highest));
    }
    if (kind_of(stimulus) == StimulusKind::kSolid) shown.solids.push_back(of);
    if (kind_of(stimulus) == StimulusKind::kRamp) shown.ramps.push_back(of);
  }
  return shown;
}

absl::StatusOr<ScreenView> find_screen(const MappedArchive& archive, const FrameLight& light,
                                       const ShownFrames& shown, int bits) {
  std::set<double, std::greater<>> exposures_ms;
  for (const ShownFrame& solid : shown.solids) exposures_ms.insert(solid.exposure_ms);
  double too_long_ms = 0.0;
  for (const double exposure_ms : exposures_ms) {
    const auto whites = taken(shown.solids, exposure_ms, (1 << bits) - 1);
    const auto blacks = taken(shown.solids, exposure_ms, 0);
    if (whites.empty() || blacks.empty()) {
      return absl::FailedPreconditionError(
          fmt::format("black and white were not both shown with an exposure of {} ms", exposure_ms));
    }
    const WhiteLight white = white_light(archive, light, whites, blacks);
    const ScreenView::Light bright = brightest(white.light);
    if (const float dimmest = *std::min_element(bright.begin(), bright.end()); dimmest < kMinLight) {
      return absl::FailedPreconditionError(
          fmt::format("white is brighter than black by only {:.4f} of the camera's full scale at {} ms; it "
                      "must be {} or more, and {} is good: it is out of the camera's view, or the exposure "
                      "is much too short",
                      std::max(dimmest, 0.0f), exposure_ms, kMinLight, kGoodLight));
    }
    std::vector<bool> seen(white.cut_off.size());
    std::vector<std::uint32_t> bright_pixels;
    size_t cut_off = 0;
    for (std::uint32_t pixel = 0; pixel < seen.size(); ++pixel) {
      const float* at = &white.light.samples[3 * size_t{pixel}];
      if (!(at[0] > 0.5f * bright[0] && at[1] > 0.5f * bright[1] && at[2] > 0.5f * bright[2])) continue;
      bright_pixels.push_back(pixel);
      seen[pixel] = !white.cut_off[pixel];
      if (white.cut_off[pixel]) ++cut_off;
    }
    const bool too_bright = std::any_of(whites.begin(), whites.end(), [&](const ShownFrame& of) {
      const SeenSolid mean = see(archive, light, bright_pixels, of);
      return *std::max_element(mean.solid.light.begin(), mean.solid.light.end()) > kMaxLight;
    });
    if (!too_bright && static_cast<double>(cut_off) < kMaxCutOff * static_cast<double>(bright_pixels.size()))
      return view_of(archive, light, shown, exposure_ms, white.light, std::move(seen));
    too_long_ms = exposure_ms;
  }
  if (exposures_ms.empty()) return absl::FailedPreconditionError("no solids were shown");
  return absl::FailedPreconditionError(
      fmt::format("white is clipped at the camera's full scale, even at {} ms; it must read {} at most, and "
                  "{} is good: try {:.2g} ms",
                  too_long_ms, kMaxLight, kGoodLight, 0.5 * too_long_ms));
}

SeenSolid see(const MappedArchive& archive, const FrameLight& light, const std::vector<std::uint32_t>& pixels,
              const ShownFrame& shown) {
  const auto samples = samples_of(archive, shown);
  const auto count = static_cast<double>(pixels.size());
  SeenSolid seen{.solid = {.code = shown.code, .at = shown.at}, .exposure_ms = shown.exposure_ms};
  size_t cut_off = 0;
  for (size_t c = 0; c < 3; ++c) {
    double sum = 0.0, square = 0.0, pairs = 0.0, last = 0.0;
    for (size_t i = 0; i < pixels.size(); ++i) {
      const std::uint16_t sample = samples[3 * size_t{pixels[i]} + c];
      const double here = light.light(sample, static_cast<int>(c));
      sum += here;
      if (light.saturated(sample)) ++cut_off;
      if (i > 0 && pixels[i] == pixels[i - 1] + 1) {
        square += (here - last) * (here - last);
        pairs += 1.0;
      }
      last = here;
    }
    seen.solid.light[c] = sum / count;
    seen.solid.error[c] = std::max(std::sqrt(square / (2.0 * std::max(pairs, 1.0)) / count), kMinError);
  }
  seen.cut_off = static_cast<double>(cut_off) > kPixelsCutOff * count ||
                 *std::max_element(seen.solid.light.begin(), seen.solid.light.end()) > kMaxLight;
  return seen;
}

}  // namespace glasswing
