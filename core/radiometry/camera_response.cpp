#include "core/radiometry/camera_response.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

#include "core/radiometry/response_fit.h"

namespace glasswing {
namespace {

constexpr int kMinSide_px = 16;
constexpr double kMaxPixels = 20000.0;   // more cost time without improving the fit
constexpr double kMinAboveBlack = 0.01;  // code of a sample that counts as shared
constexpr size_t kMinShared = 50;        // pixels, between neighbouring exposures
constexpr double kBend = 0.002;          // of full scale: curvature accepted as linear
constexpr double kStandardErrors = 3.0;
constexpr std::array<const char*, 3> kChannelNames = {"red", "green", "blue"};

absl::Status check(std::span<const Exposure> exposures, const ResponseOptions& options) {
  const auto [lowest, black] = std::ranges::minmax(options.black_level.value_or(std::array{0.0, 0.0, 0.0}));
  if (!(options.darkest >= 0.0 && options.darkest < options.saturation && options.saturation <= 1.0) ||
      !(lowest >= 0.0 && black < options.saturation)) {
    return absl::InvalidArgumentError(fmt::format(
        "black level {}, darkest code {} and saturation {} must lie in [0, 1], saturation highest", black,
        options.darkest, options.saturation));
  }
  if (!(options.exposure_sd > 0.0) || !(options.alignment_sd_px >= 0.0)) {
    return absl::InvalidArgumentError(
        fmt::format("exposure_sd is {} and alignment_sd_px {}; they must be > 0 and >= 0",
                    options.exposure_sd, options.alignment_sd_px));
  }
  if (exposures.size() < 2) {
    return absl::InvalidArgumentError(
        fmt::format("a response needs two exposures or more of one scene; there are {}", exposures.size()));
  }
  const Image16& first = exposures.front().codes;
  if (first.width_px < kMinSide_px || first.height_px < kMinSide_px) {
    return absl::InvalidArgumentError(
        fmt::format("frames of {} x {} px are too small; the minimum is {} x {}", first.width_px,
                    first.height_px, kMinSide_px, kMinSide_px));
  }
  double shortest = exposures.front().exposure_s, longest = shortest;
  for (const Exposure& exposure : exposures) {
    if (!(exposure.exposure_s > 0.0) || !std::isfinite(exposure.exposure_s)) {
      return absl::InvalidArgumentError(
          fmt::format("an exposure time is {} s; it must be above 0", exposure.exposure_s));
    }
    if (exposure.codes.width_px != first.width_px || exposure.codes.height_px != first.height_px) {
      return absl::InvalidArgumentError(fmt::format("the exposures differ in size: {} x {} px and {} x {} px",
                                                    first.width_px, first.height_px, exposure.codes.width_px,
                                                    exposure.codes.height_px));
    }
    shortest = std::min(shortest, exposure.exposure_s);
    longest = std::max(longest, exposure.exposure_s);
  }
  if (longest < 1.2 * shortest) {
    return absl::InvalidArgumentError(fmt::format(
        "the exposure times, {} to {} s, hardly differ; steps of two to four are best", shortest, longest));
  }
  return absl::OkStatus();
}

double code_at(const Image16& image, int x, int y, int channel) {
  return image.at(x, y, channel) / 65535.0;
}

// Central differences: the change of code per pixel of shift.
double gradient_at(const Image16& image, int x, int y, int channel) {
  return 0.5 * std::hypot(code_at(image, x + 1, y, channel) - code_at(image, x - 1, y, channel),
                          code_at(image, x, y + 1, channel) - code_at(image, x, y - 1, channel));
}

ChannelSamples gather(std::span<const Exposure> exposures, int channel, const ResponseOptions& options) {
  const Image16& first = exposures.front().codes;
  const double pixels = static_cast<double>(first.width_px) * first.height_px;
  const int step = std::max(1, static_cast<int>(std::lround(std::sqrt(pixels / kMaxPixels))));
  ChannelSamples gathered;
  for (int y = 1; y + 1 < first.height_px; y += step) {
    for (int x = 1; x + 1 < first.width_px; x += step) {
      for (size_t j = 0; j < exposures.size(); ++j) {
        const double code = code_at(exposures[j].codes, x, y, channel);
        if (code < options.darkest || code > options.saturation) continue;
        gathered.samples.push_back({static_cast<int>(j), static_cast<float>(code),
                                    static_cast<float>(gradient_at(exposures[j].codes, x, y, channel))});
      }
      const size_t begin = gathered.first.back();
      if (gathered.samples.size() < begin + 2) {
        gathered.samples.resize(begin);
      } else {
        gathered.first.push_back(gathered.samples.size());
      }
    }
  }
  return gathered;
}

absl::Status check_overlap(std::span<const Exposure> exposures, int channel, const ResponseOptions& options,
                           const ChannelSamples& gathered) {
  const char* name = kChannelNames[channel];
  const double black = options.black_level ? (*options.black_level)[channel] : 0.0;
  const bool seen = std::ranges::any_of(exposures, [&](const Exposure& exposure) {
    for (size_t i = channel; i < exposure.codes.samples.size(); i += 3) {
      const double code = exposure.codes.samples[i] / 65535.0;
      if (code >= options.darkest && code <= options.saturation) return true;
    }
    return false;
  });
  if (!seen) {
    return absl::FailedPreconditionError(fmt::format(
        "{} is clipped, dark or bright, in every pixel of every exposure; choose other times", name));
  }
  std::vector<size_t> order(exposures.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::ranges::sort(order, {}, [&](size_t j) { return exposures[j].exposure_s; });
  std::vector<size_t> rank(order.size());
  for (size_t r = 0; r < order.size(); ++r) rank[order[r]] = r;
  std::vector<size_t> shared(order.size());  // [r]: pixels shared with the next shorter exposure
  for (size_t i = 0; i + 1 < gathered.first.size(); ++i) {
    std::vector<bool> has(order.size());
    for (size_t s = gathered.first[i]; s < gathered.first[i + 1]; ++s) {
      if (gathered.samples[s].code < black + kMinAboveBlack) continue;
      has[rank[gathered.samples[s].frame]] = true;
    }
    for (size_t r = 1; r < order.size(); ++r) shared[r] += has[r] && has[r - 1] ? 1 : 0;
  }
  for (size_t r = 1; r < order.size(); ++r) {
    if (shared[r] >= kMinShared) continue;
    return absl::FailedPreconditionError(fmt::format(
        "the exposures of {} s and {} s share only {} pixels that are unclipped in {}; the minimum is {}: "
        "add one between, or leave one out",
        exposures[order[r - 1]].exposure_s, exposures[order[r]].exposure_s, shared[r], name, kMinShared));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<CameraResponse> CameraResponse::fit(std::span<const Exposure> exposures,
                                                   const ResponseOptions& options) {
  if (const absl::Status status = check(exposures, options); !status.ok()) return status;
  CameraResponse response;
  std::array<ChannelSamples, 3> channels;
  for (size_t c = 0; c < 3; ++c) {
    channels[c] = gather(exposures, static_cast<int>(c), options);
    const absl::Status status = check_overlap(exposures, static_cast<int>(c), options, channels[c]);
    if (!status.ok()) return status;
    const auto [low, high] = std::ranges::minmax(channels[c].samples, {}, &CodeSample::code);
    response.darkest_seen_[c] =
        std::max(static_cast<double>(low.code), options.black_level ? (*options.black_level)[c] : 0.0);
    response.brightest_seen_[c] = static_cast<double>(high.code);
  }
  std::vector<double> declared_s;
  for (const Exposure& exposure : exposures) declared_s.push_back(exposure.exposure_s);
  ResponseFit found = fit_response(channels, declared_s, options);
  response.exposures_ = found.exposures;
  response.errors_ = found.errors;
  response.exposures_s_ = std::move(found.exposures_s);
  response.straighten_if_linear(options);
  for (int c = 0; c < 3; ++c) response.black_level_[c] = response.code_of(0.0, c);
  return response;
}

void CameraResponse::straighten_if_linear(const ResponseOptions& options) {
  std::array<Curve, 3> lines;
  for (size_t c = 0; c < 3; ++c) {
    const int first = static_cast<int>(std::ceil(darkest_seen_[c] * (kKnots - 1)));
    const int last = static_cast<int>(std::floor(brightest_seen_[c] * (kKnots - 1)));
    double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;
    const auto variance = [&](size_t k) { return errors_[c][k] * errors_[c][k] + kBend * kBend; };
    for (int k = first; k <= last; ++k) {
      const size_t at = k;
      const double w = 1.0 / variance(at);
      n += w, x += w * k, y += w * exposures_[c][at], xx += w * k * k, xy += w * k * exposures_[c][at];
    }
    double slope = (n * xy - x * y) / (n * xx - x * x), start = (y - slope * x) / n;
    if (options.black_level) {
      slope = 1.0 / ((options.saturation - (*options.black_level)[c]) * (kKnots - 1));
      start = 1.0 - slope * options.saturation * (kKnots - 1);
    }
    if (!std::isfinite(slope)) return;
    for (int k = 0; k < kKnots; ++k) lines[c][k] = start + slope * k;
    for (int k = first; k <= last; ++k) {
      const size_t at = k;
      if (std::abs(exposures_[c][at] - lines[c][at]) > kBend + kStandardErrors * errors_[c][at]) return;
    }
  }
  exposures_ = lines;
  linear_ = true;
}

double CameraResponse::exposure_of(double code, int channel) const {
  assert(channel >= 0 && channel < 3);
  const Curve& curve = exposures_[channel];
  const double at = std::clamp(code, 0.0, 1.0) * (kKnots - 1);
  const size_t knot = std::min(static_cast<size_t>(at), static_cast<size_t>(kKnots - 2));
  return curve[knot] + (at - static_cast<double>(knot)) * (curve[knot + 1] - curve[knot]);
}

double CameraResponse::code_of(double exposure, int channel) const {
  assert(channel >= 0 && channel < 3);
  const Curve& curve = exposures_[channel];
  if (exposure <= curve.front()) return 0.0;
  if (exposure >= curve.back()) return 1.0;
  const size_t above = std::ranges::upper_bound(curve, exposure) - curve.begin();
  const double rise = curve[above] - curve[above - 1];
  return (static_cast<double>(above - 1) + (exposure - curve[above - 1]) / rise) / (kKnots - 1);
}

}  // namespace glasswing
