#include "core/composite/compositor.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <thread>

#include "core/base/status.h"
#include "core/composite/footprint_quadrature.h"
#include "core/composite/summed_area_table.h"
#include "core/radiometry/primary_mix.h"

namespace glasswing {
namespace {

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
  const FootprintLines lines(mode);
  const View view{texture, channel, lines.exchanged};
  double sum = 0.0;
  lines.for_each(view.height(), [&](int v, double mean, double sigma, double share) {
    double row = 0.0;
    for_pixels_of_line(mean, sigma, view.width(), [&](int u, double twice) { row += twice * view.at(u, v); });
    sum += share * (0.5 * row);
  });
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
          double light = matte.foreground_of_gaussians(x, y, c);
          const auto add = [&](const Mode& mode) {
            const size_t texture = mode.texture;
            if (mode.weight > 0.0f && texture < backgrounds.size()) {
              light += mode.weight * integral(mode, texture, c);
            }
          };
          if (matte.pyramids(x, y, c).empty()) {
            std::ranges::for_each(matte.modes(x, y, c), add);
          } else {
            std::ranges::for_each(matte.gaussians(x, y, c), add);
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
