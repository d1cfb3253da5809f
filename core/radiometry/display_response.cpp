#include "core/radiometry/display_response.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr double kClipped = 0.95;   // of the camera's full scale: above it, single pixels may be clipped
constexpr double kMaxChange = 0.2;  // of white, between two measurements
constexpr std::array<const char*, 3> kNames{"red", "green", "blue"};

bool is_solid_of(const ShownSolid& solid, int code) {
  return std::all_of(solid.code.begin(), solid.code.end(), [code](int c) { return c == code; });
}

std::vector<ShownSolid> all_of_code(const std::vector<ShownSolid>& solids, int code) {
  std::vector<ShownSolid> some;
  std::copy_if(solids.begin(), solids.end(), std::back_inserter(some),
               [code](const ShownSolid& solid) { return is_solid_of(solid, code); });
  return some;
}

double weight_of(double error) {
  return error > 0.0 ? 1.0 / (error * error) : 1.0;
}

ShownSolid mean_of(const std::vector<ShownSolid>& solids) {
  ShownSolid mean{.code = solids.front().code};
  for (size_t c = 0; c < 3; ++c) {
    double weights = 0.0;
    for (const ShownSolid& solid : solids) {
      mean.light[c] += weight_of(solid.error[c]) * solid.light[c];
      weights += weight_of(solid.error[c]);
    }
    mean.light[c] /= weights;
    mean.error[c] = solids.front().error[c] > 0.0 ? 1.0 / std::sqrt(weights) : 0.0;
  }
  return mean;
}

// The primary of which this is a gray; none for black and for mixtures.
std::optional<size_t> primary_of(const ShownSolid& solid) {
  std::optional<size_t> primary;
  for (size_t p = 0; p < 3; ++p) {
    if (solid.code[p] == 0) continue;
    if (primary) return std::nullopt;
    primary = p;
  }
  return primary;
}

absl::Status check(const std::vector<ShownSolid>& solids, int bits) {
  if (bits < 8 || bits > 12)
    return absl::InvalidArgumentError(fmt::format("codes have {} bits; it must be 8 to 12", bits));
  const int highest = (1 << bits) - 1;
  const bool errors = !solids.empty() && solids.front().error[0] > 0.0;
  for (const ShownSolid& solid : solids) {
    const std::string name = fmt::format("solid {}", fmt::join(solid.code, " "));
    if (!is_solid_of(solid, 0) && !is_solid_of(solid, highest) && !primary_of(solid)) {
      return absl::InvalidArgumentError(
          fmt::format("{}: it must be black (0 0 0), white ({} {} {}), or of one primary", name, highest,
                      highest, highest));
    }
    if (std::any_of(solid.error.begin(), solid.error.end(),
                    [errors](double error) { return !(error >= 0.0) || (error > 0.0) != errors; })) {
      return absl::InvalidArgumentError(fmt::format(
          "{} has errors {}; they must be positive, or 0 in all solids", name, fmt::join(solid.error, " ")));
    }
    const double brightest = *std::max_element(solid.light.begin(), solid.light.end());
    if (brightest > kClipped) {
      return absl::FailedPreconditionError(
          fmt::format("{} reads {:.3f} of the camera's full scale, where light is cut off; it must be {} at "
                      "most: use a shorter exposure",
                      name, brightest, kClipped));
    }
  }
  return absl::OkStatus();
}

struct Primary {
  ToneFit fit;
  std::array<double, 3> light;  // of its highest code, above black, in each channel
};

absl::StatusOr<Primary> fit_primary(size_t p, const std::vector<ShownSolid>& grays, const ShownSolid& black,
                                    int bits) {
  const int highest = (1 << bits) - 1;
  std::vector<ShownSolid> brightest;
  std::copy_if(grays.begin(), grays.end(), std::back_inserter(brightest),
               [&](const ShownSolid& gray) { return gray.code[p] == highest; });
  if (brightest.empty()) {
    return absl::FailedPreconditionError(
        fmt::format("{}: too few grays: code {} was not shown", kNames[p], highest));
  }
  std::array<double, 3> full{};
  const ShownSolid bright = mean_of(brightest);
  for (size_t c = 0; c < 3; ++c) full[c] = bright.light[c] - black.light[c];

  for (int pass = 0;; ++pass) {
    std::vector<TonePoint> points;
    for (const ShownSolid& solid : grays) {
      double along = 0.0, square = 0.0;
      for (size_t c = 0; c < 3; ++c) {
        const double weight = weight_of(solid.error[c]);
        along += weight * full[c] * (solid.light[c] - black.light[c]);
        square += weight * full[c] * full[c];
      }
      points.push_back({.code = solid.code[p],
                        .light = along / square,
                        .error = solid.error[0] > 0.0 ? 1.0 / std::sqrt(square) : 0.0});
    }
    GW_ASSIGN_OR_RETURN(ToneFit fit, fit_tone_curve(points, bits, kNames[p]));
    for (size_t c = 0; c < 3; ++c) {
      double along = 0.0, square = 0.0;
      for (const ShownSolid& solid : grays) {
        const double weight = weight_of(solid.error[c]), radiance = fit.curve.radiance(solid.code[p]);
        along += weight * radiance * (solid.light[c] - black.light[c]);
        square += weight * radiance * radiance;
      }
      full[c] = along / square;
    }
    if (pass == 1) return Primary{.fit = std::move(fit), .light = full};
  }
}

// Interpolates the references before and after a time, in one channel.
struct Reference {
  double light = 0.0, variance = 0.0;
};
Reference at_time(const std::vector<ShownSolid>& references, nanoseconds at, size_t c) {
  const auto after = std::find_if(references.begin(), references.end(),
                                  [at](const ShownSolid& reference) { return reference.at >= at; });
  const ShownSolid& next = after == references.end() ? references.back() : *after;
  const ShownSolid& last = after == references.begin() ? next : *(after - 1);
  const auto apart = static_cast<double>((next.at - last.at).count());
  const double share = apart > 0.0 ? std::min(static_cast<double>((at - last.at).count()) / apart, 1.0) : 1.0;
  return {.light = std::lerp(last.light[c], next.light[c], share),
          .variance = std::pow((1.0 - share) * last.error[c], 2) + std::pow(share * next.error[c], 2)};
}

}  // namespace

std::array<double, 3> DisplayResponse::light(const std::array<double, 3>& code) const {
  std::array<double, 3> sum = black;
  for (size_t p = 0; p < 3; ++p) {
    const double radiance = primary[p].curve.radiance(code[p]);
    for (size_t c = 0; c < 3; ++c) sum[c] += crosstalk[c][p] * radiance;
  }
  return sum;
}

absl::StatusOr<DisplayResponse> fit_display_response(const std::vector<ShownSolid>& solids, int bits) {
  GW_RETURN_IF_ERROR(check(solids, bits));
  const int highest = (1 << bits) - 1;
  const std::vector<ShownSolid> blacks = all_of_code(solids, 0), whites = all_of_code(solids, highest);
  if (blacks.empty()) return absl::FailedPreconditionError("black (0 0 0) was not shown");
  const ShownSolid black = mean_of(blacks);
  std::vector<Primary> primaries;
  for (size_t p = 0; p < 3; ++p) {
    std::vector<ShownSolid> grays{black};
    std::copy_if(solids.begin(), solids.end(), std::back_inserter(grays),
                 [p](const ShownSolid& solid) { return primary_of(solid) == p; });
    GW_ASSIGN_OR_RETURN(Primary primary, fit_primary(p, grays, black, bits));
    primaries.push_back(std::move(primary));
  }
  DisplayResponse response{.primary = {primaries[0].fit, primaries[1].fit, primaries[2].fit},
                           .black = black.light,
                           .excess_of_white = std::nullopt};
  for (size_t c = 0; c < 3; ++c) {
    for (size_t p = 0; p < 3; ++p) response.crosstalk[c][p] = primaries[p].light[c];
  }
  if (!whites.empty()) {
    const ShownSolid white = mean_of(whites);
    const double code = highest;
    const std::array<double, 3> sum = response.light({code, code, code});
    for (size_t c = 0; c < 3; ++c) {
      const double excess = (white.light[c] - sum[c]) / white.light[c];
      if (std::abs(excess) >= std::abs(response.excess_of_white.value_or(0.0)))
        response.excess_of_white = excess;
    }
  }
  return response;
}

absl::StatusOr<std::vector<ShownSolid>> without_drift(std::vector<ShownSolid> solids, int bits) {
  GW_RETURN_IF_ERROR(check(solids, bits));
  const auto earlier = [](const ShownSolid& a, const ShownSolid& b) { return a.at < b.at; };
  std::vector<ShownSolid> blacks = all_of_code(solids, 0), whites = all_of_code(solids, (1 << bits) - 1);
  if (blacks.empty() || whites.empty()) {
    return absl::FailedPreconditionError(
        "drift cannot be measured: black and white must be shown repeatedly");
  }
  std::stable_sort(blacks.begin(), blacks.end(), earlier);
  std::stable_sort(whites.begin(), whites.end(), earlier);
  for (size_t i = 1; i < whites.size(); ++i) {
    for (size_t c = 0; c < 3; ++c) {
      const double before = whites[i - 1].light[c], after = whites[i].light[c];
      if (std::abs(after - before) > kMaxChange * before) {
        return absl::FailedPreconditionError(fmt::format(
            "white changed from {:.3f} to {:.3f} of the camera's full scale from one "
            "showing to the next; is auto exposure or auto gain on, or does the monitor dim itself?",
            before, after));
      }
    }
  }
  const ShownSolid black = mean_of(blacks), white = mean_of(whites);
  for (ShownSolid& solid : solids) {
    for (size_t c = 0; c < 3; ++c) {
      const Reference black_then = at_time(blacks, solid.at, c), white_then = at_time(whites, solid.at, c);
      const double gain = (white.light[c] - black.light[c]) / (white_then.light - black_then.light);
      const double share = (solid.light[c] - black_then.light) / (white_then.light - black_then.light);
      solid.light[c] = black.light[c] + gain * (solid.light[c] - black_then.light);
      solid.error[c] =
          gain * std::sqrt(std::pow(solid.error[c], 2) + std::pow(1.0 - share, 2) * black_then.variance +
                           share * share * white_then.variance);
    }
  }
  return solids;
}

}  // namespace glasswing
