#include "core/composite/compositor.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numbers>
#include <thread>

#include "core/base/status.h"
#include "core/composite/footprint_quadrature.h"
#include "core/composite/summed_area_table.h"
#include "core/radiometry/primary_mix.h"

namespace glasswing {
namespace {

constexpr double kReach = 6.0;  // sigmas; 2e-9 of a Gaussian lies beyond

// A picture, optionally with x and y exchanged, so that either axis can be the one integrated in closed form.
struct View {
  const RadianceImage& image;
  int channel;
  bool exchanged;
  int width() const { return exchanged ? image.height_px : image.width_px; }
  int height() const { return exchanged ? image.width_px : image.height_px; }
  double at(int u, int v) const {
    return static_cast<double>(exchanged ? image.at(v, u, channel) : image.at(u, v, channel));
  }
};

// \int g(u; mean, sigma) T(u, v) du over row v of constant pixels.
double integrate_row(const View& view, int v, double mean, double sigma) {
  if (sigma < kPointSigma_px) {
    const int u = static_cast<int>(std::floor(mean));
    return mean >= 0.0 && u < view.width() ? view.at(u, v) : 0.0;
  }
  const int first = std::clamp(static_cast<int>(std::floor(mean - kReach * sigma)), 0, view.width());
  const int last = std::clamp(static_cast<int>(std::ceil(mean + kReach * sigma)), 0, view.width());
  const double scale = 1.0 / (sigma * std::numbers::sqrt2);
  double sum = 0.0;
  double before = std::erf((first - mean) * scale);
  for (int u = first; u < last; ++u) {
    const double after = std::erf((u + 1 - mean) * scale);
    sum += (after - before) * view.at(u, v);
    before = after;
  }
  return 0.5 * sum;
}

std::vector<RadianceImage> as_seen(const PrimaryMix& mix, const std::vector<RadianceImage>& pictures,
                                   int count) {
  std::vector<RadianceImage> seen = pictures;
  for (int t = 0; t < count && t < static_cast<int>(seen.size()); ++t) {
    std::vector<float>& samples = seen[t].samples;
    for (size_t at = 0; at + 3 <= samples.size(); at += 3) {
      const PrimaryMix::Light light = mix.seen(t, {samples[at], samples[at + 1], samples[at + 2]});
      std::copy(light.begin(), light.end(), samples.begin() + at);
    }
  }
  return seen;
}

}  // namespace

double integrate_footprint(const Mode& mode, const RadianceImage& texture, int channel) {
  if (texture.empty()) return 0.0;
  // Quadrature runs along the wider axis v; along u the conditional Gaussian has mean u0 + slope (v - v0).
  const bool exchanged = mode.xx_px2 > mode.yy_px2;
  const View view{texture, channel, exchanged};
  const double uu = std::max<double>(exchanged ? mode.yy_px2 : mode.xx_px2, 0.0);
  const double vv = std::max<double>(exchanged ? mode.xx_px2 : mode.yy_px2, 0.0);
  const double uv = mode.xy_px2;
  const double u0 = exchanged ? mode.y_px : mode.x_px;
  const double v0 = exchanged ? mode.x_px : mode.y_px;
  const double sigma_v = std::sqrt(vv);
  if (sigma_v < kPointSigma_px) {
    const int v = static_cast<int>(std::floor(v0));
    return v0 >= 0.0 && v < view.height() ? integrate_row(view, v, u0, std::sqrt(uu)) : 0.0;
  }
  const double slope = uv / vv;
  const double sigma_u = std::sqrt(std::max(uu - slope * uv, 0.0));
  const int first = std::clamp(static_cast<int>(std::floor(v0 - kReach * sigma_v)), 0, view.height());
  const int last = std::clamp(static_cast<int>(std::ceil(v0 + kReach * sigma_v)), 0, view.height());
  // Panels no wider than half of sigma_v, and narrow enough that the mean slides along u by about sigma_u at
  // most.
  const double slide = std::abs(slope) / std::max(sigma_u, 0.02);
  const double finest = std::max({1.0, 2.0 / sigma_v, std::min(slide, 50.0)});
  double sum = 0.0;
  for (int v = first; v < last; ++v) {
    const double low = std::max<double>(v, v0 - kReach * sigma_v);
    const double high = std::min<double>(v + 1, v0 + kReach * sigma_v);
    const int panels = std::max(1, static_cast<int>(std::ceil((high - low) * finest)));
    const double half = 0.5 * (high - low) / panels;
    for (int p = 0; p < panels; ++p) {
      const double middle = low + (2 * p + 1) * half;
      for (size_t n = 0; n < kNodes.size(); ++n) {
        const double z = (middle + half * kNodes[n] - v0) / sigma_v;
        const double density = std::exp(-0.5 * z * z) / (sigma_v * std::sqrt(2.0 * std::numbers::pi));
        sum += kNodeWeights[n] * half * density * integrate_row(view, v, u0 + slope * z * sigma_v, sigma_u);
      }
    }
  }
  return sum;
}

absl::Status check_backgrounds(const v1::MatteMetadata& metadata,
                               const std::vector<RadianceImage>& backgrounds) {
  const auto& monitors = metadata.monitors();
  for (int t = 0; t < monitors.size() && t < static_cast<int>(backgrounds.size()); ++t) {
    const RadianceImage& background = backgrounds[t];
    if (background.empty()) continue;
    if (background.width_px != monitors[t].width_px() || background.height_px != monitors[t].height_px()) {
      return absl::InvalidArgumentError(fmt::format(
          "the background of monitor \"{}\" is {}x{}; it must be {}x{}", monitors[t].name(),
          background.width_px, background.height_px, monitors[t].width_px(), monitors[t].height_px()));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<RadianceImage> composite(const Matte& matte, const std::vector<RadianceImage>& pictures,
                                        int thread_count, const std::function<void(double)>& progress) {
  GW_ASSIGN_OR_RETURN(const PrimaryMix mix, PrimaryMix::create(matte.metadata));
  std::vector<RadianceImage> seen;
  if (!mix.is_unit()) seen = as_seen(mix, pictures, matte.metadata.monitors_size());
  const std::vector<RadianceImage>& backgrounds = mix.is_unit() ? pictures : seen;
  GW_RETURN_IF_ERROR(check_backgrounds(matte.metadata, backgrounds));
  std::vector<SummedAreaTable> summed;
  if (matte.metadata.footprint() == kBoxFootprint) {
    for (const RadianceImage& background : backgrounds) summed.emplace_back(background);
  }
  const auto integral = [&](const Mode& mode, size_t texture, int channel) {
    return summed.empty() ? integrate_footprint(mode, backgrounds[texture], channel)
                          : summed[texture].mean(mode, channel);
  };
  RadianceImage out(matte.width_px(), matte.height_px());
  std::atomic<int> next_row = 0;
  const auto work = [&](bool reports) {
    for (int y = next_row++; y < matte.height_px(); y = next_row++) {
      for (int x = 0; x < matte.width_px(); ++x) {
        for (int c = 0; c < kChannels; ++c) {
          double light = matte.foreground(x, y)[c];
          for (const Mode& mode : matte.modes(x, y, c)) {
            const size_t texture = mode.texture;
            if (mode.weight > 0.0f && texture < backgrounds.size()) {
              light += mode.weight * integral(mode, texture, c);
            }
          }
          out.at(x, y, c) = static_cast<float>(light);
        }
        if (mix.is_unit()) continue;
        const PrimaryMix::Light primaries =
            mix.primaries({out.at(x, y, 0), out.at(x, y, 1), out.at(x, y, 2)});
        for (int c = 0; c < kChannels; ++c) out.at(x, y, c) = primaries[c];
      }
      if (reports && progress) progress(static_cast<double>(y + 1) / matte.height_px());
    }
  };
  if (thread_count <= 0) thread_count = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  std::vector<std::jthread> helpers;
  for (int i = 1; i < thread_count; ++i) helpers.emplace_back(work, false);
  work(true);
  helpers.clear();
  return out;
}

}  // namespace glasswing
