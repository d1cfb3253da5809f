#include "solver/gaussian/gaussian_method.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <set>

#include "core/base/status.h"
#include "core/base/time.h"
#include "solver/gaussian/mode_search.h"
#include "solver/gaussian/sweep_peaks.h"

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

// One monitor's sweeps, as the joint fit wants them.
struct TextureSweeps {
  int texture = 0;
  MonitorExtent extent;
  SampleLayout samples;
  std::vector<const SweepLayout*> sweeps;  // in the order of samples.sweeps
};

std::vector<TextureSweeps> sweeps_by_texture(const FrameStack& stack, const StackLayout& layout) {
  std::map<int, TextureSweeps> by_texture;
  for (const SweepLayout& sweep : layout.sweeps) {
    TextureSweeps& sweeps = by_texture[sweep.texture];
    const v1::Monitor& monitor = stack.manifest.monitors(sweep.texture);
    sweeps.texture = sweep.texture;
    sweeps.extent = {.width_px = static_cast<double>(monitor.width_px()),
                     .height_px = static_cast<double>(monitor.height_px())};
    sweeps.samples.add({.cos_phi = sweep.cos_phi, .sin_phi = sweep.sin_phi, .sigma_px = sweep.sigma_px},
                       sweep.r_px);
    sweeps.sweeps.push_back(&sweep);
  }
  std::vector<TextureSweeps> list;
  for (auto& [texture, sweeps] : by_texture) list.push_back(std::move(sweeps));
  return list;
}

// One channel of one pixel, as recorded.
struct Recorded {
  std::vector<std::vector<float>> by_sweep;  // radiance, in the order of the layout's sweeps
  float black = 0.0f;                        // with the object
  double noise_sd = 0.0;                     // of a dark sample
};

float median_of(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Recorded record(const FrameStack& stack, const StackLayout& layout, int x, int y, int channel) {
  Recorded recorded{.by_sweep = {}, .black = stack.at(layout.black, x, y, channel)};
  double noise_sum = 0.0;
  for (const SweepLayout& sweep : layout.sweeps) {
    std::vector<float>& samples = recorded.by_sweep.emplace_back();
    std::vector<double> exact;
    for (const int frame : sweep.frames) {
      samples.push_back(stack.at(frame, x, y, channel));
      exact.push_back(static_cast<double>(samples.back()));
    }
    noise_sum += noise_of(exact);
  }
  recorded.noise_sd = noise_sum / static_cast<double>(layout.sweeps.size());
  const double read_sd = stack.manifest.camera().read_sd(), gain = stack.manifest.camera().gain();
  if (read_sd > 0.0 || gain > 0.0) {
    recorded.noise_sd =
        std::sqrt(read_sd * read_sd + gain * std::max(static_cast<double>(recorded.black), 0.0));
  }
  return recorded;
}

// The light without the stripes: the black frame, and with it all samples that no stripe reached.
double baseline_of(const Recorded& recorded) {
  const auto within = [&](float middle, double reach) {
    std::vector<float> dark{recorded.black};
    for (const std::vector<float>& sweep : recorded.by_sweep) {
      for (const float sample : sweep) {
        if (std::abs(static_cast<double>(sample - middle)) <= reach) dark.push_back(sample);
      }
    }
    return median_of(dark);
  };
  const float first = within(recorded.black, 3.0 * recorded.noise_sd);
  return static_cast<double>(within(first, 2.0 * recorded.noise_sd));
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
      GW_ASSIGN_OR_RETURN(const double modes, number_of(key, value, 1, kMaxModes));
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
  static thread_local JointWorkspace workspace;
  std::array<Recorded, kChannels> recorded;
  double noise_sum = 0.0;
  for (int c = 0; c < kChannels; ++c) {
    Recorded& channel = recorded[static_cast<size_t>(c)];
    channel = record(stack, layout, x, y, c);
    noise_sum += channel.noise_sd;
    matte.foreground(x, y)[static_cast<size_t>(c)] = static_cast<float>(baseline_of(channel));
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
  const std::vector<TextureSweeps> textures = sweeps_by_texture(stack, layout);
  for (int c = 0; c < kChannels; ++c) {
    const Recorded& channel = recorded[static_cast<size_t>(c)];
    const float baseline = matte.foreground(x, y)[static_cast<size_t>(c)];
    size_t slot = 0;
    for (const TextureSweeps& texture : textures) {
      PixelSamples samples{.layout = &texture.samples, .y = {}, .weight = {}};
      samples.y.resize(static_cast<size_t>(texture.samples.padded_count()));
      samples.weight.resize(samples.y.size());
      std::vector<Crests> crests;
      for (size_t s = 0; s < texture.sweeps.size(); ++s) {
        const SweepLayout& sweep = *texture.sweeps[s];
        const auto first = static_cast<size_t>(texture.samples.sweeps[s].first);
        const std::vector<float>& raw = channel.by_sweep[static_cast<size_t>(&sweep - layout.sweeps.data())];
        std::vector<double> exact;
        for (size_t i = 0; i < raw.size(); ++i) {
          const double peak = sweep.peak[i][static_cast<size_t>(c)];
          if (raw[i] >= kSaturated) matte.flags(x, y) |= kFlagSaturated;
          const bool usable = peak > 0.0 && raw[i] < kSaturated;
          samples.y[first + i] = peak > 0.0 ? (raw[i] - baseline) / static_cast<float>(peak) : 0.0f;
          samples.weight[first + i] = usable ? 1.0f : 0.0f;
          exact.push_back(static_cast<double>(samples.y[first + i]));
        }
        Crests& found = crests.emplace_back();
        for (const Peak& peak :
             find_peaks(sweep.r_px, exact, std::max(4.0 * channel.noise_sd, 0.0015), kMostCrests)) {
          found.crests[static_cast<size_t>(found.count++)] = {
              .amplitude = peak.amplitude, .centre_px = peak.centre_px, .sigma_px = peak.sigma_px};
        }
      }
      const JointFit fit =
          find_footprints(samples, crests, texture.extent, channel.noise_sd, modes_per_texture, workspace);
      double strongest = 0.0;
      for (const Footprint& footprint : fit.modes) {
        matte.modes(x, y, c)[slot++] = mode_of(footprint, texture.texture);
        strongest = std::max(strongest, footprint.weight);
      }
      std::uint8_t flags = matte.flags(x, y);
      if (!fit.modes.empty() && !fit.converged) flags |= kFlagNotConverged;
      const double rms_near = std::sqrt(fit.near_chi2 / std::max(fit.near_count, 1));
      if (rms_near > std::max(4.0 * channel.noise_sd, 0.1 * strongest)) flags |= kFlagPoorFit;
      matte.flags(x, y) = flags;
    }
  }
}

}  // namespace glasswing
