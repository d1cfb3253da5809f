#include "core/radiometry/noise_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace glasswing {
namespace {

constexpr double kFull = 65535.0;
constexpr int kBins = 64;          // equal in the square root of the value, in which shot noise is constant
constexpr size_t kMinPixels = 50;  // of a bin
constexpr double kClippedShare = 1e-3;  // of a bin's pixels; more would bias its variance low
constexpr double kOutlierSigmas = 4.5;
constexpr double kMinRange = 2.0;  // of brightest to darkest bin
constexpr size_t kPileUp = 100;    // samples at the highest code
// Of a bin's variance: floor of the expected variance while the line has not converged.
constexpr double kMinExpected = 0.1;

struct PixelNoise {
  double value;  // mean, above the black level
  double variance;
  int freedom;
  bool clipped;
};

struct Bin {
  double value = 0.0, variance = 0.0;
  double freedom = 0.0;  // sum over its pixels
};

absl::Status check_sizes(std::span<const Image16> frames) {
  for (const Image16& frame : frames) {
    if (frame.empty()) return absl::InvalidArgumentError("a frame is empty");
    if (frame.width_px != frames[0].width_px || frame.height_px != frames[0].height_px) {
      return absl::InvalidArgumentError(
          fmt::format("frames of a scene differ in size: {} x {} px and {} x {} px", frames[0].width_px,
                      frames[0].height_px, frame.width_px, frame.height_px));
    }
  }
  return absl::OkStatus();
}

// The highest code in use, if more samples have it than the percent of codes below it together: there the
// sensor or its converter saturates.
std::optional<std::uint16_t> pile_up(std::span<const std::vector<Image16>> scenes) {
  std::vector<size_t> count(65536);
  for (const auto& frames : scenes) {
    for (const Image16& frame : frames) {
      for (const std::uint16_t code : frame.samples) ++count[code];
    }
  }
  size_t top = count.size() - 1;
  while (top > 0 && count[top] == 0) --top;
  size_t below = 0;
  for (size_t code = top - std::min<size_t>(top, 655); code < top; ++code) below += count[code];
  if (count[top] < kPileUp || count[top] <= below) return std::nullopt;
  return static_cast<std::uint16_t>(top);
}

// The brightness of each frame relative to the mean of all, by least squares.
std::vector<double> flicker_of(const std::vector<Image16>& frames, const std::vector<double>& mean,
                               double black, std::uint16_t saturation) {
  std::vector<double> factors;
  for (const Image16& frame : frames) {
    double along = 0.0, square = 0.0;
    for (size_t i = 0; i < mean.size(); ++i) {
      if (frame.samples[i] >= saturation || mean[i] >= 0.95 * saturation) continue;
      const double value = mean[i] - black;
      along += value * (frame.samples[i] - black);
      square += value * value;
    }
    factors.push_back(square > 0.0 && along > 0.0 ? along / square : 1.0);
  }
  return factors;
}

void add_scene(const std::vector<Image16>& frames, double black_level, std::uint16_t saturation,
               std::vector<PixelNoise>& pixels) {
  const double n = static_cast<double>(frames.size()), black = black_level * kFull;
  std::vector<double> mean(frames[0].samples.size());
  for (const Image16& frame : frames) {
    for (size_t i = 0; i < mean.size(); ++i) mean[i] += frame.samples[i] / n;
  }
  const std::vector<double> factors = flicker_of(frames, mean, black, saturation);
  for (size_t i = 0; i < mean.size(); ++i) {
    PixelNoise pixel{.value = (mean[i] - black) / kFull,
                     .variance = 0.0,
                     .freedom = static_cast<int>(frames.size()) - 1,
                     .clipped = false};
    for (size_t j = 0; j < frames.size(); ++j) {
      const std::uint16_t code = frames[j].samples[i];
      pixel.clipped = pixel.clipped || code == 0 || code >= saturation;
      const double off = (code - black - factors[j] * (mean[i] - black)) / kFull;
      pixel.variance += off * off / pixel.freedom;
    }
    pixels.push_back(pixel);
  }
}

// The ratio of a variance at kOutlierSigmas to its median, for a number of degrees of freedom (Wilson and
// Hilferty 1931).
double outlier_ratio(int freedom) {
  const double spread = 2.0 / (9.0 * freedom);
  return std::pow((1.0 - spread + kOutlierSigmas * std::sqrt(spread)) / (1.0 - spread), 3);
}

// The bins that are not affected by clipping; `used` counts their pixels.
std::vector<Bin> bins_of(std::vector<PixelNoise>& pixels, size_t& used) {
  std::array<std::vector<PixelNoise>, kBins> sorted;
  for (const PixelNoise& pixel : pixels) {
    const int bin = static_cast<int>(std::sqrt(std::max(pixel.value, 0.0)) * kBins);
    sorted[std::min(bin, kBins - 1)].push_back(pixel);
  }
  std::vector<Bin> bins;
  for (std::vector<PixelNoise>& members : sorted) {
    const auto clipped = std::ranges::count_if(members, &PixelNoise::clipped);
    if (members.size() < kMinPixels ||
        static_cast<double>(clipped) > kClippedShare * static_cast<double>(members.size())) {
      continue;
    }
    const auto middle = members.begin() + members.size() / 2;
    std::ranges::nth_element(members, middle, {}, &PixelNoise::variance);
    const double median = middle->variance;
    Bin bin;
    for (const PixelNoise& pixel : members) {
      if (median > 0.0 && pixel.variance > median * outlier_ratio(pixel.freedom)) continue;
      bin.value += pixel.value * pixel.freedom;
      bin.variance += pixel.variance * pixel.freedom;
      bin.freedom += pixel.freedom;
      ++used;
    }
    bin.value /= bin.freedom;
    bin.variance /= bin.freedom;
    bins.push_back(bin);
  }
  return bins;
}

// Fits variance against value, each bin weighted by the chi^2 variance of its variance under the previous
// pass's model.
NoiseModel fit_line(const std::vector<Bin>& bins) {
  double start = 0.0, slope = 0.0;
  NoiseModel model;
  for (int pass = 0; pass < 8; ++pass) {
    double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, misfit = 0.0;
    const auto weight_of = [&](const Bin& bin) {
      const double expected =
          pass == 0 ? bin.variance : std::max(start + slope * bin.value, kMinExpected * bin.variance);
      return bin.freedom / (2.0 * expected * expected);
    };
    for (const Bin& bin : bins) {
      const double w = weight_of(bin);
      n += w, x += w * bin.value, y += w * bin.variance;
      xx += w * bin.value * bin.value, xy += w * bin.value * bin.variance;
    }
    const double determinant = n * xx - x * x;
    std::vector<double> weights;
    for (const Bin& bin : bins) weights.push_back(weight_of(bin));
    slope = (n * xy - x * y) / determinant;
    start = (xx * y - x * xy) / determinant;
    if (start < 0.0) {  // no measurable read noise: fit the line through 0
      start = 0.0;
      slope = xy / xx;
    }
    for (size_t i = 0; i < bins.size(); ++i) {
      misfit += weights[i] * std::pow(bins[i].variance - start - slope * bins[i].value, 2);
    }
    model.misfit = misfit / static_cast<double>(bins.size() - 2);
    const double inflation = std::sqrt(std::max(model.misfit, 1.0));
    model.gain = slope;
    model.gain_error = inflation * std::sqrt(n / determinant);
    const double start_error = inflation * std::sqrt(xx / determinant);
    model.read_sd = std::sqrt(std::max(start, 0.0));
    // d sqrt(v) = dv / (2 sqrt(v)), at most the square root of the error of v.
    model.read_sd_error =
        std::min(start_error / (2.0 * std::max(model.read_sd, 1e-12)), std::sqrt(start_error));
  }
  return model;
}

}  // namespace

absl::StatusOr<NoiseModel> fit_noise(std::span<const std::vector<Image16>> scenes, double black_level) {
  if (!(black_level >= 0.0 && black_level <= 0.5)) {
    return absl::InvalidArgumentError(
        fmt::format("the black level is {}; it must be in [0, 0.5]", black_level));
  }
  if (scenes.empty())
    return absl::InvalidArgumentError("the noise needs repeated frames of a still scene; there are none");
  for (const auto& frames : scenes) {
    if (frames.size() < 2) {
      return absl::InvalidArgumentError(
          fmt::format("the noise needs two frames or more of a scene; one has {}", frames.size()));
    }
    if (const absl::Status status = check_sizes(frames); !status.ok()) return status;
  }
  const std::optional<std::uint16_t> full = pile_up(scenes);
  std::vector<PixelNoise> pixels;
  for (const auto& frames : scenes) add_scene(frames, black_level, full.value_or(65535), pixels);
  size_t used = 0;
  const std::vector<Bin> bins = bins_of(pixels, used);
  if (bins.size() < 3 || bins.back().value < kMinRange * std::max(bins.front().value, 1e-6)) {
    return absl::FailedPreconditionError(fmt::format(
        "only {} of {} brightness levels are seen unclipped; the noise model needs three or more, "
        "spanning at least a factor of two: show a gradient, or use several exposures",
        bins.size(), kBins));
  }
  if (std::ranges::all_of(bins, [](const Bin& bin) { return bin.variance <= 0.0; })) {
    return absl::FailedPreconditionError(
        "the repeated frames are identical: they are one frame, or the camera removes noise");
  }
  NoiseModel model = fit_line(bins);
  model.pixel_share = static_cast<double>(used) / static_cast<double>(pixels.size());
  if (full) model.saturation = *full / kFull;
  return model;
}

}  // namespace glasswing
