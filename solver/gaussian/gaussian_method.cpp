#include "solver/gaussian/gaussian_method.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>

#include "core/base/status.h"
#include "core/base/time.h"
#include "solver/gaussian/footprint_fit.h"

namespace glasswing {
namespace {

constexpr float kSaturated = 0.9995f;

absl::StatusOr<double> number_of(const std::string& key, const std::string& value, double low, double high) {
  char* end = nullptr;
  const double number = std::strtod(value.c_str(), &end);
  if (value.empty() || *end != '\0' || !(number >= low && number <= high)) {
    return absl::InvalidArgumentError(
        fmt::format("{} is \"{}\"; it must be {} to {}", key, value, low, high));
  }
  return number;
}

// One channel's samples of every sweep over one texture.
std::vector<SweepSamples> samples_of(const FrameStack& stack, const StackLayout& layout, int texture, int x,
                                     int y, int channel) {
  const auto c = static_cast<size_t>(channel);
  const double black = stack.at(layout.black, x, y, channel);
  std::vector<SweepSamples> sweeps;
  for (const SweepLayout& sweep : layout.sweeps) {
    if (sweep.texture != texture) continue;
    SweepSamples samples{.cos_phi = sweep.cos_phi,
                         .sin_phi = sweep.sin_phi,
                         .sigma_px = sweep.sigma_px,
                         .r_px = sweep.r_px,
                         .y = {}};
    for (size_t i = 0; i < sweep.frames.size(); ++i) {
      const double peak = sweep.peak[i][c];
      samples.y.push_back(peak > 0.0 ? (stack.at(sweep.frames[i], x, y, channel) - black) / peak : 0.0);
    }
    sweeps.push_back(std::move(samples));
  }
  return sweeps;
}

double mean_noise_of(const std::vector<SweepSamples>& sweeps) {
  double sum = 0.0;
  for (const SweepSamples& sweep : sweeps) sum += noise_of(sweep.y);
  return sweeps.empty() ? 0.0 : sum / static_cast<double>(sweeps.size());
}

// Outside the silhouette the camera sees the first monitor straight through.
Mode straight_through(const FrameStack& stack, const StackLayout& layout, int x, int y, int channel) {
  const v1::Monitor& monitor = stack.manifest.monitors(0);
  const double scale_x = static_cast<double>(monitor.width_px()) / stack.manifest.camera().width_px();
  const double scale_y = static_cast<double>(monitor.height_px()) / stack.manifest.camera().height_px();
  double weight = 1.0;
  if (layout.empty_white >= 0) {
    weight = stack.at(layout.empty_white, x, y, channel);
    if (layout.empty_black >= 0) weight -= stack.at(layout.empty_black, x, y, channel);
  }
  // A camera pixel's box on the monitor, less the monitor's own flat pixel.
  const auto variance = [](double scale) { return std::max((scale * scale - 1.0) / 12.0, 0.0); };
  return {.weight = static_cast<float>(std::max(weight, 0.0)),
          .x_px = static_cast<float>((x + 0.5) * scale_x),
          .y_px = static_cast<float>((stack.first_row + y + 0.5) * scale_y),
          .xx_px2 = static_cast<float>(variance(scale_x)),
          .xy_px2 = 0.0f,
          .yy_px2 = static_cast<float>(variance(scale_y)),
          .texture = 0};
}

Mode mode_of(const Footprint& footprint, int texture) {
  return {.weight = static_cast<float>(footprint.weight),
          .x_px = static_cast<float>(footprint.x_px),
          .y_px = static_cast<float>(footprint.y_px),
          .xx_px2 = static_cast<float>(footprint.xx_px2),
          .xy_px2 = static_cast<float>(footprint.xy_px2),
          .yy_px2 = static_cast<float>(footprint.yy_px2),
          .texture = texture};
}

}  // namespace

absl::StatusOr<std::unique_ptr<Method>> GaussianMethod::create(const MethodOptions& options) {
  auto method = std::make_unique<GaussianMethod>();
  method->options_ = options;
  for (const auto& [key, value] : options) {
    if (key == "modes") {
      GW_ASSIGN_OR_RETURN(const double modes, number_of(key, value, 1, 3));
      method->modes_ = static_cast<int>(modes);
    } else if (key == "silhouette_tolerance") {
      GW_ASSIGN_OR_RETURN(method->silhouette_tolerance_, number_of(key, value, 0.0, 1.0));
    } else {
      return absl::InvalidArgumentError(
          fmt::format("option \"{}\" is not known to gaussian; it has: modes, silhouette_tolerance", key));
    }
  }
  return method;
}

absl::StatusOr<std::vector<int>> GaussianMethod::frames_needed(const v1::CaptureManifest& manifest) const {
  GW_ASSIGN_OR_RETURN(const StackLayout layout, lay_out(manifest));
  std::set<int> needed{layout.black};
  for (const SweepLayout& sweep : layout.sweeps) needed.insert(sweep.frames.begin(), sweep.frames.end());
  for (const StackLayout::Pair& pair : layout.pairs) {
    needed.insert(pair.object);
    needed.insert(pair.empty);
  }
  for (const int frame : {layout.empty_black, layout.empty_white}) {
    if (frame >= 0) needed.insert(frame);
  }
  return std::vector<int>(needed.begin(), needed.end());
}

absl::StatusOr<Matte> GaussianMethod::solve(const FrameStack& stack) const {
  GW_ASSIGN_OR_RETURN(const StackLayout layout, lay_out(stack.manifest));
  std::set<int> textures;
  for (const SweepLayout& sweep : layout.sweeps) textures.insert(sweep.texture);
  const int texture_count = static_cast<int>(textures.size());
  if (texture_count > kMaxModes) {
    return absl::FailedPreconditionError(
        fmt::format("{} monitors were swept; at most {} can be solved", texture_count, kMaxModes));
  }
  const int modes_per_texture = std::max(1, std::min(modes_, kMaxModes / texture_count));
  Matte matte(0, stack.first_row, stack.manifest.camera().width_px(), stack.row_count,
              std::min(kMaxModes, modes_per_texture * texture_count));
  v1::MatteMetadata& metadata = matte.metadata;
  metadata.set_format_version(1);
  metadata.set_session(stack.manifest.session());
  metadata.set_method("gaussian");
  for (const auto& [key, value] : options_) (*metadata.mutable_options())[key] = value;
  *metadata.mutable_monitors() = stack.manifest.monitors();
  metadata.set_width_px(stack.manifest.camera().width_px());
  metadata.set_height_px(stack.manifest.camera().height_px());
  metadata.set_generator("glasswing");
  for (int y = 0; y < stack.row_count; ++y) {
    for (int x = 0; x < matte.width_px(); ++x) solve_pixel(stack, layout, x, y, modes_per_texture, matte);
  }
  return matte;
}

void GaussianMethod::solve_pixel(const FrameStack& stack, const StackLayout& layout, int x, int y,
                                 int modes_per_texture, Matte& matte) const {
  std::set<int> textures;
  for (const SweepLayout& sweep : layout.sweeps) textures.insert(sweep.texture);
  double noise_sum = 0.0;
  std::vector<std::vector<SweepSamples>> first_texture;  // by channel
  for (int c = 0; c < kChannels; ++c) {
    matte.foreground(x, y)[static_cast<size_t>(c)] = stack.at(layout.black, x, y, c);
    first_texture.push_back(samples_of(stack, layout, *textures.begin(), x, y, c));
    noise_sum += mean_noise_of(first_texture.back());
  }
  // The same light with and without the object, but for noise: not the object's (section 3.1).
  double squares = 0.0;
  for (const StackLayout::Pair& pair : layout.pairs) {
    for (int c = 0; c < kChannels; ++c) {
      const double difference = stack.at(pair.object, x, y, c) - stack.at(pair.empty, x, y, c);
      squares += difference * difference;
    }
  }
  const double rms =
      layout.pairs.empty() ? 1.0 : std::sqrt(squares / (3.0 * static_cast<double>(layout.pairs.size())));
  const double noise_sd = noise_sum / kChannels;
  if (rms <= std::max(silhouette_tolerance_, 1.5 * std::sqrt(2.0) * noise_sd)) {
    for (int c = 0; c < kChannels; ++c) matte.modes(x, y, c)[0] = straight_through(stack, layout, x, y, c);
    return;
  }
  matte.coverage(x, y) = 1.0f;
  for (int c = 0; c < kChannels; ++c) {
    size_t slot = 0;
    for (const int texture : textures) {
      const std::vector<SweepSamples> sweeps = texture == *textures.begin()
                                                   ? first_texture[static_cast<size_t>(c)]
                                                   : samples_of(stack, layout, texture, x, y, c);
      const v1::Monitor& monitor = stack.manifest.monitors(texture);
      const MonitorExtent extent{.width_px = static_cast<double>(monitor.width_px()),
                                 .height_px = static_cast<double>(monitor.height_px())};
      const double noise = mean_noise_of(sweeps);
      const FootprintFit fit = fit_footprints(sweeps, extent, noise, modes_per_texture);
      double strongest = 0.0;
      for (const Footprint& footprint : fit.modes) {
        if (footprint.weight <= 0.0) continue;
        matte.modes(x, y, c)[slot++] = mode_of(footprint, texture);
        strongest = std::max(strongest, footprint.weight);
      }
      std::uint8_t flags = matte.flags(x, y);
      if (!fit.converged) flags |= kFlagNotConverged;
      if (fit.rms > std::max(4.0 * noise, 0.1 * strongest)) flags |= kFlagPoorFit;
      matte.flags(x, y) = flags;
    }
    for (const SweepLayout& sweep : layout.sweeps) {
      for (const int frame : sweep.frames) {
        if (stack.at(frame, x, y, c) >= kSaturated) matte.flags(x, y) |= kFlagSaturated;
      }
    }
  }
}

}  // namespace glasswing
