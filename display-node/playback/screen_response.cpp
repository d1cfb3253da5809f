#include "display-node/playback/screen_response.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/radiometry/tone_curve.h"

namespace glasswing {
namespace {

constexpr int kFormatVersion = 1;
constexpr std::array<const char*, 3> kPrimaries = {"red", "green", "blue"};

absl::StatusOr<Dither> dither_of(const v1::DisplayCalibration& calibration, const ScreenInfo& screen) {
  const auto bad = [&](const std::string& what) {
    return absl::InvalidArgumentError(
        fmt::format("the calibration of monitor \"{}\" {}", calibration.monitor(), what));
  };
  if (calibration.format_version() != kFormatVersion) {
    return bad(
        fmt::format("has format_version {}; it must be {}", calibration.format_version(), kFormatVersion));
  }
  if (screen.bits > kMaxCurveBits) {
    return bad(
        fmt::format("cannot be used: the monitor's codes have {} bits; they must have 8 to {} "
                    "(glasswing-display --bits)",
                    screen.bits, kMaxCurveBits));
  }
  const MonitorSize size = pattern_size_of(screen);
  if (calibration.bits() != screen.bits || calibration.width_px() != size.width_px ||
      calibration.height_px() != size.height_px) {
    return bad(fmt::format("is of {} x {} px and {} bits; the monitor has {} x {} px and {} bits",
                           calibration.width_px(), calibration.height_px(), calibration.bits(), size.width_px,
                           size.height_px, screen.bits));
  }
  if (calibration.primaries_size() != 3)
    return bad(fmt::format("has {} primaries; it must have 3", calibration.primaries_size()));
  std::vector<ToneCurve> curves;
  for (const v1::ToneCurve& primary : calibration.primaries()) {
    const char* const name = kPrimaries[curves.size()];
    if (primary.radiance_size() != 1 << screen.bits) {
      return bad(fmt::format("has {} codes of {}; it must have {}", primary.radiance_size(), name,
                             1 << screen.bits));
    }
    absl::StatusOr<ToneCurve> curve =
        ToneCurve::create({primary.radiance().begin(), primary.radiance().end()});
    if (!curve.ok()) return bad(fmt::format("has for {} {}", name, std::string(curve.status().message())));
    curves.push_back(*std::move(curve));
  }
  return Dither({curves[0], curves[1], curves[2]});
}

}  // namespace

absl::StatusOr<std::vector<std::optional<Dither>>> dithers_of(
    const google::protobuf::RepeatedPtrField<v1::DisplayCalibration>& calibrations,
    const std::vector<ScreenInfo>& screens) {
  std::vector<std::optional<Dither>> dithers(screens.size());
  for (const v1::DisplayCalibration& calibration : calibrations) {
    const auto screen = std::find_if(screens.begin(), screens.end(), [&](const ScreenInfo& each) {
      return each.name == calibration.monitor();
    });
    if (screen == screens.end()) {
      return absl::InvalidArgumentError(fmt::format("there is a calibration of monitor \"{}\"; there are: {}",
                                                    calibration.monitor(), names_of(screens)));
    }
    std::optional<Dither>& dither = dithers[screen - screens.begin()];
    if (dither) {
      return absl::InvalidArgumentError(fmt::format(
          "monitor \"{}\" has two calibrations; it must have one at most", calibration.monitor()));
    }
    GW_ASSIGN_OR_RETURN(dither, dither_of(calibration, *screen));
  }
  return dithers;
}

void round_to_codes(const Dither::Rows& radiance, int width_px, int bits, std::span<std::uint16_t> codes) {
  const auto highest = static_cast<float>((1 << bits) - 1);
  std::vector<float> row(3 * static_cast<size_t>(width_px));
  for (int y = 0; !codes.empty(); ++y, codes = codes.subspan(row.size())) {
    radiance(y, row);
    for (size_t i = 0; i < row.size(); ++i) {
      // Clamped last, and in two steps, so that the compiler can vectorise it.
      const float scaled = row[i] * highest + 0.5f;
      const float positive = scaled > 0.0f ? scaled : 0.0f;
      const float clamped = positive < highest ? positive : highest;
      codes[i] = static_cast<std::uint16_t>(static_cast<int>(clamped));
    }
  }
}

std::string names_of(const std::vector<ScreenInfo>& screens) {
  std::string names;
  for (const ScreenInfo& each : screens) names += (names.empty() ? "" : ", ") + each.name;
  return names;
}

}  // namespace glasswing
