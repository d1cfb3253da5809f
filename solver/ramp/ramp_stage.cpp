#include "solver/ramp/ramp_stage.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/status.h"
#include "core/radiometry/primary_mix.h"

namespace glasswing {
namespace {

constexpr double kMaxSaturated = 0.01;  // of the ramp's pixels
constexpr size_t kMaxSamples = 40'000;  // for fitting the manifold

absl::Status check_sizes(const v1::CaptureManifest& manifest, std::span<const FrameView> views) {
  const v1::Camera& camera = manifest.camera();
  for (const FrameView& view : views) {
    if (view.width_px != camera.width_px() || view.height_px != camera.height_px()) {
      return absl::InvalidArgumentError(
          fmt::format("a frame of the empty stage is {}x{}; the session's frames are {}x{}", view.width_px,
                      view.height_px, camera.width_px(), camera.height_px()));
    }
  }
  return absl::OkStatus();
}

struct Mean {
  std::vector<float> light;
  double variance = 0.0;   // mean variance of a sample between frames; 0 for one frame
  double saturated = 0.0;  // the share of pixels saturated in most frames
};

Mean mean_of(std::span<const FrameView> views) {
  Mean mean;
  const size_t count = views.front().samples.size();
  std::vector<double> squares(views.size() > 1 ? count : 0);
  mean.light.resize(count);
  std::vector<std::uint16_t> saturated(count);
  for (size_t frame = 0; frame < views.size(); ++frame) {
    const FrameView& view = views[frame];
    const float part = 1.0f / static_cast<float>(frame + 1);
    for (size_t i = 0; i < count; ++i) {  // Welford
      const float light = (static_cast<float>(view.samples[i]) - view.zero) * view.unit;
      const float before = light - mean.light[i];
      mean.light[i] += before * part;
      if (!squares.empty()) squares[i] += static_cast<double>(before * (light - mean.light[i]));
      saturated[i] = static_cast<std::uint16_t>(saturated[i] + (view.samples[i] >= kSaturatedCode ? 1 : 0));
    }
  }
  size_t clipped = 0;
  for (size_t i = 0; i < count; i += 3) {
    const auto most = std::max({saturated[i], saturated[i + 1], saturated[i + 2]});
    if (2u * most > views.size()) ++clipped;
  }
  mean.saturated = 3.0 * static_cast<double>(clipped) / static_cast<double>(count);
  for (const double square : squares) mean.variance += square;
  if (!squares.empty()) mean.variance /= static_cast<double>(count * (views.size() - 1));
  return mean;
}

// The light in the monitor's primaries, for the map.
RadianceImage primaries_of(const std::vector<float>& light, int width_px, int height_px,
                           const PrimaryMix& mix) {
  RadianceImage image(width_px, height_px);
  image.samples = light;
  if (mix.is_unit()) return image;
  for (size_t i = 0; i < image.samples.size(); i += 3) {
    const PrimaryMix::Light primaries = mix.primaries({light[i], light[i + 1], light[i + 2]});
    std::copy(primaries.begin(), primaries.end(), image.samples.begin() + i);
  }
  return image;
}

// The response of each channel to each of the ramp's primaries.
std::array<double, 9> channel_mix(const PrimaryMix& mix, int texture, const std::array<double, 3>& plane) {
  std::array<double, 9> out{};
  for (size_t primary = 0; primary < 3; ++primary) {
    PrimaryMix::Light light{};
    light[primary] = 1.0f;
    const PrimaryMix::Light seen = mix.is_unit() ? light : mix.seen(texture, light);
    const double full = (primary == 2 ? 2.0 : 1.0) / plane[primary];
    for (size_t channel = 0; channel < 3; ++channel) out[3 * channel + primary] = seen[channel] * full;
  }
  return out;
}

// The view past the object, by pixel, and some of its colours for the manifold.
struct PastObject {
  std::vector<Behind> behind;
  std::vector<float> x_px, y_px;
  std::vector<ManifoldSample> samples;
};

PastObject view_past_object(const MonitorMap& map, const v1::Monitor& monitor, std::span<const float> light,
                            int width, int height) {
  const size_t count = light.size() / 3;
  PastObject view{.behind = std::vector<Behind>(count),
                  .x_px = std::vector<float>(count),
                  .y_px = std::vector<float>(count),
                  .samples = {}};
  const auto step = static_cast<size_t>(
      std::ceil(std::sqrt(static_cast<double>(count) / static_cast<double>(kMaxSamples))));
  size_t at = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x, ++at) {
      const auto [mx, my] = map.place(x + 0.5, y + 0.5);
      view.x_px[at] = static_cast<float>(mx);
      view.y_px[at] = static_cast<float>(my);
      // At most a tenth of the pixel may lie off the monitor.
      const std::array<double, 4> slope = map.slope(x + 0.5, y + 0.5);
      const double half_x = 0.4 * (std::abs(slope[0]) + std::abs(slope[1])),
                   half_y = 0.4 * (std::abs(slope[2]) + std::abs(slope[3]));
      const bool across = mx > -half_x && mx < monitor.width_px() + half_x;
      if (across && my > -half_y && my < monitor.height_px() + half_y) {
        view.behind[at] = Behind::kRamp;
      } else if (across && monitor.patch_rows() > 0 && my > 0.0 &&
                 my < monitor.height_px() + monitor.patch_rows() + half_y) {
        view.behind[at] = Behind::kPatch;
      } else {
        view.behind[at] = Behind::kBeyond;
      }
      if (static_cast<size_t>(x) % step != 0 || static_cast<size_t>(y) % step != 0) continue;
      if (mx < half_x || mx > monitor.width_px() - half_x || my < half_y || my > monitor.height_px() - half_y)
        continue;
      view.samples.push_back({mx, my, {light[3 * at], light[3 * at + 1], light[3 * at + 2]}});
    }
  }
  return view;
}

}  // namespace

double roughness(const FrameView& view) {
  constexpr double kNormal = 0.6745 * 2.4494897;  // the median of |a - 2b + c|, standard deviations
  const size_t row_samples = 3 * static_cast<size_t>(view.width_px);
  const int step = std::max(1, view.height_px * view.width_px / 60'000);
  // A histogram of |second differences| in codes gives the median in one pass.
  std::vector<std::uint32_t> counts(4 * 65536);
  size_t count = 0;
  for (int y = step / 2; y < view.height_px; y += step) {
    const std::uint16_t* const row = view.samples.data() + static_cast<size_t>(y) * row_samples;
    for (size_t i = 3; i + 3 < row_samples; ++i, ++count)
      ++counts[std::abs(row[i - 3] - 2 * row[i] + row[i + 3])];
  }
  size_t below = 0, code = 0;
  while (code + 1 < counts.size() && 2 * (below + counts[code]) < count) below += counts[code++];
  return static_cast<double>(code) * static_cast<double>(view.unit) / kNormal;
}

absl::StatusOr<RampStage> RampStage::measure(const v1::CaptureManifest& manifest, const VideoLayout& layout,
                                             std::span<const FrameView> empties,
                                             std::span<const FrameView> black) {
  if (empties.empty()) return absl::FailedPreconditionError("no frame shows the ramp without the object");
  GW_RETURN_IF_ERROR(check_sizes(manifest, empties));
  GW_RETURN_IF_ERROR(check_sizes(manifest, black));
  GW_ASSIGN_OR_RETURN(const PrimaryMix mix, PrimaryMix::create(manifest));
  const v1::Monitor& monitor = manifest.monitors(layout.texture);
  const int width = manifest.camera().width_px(), height = manifest.camera().height_px();
  Mean mean = mean_of(empties);
  if (mean.saturated > kMaxSaturated) {
    return absl::FailedPreconditionError(
        fmt::format("the ramp is saturated in {:.1f} % of the empty stage; it must be in no more than {:.0f} "
                    "%: expose less",
                    100.0 * mean.saturated, 100.0 * kMaxSaturated));
  }
  std::vector<float> dark;
  if (!black.empty()) {
    dark = mean_of(black).light;
    for (size_t i = 0; i < dark.size(); ++i) mean.light[i] -= dark[i];
  }
  GW_ASSIGN_OR_RETURN(const MonitorMap map, MonitorMap::fit(primaries_of(mean.light, width, height, mix),
                                                            monitor.width_px(), monitor.height_px()));

  PastObject view = view_past_object(map, monitor, mean.light, width, height);
  GW_ASSIGN_OR_RETURN(ColourManifold manifold,
                      ColourManifold::fit(view.samples, channel_mix(mix, layout.texture, map.plane()),
                                          monitor.width_px(), monitor.height_px()));
  RampStage stage{.monitor = monitor,
                  .texture = layout.texture,
                  .width_px = width,
                  .height_px = height,
                  .average = std::move(mean.light),
                  .black = std::move(dark),
                  .map = map,
                  .manifold = std::move(manifold),
                  .behind = std::move(view.behind),
                  .x_px = std::move(view.x_px),
                  .y_px = std::move(view.y_px),
                  .noise = sample_noise(manifest.camera(), 0.0),
                  .noise_known = manifest.camera().read_sd() > 0.0,
                  .empty_share = 1.0 / static_cast<double>(empties.size()),
                  .warnings = {}};
  if (!stage.noise_known) {
    const double measured = empties.size() > 1 ? std::sqrt(mean.variance) : roughness(empties.front());
    stage.noise.read_sd = std::max(stage.noise.read_sd, measured);
    stage.noise_known = empties.size() > 1;
  }
  const double off_px = std::max(1.0, 0.01 * std::max(monitor.width_px(), monitor.height_px()));
  if (stage.map.residual_px() > off_px + 10.0 * stage.noise.read_sd * monitor.width_px()) {
    stage.warnings.push_back(fmt::format(
        "the ramp's colours are typically {:.1f} px from where a flat monitor and a linear camera would show "
        "them: mattes may be distorted; `glasswing calibrate all` measures the devices",
        stage.map.residual_px()));
  }
  return stage;
}

}  // namespace glasswing
