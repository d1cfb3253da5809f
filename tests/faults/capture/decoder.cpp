#include "tests/faults/capture/decoder.h"

#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <numbers>

namespace glasswing {
namespace {

constexpr int kBands = 12;
constexpr double kSigmas = 6.0;  // of noise that is let pass

class Frame {
 public:
  Frame(const Image16& image, const View& view) : image_(image), view_(view) {}
  int width_px() const { return image_.width_px; }
  int rows() const { return view_.pattern_rows; }
  double at(int x, int y, int c) const { return image_.at(x, y, c) / 65535.0; }
  double grey(int x, int y) const { return (at(x, y, 0) + at(x, y, 1) + at(x, y, 2)) / 3.0; }
  double max_noise() const { return kSigmas * view_.noise_sd; }

 private:
  const Image16& image_;
  const View& view_;
};

using Verdict = std::optional<std::string>;

Verdict compare(const Frame& frame, const std::function<double(int x, int y, int c)>& expected) {
  for (int y = 0; y < frame.rows(); ++y) {
    for (int x = 0; x < frame.width_px(); ++x) {
      for (int c = 0; c < 3; ++c) {
        if (std::abs(frame.at(x, y, c) - expected(x, y, c)) > frame.max_noise())
          return fmt::format("sample ({}, {}, {}) is {:.3f}, not {:.3f}", x, y, c, frame.at(x, y, c),
                             expected(x, y, c));
      }
    }
  }
  return std::nullopt;
}

double colour_of(const v1::Stimulus& stimulus, int c) {
  return stimulus.colour_size() == 3 ? stimulus.colour(c) : 1.0;
}

// For I = peak exp(-t^2 / (2 sigma^2)) the ratio of the neighbours one pixel to either side gives the
// distance t from the ridge: ln(I+ / I-) = -2 t cos / sigma^2 along x, with sin along y.
Verdict judge_stripe(const Frame& frame, const v1::Stimulus& stimulus, double step_px) {
  constexpr double kMinBright = 0.2;  // for a logarithm
  constexpr int kMinPixels = 12;      // in a band
  const double phi_rad = stimulus.phi_deg() * std::numbers::pi / 180.0;
  const double cos_phi = std::cos(phi_rad), sin_phi = std::sin(phi_rad);
  const double variance = stimulus.sigma_px() * stimulus.sigma_px();
  const bool along_x = std::abs(cos_phi) >= std::abs(sin_phi);
  const int dx = along_x ? 1 : 0, dy = along_x ? 0 : 1;
  const int band_rows = (frame.rows() + kBands - 1) / kBands;
  for (int first = 0; first < frame.rows(); first += band_rows) {
    double sum_px = 0.0;
    int count = 0;
    for (int y = first; y < std::min(first + band_rows, frame.rows()); ++y) {
      for (int x = 0; x < frame.width_px(); ++x) {
        const double place_px = (x + 0.5) * cos_phi + (y + 0.5) * sin_phi;
        const double off_px = place_px - stimulus.r_px();
        const double light = stimulus.peak() * std::exp(-0.5 * off_px * off_px / variance);
        if (std::abs(frame.grey(x, y) - light) > frame.max_noise())
          return fmt::format("pixel ({}, {}) is {:.3f}, not {:.3f}", x, y, frame.grey(x, y), light);
        const bool inside = x >= dx && y >= dy && x + dx < frame.width_px() && y + dy < frame.rows();
        if (!inside) continue;
        const double before = frame.grey(x - dx, y - dy), after = frame.grey(x + dx, y + dy);
        if (std::min(before, after) < kMinBright) continue;
        sum_px += place_px + variance * std::log(after / before) / (2.0 * (along_x ? cos_phi : sin_phi));
        ++count;
      }
    }
    // Within a quarter of a step: the stripe of the next step is a whole step away.
    if (count >= kMinPixels && std::abs(sum_px / count - stimulus.r_px()) > 0.25 * step_px)
      return fmt::format("the stripe is at {:.2f} px in rows {} to {}, not at {:.2f}", sum_px / count, first,
                         first + band_rows - 1, stimulus.r_px());
  }
  return std::nullopt;
}

Verdict judge_bars(const Frame& frame, const v1::Stimulus& stimulus) {
  const bool upright = stimulus.orient() == "vertical_bars";
  return compare(frame, [&](int x, int y, int c) {
    const auto bar = static_cast<int>(std::floor(((upright ? x : y) + 0.5) / stimulus.bar_width_px()));
    return (bar % 2 == 0) != stimulus.inverse() ? colour_of(stimulus, c) : 0.0;
  });
}

// The patch has sixteen columns of two cells below the pattern. The upper cell is brighter where the bit
// is 1.
Verdict judge_patch(const Image16& image, const Frame& frame, const v1::Stimulus& stimulus) {
  const int rows = image.height_px - frame.rows();
  unsigned id = 0;
  for (int bit = 0; bit < 16; ++bit) {
    const int x = (2 * bit + 1) * image.width_px / 32;
    if (frame.grey(x, frame.rows() + rows / 4) > frame.grey(x, frame.rows() + 3 * rows / 4)) id |= 1u << bit;
  }
  if (id != stimulus.patch_id())
    return fmt::format("the patch shows {:#06x}, not {:#06x}", id, stimulus.patch_id());
  return compare(frame, [](int, int, int) { return 0.0; });
}

}  // namespace

std::optional<std::string> mismatch(const Image16& image, const v1::Stimulus& stimulus, const View& view) {
  const Frame frame(image, view);
  if (stimulus.kind() == "gauss_stripe") return judge_stripe(frame, stimulus, view.step_px);
  if (stimulus.kind() == "square") return judge_bars(frame, stimulus);
  if (stimulus.kind() == "patch") return judge_patch(image, frame, stimulus);
  if (stimulus.kind() == "solid")
    return compare(frame, [&](int, int, int c) { return colour_of(stimulus, c); });
  return fmt::format("\"{}\" is not a kind that the decoder knows", stimulus.kind());
}

}  // namespace glasswing
