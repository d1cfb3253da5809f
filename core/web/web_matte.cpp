#include "core/web/web_matte.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "core/footprint/fill.h"
#include "core/footprint/mode_reduction.h"
#include "core/image/image_file.h"
#include "core/matte/covariance_axes.h"

namespace glasswing {
namespace {

constexpr size_t kMaxFootprints = 255;  // of a pixel: its number of them is a byte
constexpr int kMaxOfPyramid = 48;       // footprints, of a channel
constexpr double kPlaces = 65536.0;     // that a number of 16 bits tells apart
constexpr double kBeside = 1.06;        // of the monitor's longer side: room for footprints beyond it
constexpr int kDark = 16;               // of 255, a code of F
constexpr double kAngles = 256.0;       // in half a turn

enum Plane {
  kCount,
  kRed,
  kGreen,
  kBlue,
  kXLow,
  kXHigh,
  kYLow,
  kYHigh,
  kWide,
  kNarrow,
  kAngle,
  kTexture,
  kWeights
};  // kWeights: low and high byte for each channel
constexpr size_t kPlaneCount = kWeights + 2 * kChannels;
constexpr std::array<const char*, kPlaneCount> kPlaneNames{
    "count",  "red",   "green",   "blue",    "x_low",    "x_high",    "y_low",      "y_high",   "wide",
    "narrow", "angle", "texture", "red_low", "red_high", "green_low", "green_high", "blue_low", "blue_high"};

// The largest power of two up to `most`, and at least 1.
double coarseness(double most) {
  return most < 2.0 ? 1.0 : std::ldexp(1.0, std::ilogb(most));
}
double rounded(double value, double step) {
  return step * std::round(value / step);
}

struct Axes {
  double wide_px = 0.0, narrow_px = 0.0, angle = 0.0;  // radians, of the wide one, in [0, pi)
};
Axes axes_of(const Mode& mode) {
  const Covariance covariance{.xx = mode.xx_px2, .xy = mode.xy_px2, .yy = mode.yy_px2};
  const AxisVariances own = axis_variances(covariance);
  const double angle = wide_axis_rad(covariance);
  return {.wide_px = std::sqrt(own.wide),
          .narrow_px = std::sqrt(std::max(own.narrow, 0.0)),
          .angle = angle < 0.0 ? angle + std::numbers::pi : angle};
}

// The variance with that of the monitor's pixels.
double seen(double sigma_px) {
  return sigma_px * sigma_px + 1.0 / 12.0;
}

// One footprint in whole numbers, with the weights of all channels that share it.
struct Footprint {
  Mode mode;  // of the first of them
  Axes axes;
  std::array<double, kChannels> weight{};
};

bool is_alike(const Footprint& a, const Mode& b) {
  if (a.mode.texture != b.texture) return false;
  const Axes other = axes_of(b);
  const double near_px = std::max({0.125, 0.125 * a.axes.narrow_px, double{a.mode.centre_sd_px}});
  const auto same_width = [](double one, double two) {
    return std::abs(one - two) <= 0.15 * std::max(one, two) + 0.05;
  };
  // Widths that differ as ellipses do: by their matrices, which have no angle for round ones.
  const double turn = std::abs(std::remainder(a.axes.angle - other.angle, std::numbers::pi));
  return std::abs(a.mode.x_px - b.x_px) <= near_px && std::abs(a.mode.y_px - b.y_px) <= near_px &&
         same_width(a.axes.wide_px, other.wide_px) && same_width(a.axes.narrow_px, other.narrow_px) &&
         turn * (a.axes.wide_px - a.axes.narrow_px) <= 0.15 * a.axes.narrow_px + 0.05;
}

// Those that a channel's light is shown by: of a pyramid, a smaller number of Gaussians that have its light.
std::vector<Mode> modes_of(const Matte& matte, int x, int y, int channel) {
  if (matte.pyramids(x, y, channel).empty()) {
    const std::span<const Mode> own = matte.modes(x, y, channel);
    return {own.begin(), own.end()};
  }
  std::vector<Mode> modes = matte.gaussians(x, y, channel);
  const auto light = [&] {
    return std::accumulate(modes.begin(), modes.end(), 0.0,
                           [](double sum, const Mode& mode) { return sum + double{mode.weight}; });
  };
  const double whole = light();
  reduce_modes(modes, kMaxOfPyramid, false);
  std::erase_if(modes, [](const Mode& mode) { return !(mode.weight >= kWeightUnit); });
  const double left = light();
  for (Mode& mode : modes) mode.weight *= static_cast<float>(whole / left);
  return modes;
}

std::vector<Footprint> footprints_of(const Matte& matte, int x, int y) {
  std::vector<Footprint> found;
  for (int c = 0; c < kChannels; ++c) {
    const size_t channel = c;
    for (const Mode& mode : modes_of(matte, x, y, c)) {
      if (!(mode.weight >= kWeightUnit)) continue;
      auto shared = std::ranges::find_if(
          found, [&](const Footprint& each) { return each.weight[channel] == 0.0 && is_alike(each, mode); });
      if (shared == found.end())
        shared = found.insert(found.end(), {.mode = mode, .axes = axes_of(mode), .weight = {}});
      shared->weight[channel] = mode.weight;
    }
  }
  std::ranges::stable_sort(found, std::ranges::greater{},
                           [](const Footprint& each) { return std::ranges::max(each.weight); });
  return found;
}

absl::StatusOr<std::string> deflated(const std::string& bytes) {
  std::string packed(compressBound(bytes.size()), '\0');
  uLongf size = packed.size();
  if (compress2(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()),
                bytes.size(), Z_BEST_COMPRESSION) != Z_OK)
    return absl::InternalError("zlib could not deflate a plane");
  packed.resize(size);
  return packed;
}

class Writer {
  struct Numbers {
    int x = 0, y = 0, wide = 0, narrow = 0, angle = 0, texture = 0;
    std::array<int, kChannels> weight{};
  };

 public:
  Writer(const Matte& matte, WebMatte& web) : matte_(matte), web_(web) {}

  void put_pixel(int x, int y) {
    for (size_t c = 0; c < kChannels; ++c) {
      const double light = std::max<double>(matte_.foreground_of_gaussians(x, y, static_cast<int>(c)), 0.0) /
                           web_.foreground_scale;
      int code = static_cast<int>(std::lround(255.0 * srgb_of_linear(static_cast<float>(light))));
      if (code < kDark) code &= ~3;  // noise, which an eye does not see there
      put(kRed + c, code - light_[c]);
      light_[c] = code;
    }
    std::vector<Numbers> left;
    for (const Footprint& footprint : footprints_of(matte_, x, y)) left.push_back(numbers_of(footprint));
    put(kCount, static_cast<int>(left.size()));
    web_.footprint_count += left.size();
    // In the order that leaves the smallest differences, place by place.
    for (size_t slot = 0; !left.empty(); ++slot) {
      const auto next = std::ranges::min_element(
          left, {}, [&](const Numbers& numbers) { return distance(last_[slot], numbers); });
      put_footprint(*next, slot);
      left.erase(next);
    }
  }

  absl::Status finish() {
    for (size_t i = 0; i < kPlaneCount; ++i) {
      absl::StatusOr<std::string> packed = deflated(planes_[i]);
      if (!packed.ok()) return packed.status();
      web_.planes.push_back({.name = kPlaneNames[i], .bytes = packed->size()});
      web_.bytes += *packed;
    }
    return absl::OkStatus();
  }

 private:
  void put(size_t plane, int value) { planes_[plane].push_back(static_cast<char>(value)); }
  // The difference of two numbers of 16 bits, small ones of either sign first.
  void put_difference(size_t low, size_t high, int from, int to) {
    const auto difference = static_cast<std::int16_t>(to - from);
    const auto folded = static_cast<std::uint16_t>((difference << 1) ^ (difference >> 15));
    put(low, folded & 255);
    put(high, folded >> 8);
  }

  Numbers numbers_of(const Footprint& footprint) const {
    const Mode& mode = footprint.mode;
    const double coarse = coarseness(0.0625 * footprint.axes.narrow_px / web_.unit_px);
    const auto place = [&](double at) {
      return static_cast<int>(
          std::clamp(rounded((at - web_.origin_px) / web_.unit_px, coarse), 0.0, kPlaces - 1.0));
    };
    // Narrow ones are coarser: the monitor's pixels hide them.
    const auto width = [](double sigma_px) {
      const double code = kWidthsAnOctave * std::log2(std::max(sigma_px, kNarrowest_px) / kNarrowest_px);
      return static_cast<int>(std::clamp(
          rounded(code, coarseness(seen(sigma_px) / std::max(sigma_px * sigma_px, 1e-3))), 0.0, 255.0));
    };
    Numbers numbers{.x = place(mode.x_px),
                    .y = place(mode.y_px),
                    .wide = width(footprint.axes.wide_px),
                    .narrow = width(footprint.axes.narrow_px),
                    .angle = 0,
                    .texture = mode.texture,
                    .weight = {}};
    if (numbers.wide > numbers.narrow) {
      // A turn moves the ends of the wide axis by less than a tenth of the narrow one, or changes a nearly
      // round footprint's covariance by less than a tenth of its smaller variance.
      const double wide = seen(footprint.axes.wide_px), narrow = seen(footprint.axes.narrow_px);
      const double turn =
          0.2 * std::max(std::sqrt(narrow / wide), narrow / (wide - narrow)) * kAngles / std::numbers::pi;
      numbers.angle = static_cast<int>(rounded(footprint.axes.angle * kAngles / std::numbers::pi,
                                               coarseness(std::min(turn, kAngles)))) &
                      255;
    }
    for (size_t c = 0; c < kChannels; ++c) {
      numbers.weight[c] =
          static_cast<int>(std::min(std::round(footprint.weight[c] / kWeightUnit), kPlaces - 1.0));
    }
    return numbers;
  }

  static int distance(const Numbers& a, const Numbers& b) {
    int sum =
        std::abs(a.x - b.x) + std::abs(a.y - b.y) + std::abs(a.wide - b.wide) + std::abs(a.narrow - b.narrow);
    for (size_t c = 0; c < kChannels; ++c) sum += std::abs(a.weight[c] - b.weight[c]);
    return a.texture == b.texture ? sum : sum + static_cast<int>(kPlaces);
  }

  void put_footprint(const Numbers& numbers, size_t slot) {
    Numbers& last = last_[slot];
    put_difference(kXLow, kXHigh, last.x, numbers.x);
    put_difference(kYLow, kYHigh, last.y, numbers.y);
    put(kWide, numbers.wide - last.wide);
    put(kNarrow, numbers.narrow - last.narrow);
    put(kAngle, numbers.angle - last.angle);
    put(kTexture, numbers.texture);
    for (size_t c = 0; c < kChannels; ++c)
      put_difference(kWeights + 2 * c, kWeights + 2 * c + 1, last.weight[c], numbers.weight[c]);
    last = numbers;
  }

  const Matte& matte_;
  WebMatte& web_;
  std::array<std::string, kPlaneCount> planes_;
  std::array<int, kChannels> light_{};
  std::array<Numbers, kMaxFootprints> last_{};  // by place in a pixel's list
};

// The smallest region around the pixels that see a monitor's picture: not, for instance, the id patches below
// it. All of the matte if there are none.
MatteRegion seeing_region(const Matte& matte) {
  int left = matte.width_px(), top = matte.height_px(), right = -1, bottom = -1;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      bool sees = false;
      for (int c = 0; c < kChannels && !sees; ++c)
        sees = std::ranges::any_of(matte.modes(x, y, c), [](const Mode& mode) { return mode.weight > 0.0f; });
      if (!sees) continue;
      left = std::min(left, x);
      right = std::max(right, x);
      top = std::min(top, y);
      bottom = std::max(bottom, y);
    }
  }
  if (right < 0) return {.x_px = 0, .y_px = 0, .width_px = matte.width_px(), .height_px = matte.height_px()};
  return {.x_px = left, .y_px = top, .width_px = right - left + 1, .height_px = bottom - top + 1};
}

// What is not solved is filled, as `glasswing matte fill` does.
Matte shown_part(const Matte& matte, const MatteRegion& region) {
  Matte part(0, 0, region.width_px, region.height_px, matte.modes_per_channel(), matte.is_colourless());
  part.metadata = matte.metadata;
  for (int y = 0; y < region.height_px; ++y) {
    for (int x = 0; x < region.width_px; ++x) part.copy_pixel(matte, region.x_px + x, region.y_px + y, x, y);
  }
  fill(part);
  return part;
}

}  // namespace

absl::StatusOr<WebMatte> encode_web_matte(const Matte& whole) {
  WebMatte web{.region = seeing_region(whole), .planes = {}, .bytes = {}};
  const Matte matte = shown_part(whole, web.region);
  double side_px = 1.0;
  for (const v1::Monitor& monitor : matte.metadata.monitors())
    side_px = std::max<double>(
        {side_px, static_cast<double>(monitor.width_px()), static_cast<double>(monitor.height_px())});
  web.unit_px = 1.0 / 16.0;
  while (web.unit_px * kPlaces < kBeside * side_px) web.unit_px *= 2.0;
  web.origin_px = -std::floor(0.5 * (web.unit_px * kPlaces - side_px));
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      for (int c = 0; c < kChannels; ++c)
        web.foreground_scale = std::max<double>(web.foreground_scale, matte.foreground_of_gaussians(x, y, c));
    }
  }
  Writer writer(matte, web);
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) writer.put_pixel(x, y);
  }
  if (absl::Status finished = writer.finish(); !finished.ok()) return finished;
  return web;
}

}  // namespace glasswing
