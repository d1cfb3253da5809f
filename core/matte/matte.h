// An environment matte: for every camera pixel, where its light comes from.
//
//   C = F + sum_i R_i \int G(x; c_i, Sigma_i) T(x) dx                (Chuang et al. 2000, eq. 12)
//
// per colour channel, with the orientation in the 2x2 covariance Sigma (docs/matte.md explains why no angle
// is stored). T is the picture on the mode's monitor, black beyond its edge. G is a Gaussian, or an upright
// box of the same covariance if the metadata says so.
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "glasswing/v1/matte.pb.h"

namespace glasswing {

inline constexpr int kMaxModes = 8;  // of a channel, over all monitors
inline constexpr int kChannels = 3;
inline constexpr std::array<const char*, kChannels> kChannelNames{"r", "g", "b"};

// MatteMetadata.footprint of mattes whose modes are upright boxes, sides sqrt(12 xx) and sqrt(12 yy).
inline constexpr std::string_view kBoxFootprint = "box";
// The same of mattes that may hold pyramids beside Gaussian modes.
inline constexpr std::string_view kPyramidFootprint = "pyramid";

// One footprint. An unused mode has weight 0.
struct Mode {
  float weight = 0.0f;  // R, the fraction of the radiance that arrives; >= 0
  float x_px = 0.0f;    // centre c, monitor px
  float y_px = 0.0f;
  float xx_px2 = 0.0f;  // covariance Sigma, monitor px^2, positive semi-definite
  float xy_px2 = 0.0f;  // 0 for a box
  float yy_px2 = 0.0f;
  std::int32_t texture = 0;  // the monitor: index in MatteMetadata.monitors
  // Standard errors of the weight and of the centre (rms of x and y); 0: unknown.
  float weight_sd = 0.0f;
  float centre_sd_px = 0.0f;
};

// A Gaussian of a pyramid: of level l, sigma is 2^l px, 2 sigma apart, the first one sigma from the edge.
// From level kPyramidLevels on: the channel's mode level - kPyramidLevels, of this weight, not of its own.
struct Coefficient {
  std::int32_t level = 0, column = 0, row = 0;
  float weight = 0.0f;  // as R; > 0
};
inline constexpr int kPyramidLevels = 5;
Mode mode_of(const Coefficient& coefficient, int texture);

// The light of a channel from one monitor, where no few Gaussians describe it: stands for the modes there,
// which are the closest Gaussians. Composites integrate Matte::gaussians().
struct PyramidFootprint {
  std::int32_t texture = 0;
  float foreground = 0.0f;  // added to F
  // Standard deviation of a sample per light of 1, and prior standard deviation of a coefficient of level 0;
  // of level l it is 4^l of that (core/footprint/matte_covariance.h).
  float noise_sd = 0.0f, prior_sd = 0.0f;
  std::vector<Coefficient> coefficients;
};

// Why a pixel is unreliable; 0: reliable.
enum PixelFlag : std::uint8_t {
  kFlagNone = 0,
  kFlagNotConverged = 1,  // the fit did not converge
  kFlagSaturated = 2,     // frames were clipped at the light it saw
  kFlagPoorFit = 4,       // the residual exceeds the noise
  kFlagNoData = 8,        // not solved
  kFlagFilled = 16,       // made of its neighbours (core/footprint/fill.h)
  kFlagDisturbed = 32,    // something moved while it was photographed, which is not corrected
};

// All flags with their names for users, the most serious first.
struct NamedFlag {
  PixelFlag flag;
  const char* name;
};
inline constexpr std::array<NamedFlag, 6> kNamedFlags{{{kFlagNoData, "not solved"},
                                                       {kFlagSaturated, "saturated"},
                                                       {kFlagNotConverged, "did not converge"},
                                                       {kFlagDisturbed, "disturbed"},
                                                       {kFlagPoorFit, "poor fit"},
                                                       {kFlagFilled, "filled"}}};

// A matte, or a tile of one: pixels [x0, x0 + width) x [y0, y0 + height) of the camera's picture.
class Matte {
 public:
  Matte() = default;
  // `colourless`: the modes are the same in all channels, and stored once.
  Matte(int x0_px, int y0_px, int width_px, int height_px, int modes_per_channel, bool colourless = false);

  v1::MatteMetadata metadata;

  int x0_px() const { return x0_px_; }
  int y0_px() const { return y0_px_; }
  int width_px() const { return width_px_; }
  int height_px() const { return height_px_; }
  int modes_per_channel() const { return modes_per_channel_; }  // 1 to kMaxModes
  bool is_colourless() const { return mode_channels_ == 1; }

  // x and y count from this tile's corner. foreground: F, linear. coverage: 1 inside the silhouette, 0
  // outside, in between where a method finds that the object covers part of the pixel. flags: PixelFlag bits.
  std::array<float, kChannels>& foreground(int x, int y) { return foreground_[pixel(x, y)]; }
  const std::array<float, kChannels>& foreground(int x, int y) const { return foreground_[pixel(x, y)]; }
  float& coverage(int x, int y) { return coverage_[pixel(x, y)]; }
  float coverage(int x, int y) const { return coverage_[pixel(x, y)]; }
  std::uint8_t& flags(int x, int y) { return flags_[pixel(x, y)]; }
  std::uint8_t flags(int x, int y) const { return flags_[pixel(x, y)]; }
  std::span<Mode> modes(int x, int y, int channel) {
    return {&modes_[mode_offset(x, y, channel)], static_cast<size_t>(modes_per_channel_)};
  }
  std::span<const Mode> modes(int x, int y, int channel) const {
    return {&modes_[mode_offset(x, y, channel)], static_cast<size_t>(modes_per_channel_)};
  }
  // At most one of each monitor.
  std::span<const PyramidFootprint> pyramids(int x, int y, int channel) const;
  std::span<PyramidFootprint> pyramids(int x, int y, int channel);
  void add_pyramid(int x, int y, int channel, PyramidFootprint pyramid);
  bool has_pyramids() const { return !pyramids_.empty(); }
  bool has_pyramid(int x, int y) const;  // in any channel
  // The modes on monitors of which the channel has no pyramid.
  std::vector<Mode> modes_without_pyramid(int x, int y, int channel) const;
  // Those, and the modes that pyramids keep beside them; and all the Gaussians that composites integrate, and
  // their F.
  std::vector<Mode> modes_beside_pyramids(int x, int y, int channel) const;
  std::vector<Mode> gaussians(int x, int y, int channel) const;
  float foreground_of_gaussians(int x, int y, int channel) const;
  // Leaves the modes alone; flags them where pyramids were, and adds a warning.
  void drop_pyramids();
  // Copies the pixels of `tile`, which must lie within this matte; metadata stays.
  void put(const Matte& tile);
  // Copies a whole pixel of `from`, which has the same number of modes, and channels of modes, as this matte.
  void copy_pixel(const Matte& from, int from_x, int from_y, int x, int y);

 private:
  size_t pixel(int x, int y) const {
    assert(x >= 0 && x < width_px_ && y >= 0 && y < height_px_);
    return static_cast<size_t>(y) * width_px_ + x;
  }
  size_t mode_offset(int x, int y, int channel) const {
    assert(channel >= 0 && channel < kChannels);
    const size_t channels = mode_channels_;
    return (pixel(x, y) * channels + std::min(static_cast<size_t>(channel), channels - 1)) *
           static_cast<size_t>(modes_per_channel_);
  }

  int x0_px_ = 0;
  int y0_px_ = 0;
  int width_px_ = 0;
  int height_px_ = 0;
  int modes_per_channel_ = 0;
  size_t mode_channels_ = kChannels;
  std::vector<std::array<float, kChannels>> foreground_;
  std::vector<float> coverage_;
  std::vector<std::uint8_t> flags_;
  std::vector<Mode> modes_;
  std::unordered_map<size_t, std::vector<PyramidFootprint>> pyramids_;  // by 3 pixel + channel
};

// The number of pixels that show the object, of those that are flagged, and of all unsolved pixels.
struct PixelCount {
  std::int64_t object = 0, flagged = 0, unsolved = 0;
  std::array<std::int64_t, kNamedFlags.size()> worst{};  // of the object, by its most serious flag

  PixelCount& operator+=(const PixelCount& other);
};
PixelCount count_pixels(const Matte& matte);

// For users: "12.5 % of the object's pixels are flagged: 10.0 % disturbed, 2.5 % filled"; empty if none are.
std::string flagged_text(const PixelCount& count);

}  // namespace glasswing
