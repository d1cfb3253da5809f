#include "core/sim/sensor.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace glasswing {
namespace {

constexpr nanoseconds kForever = nanoseconds::max() / 4;

// When picture i of a monitor is seen on its row y.
struct Interval {
  nanoseconds from, until;
};
Interval seen_on_row(const MonitorEmission& emission, size_t i, int y) {
  const EmissionMonitor& monitor = emission.monitor;
  const nanoseconds delay = monitor.lag + monitor.scanout * y / monitor.height_px;
  return {
      .from = emission.pictures[i].scanout_start + delay,
      .until = i + 1 < emission.pictures.size() ? emission.pictures[i + 1].scanout_start + delay : kForever};
}

// The one picture that every row shows for the whole window, if there is one.
const RadianceImage* steady(const MonitorEmission& emission, nanoseconds from, nanoseconds until) {
  for (size_t i = 0; i < emission.pictures.size(); ++i) {
    const bool shown = seen_on_row(emission, i, emission.monitor.height_px - 1).from <= from;
    if (shown && seen_on_row(emission, i, 0).until >= until) return emission.pictures[i].image.get();
  }
  return nullptr;
}

void blur(RadianceImage& image, double sigma_px) {
  const int reach = static_cast<int>(std::ceil(4.0 * sigma_px));
  std::vector<float> kernel;
  float sum = 0.0f;
  for (int i = -reach; i <= reach; ++i) {
    kernel.push_back(static_cast<float>(std::exp(-0.5 * i * i / (sigma_px * sigma_px))));
    sum += kernel.back();
  }
  for (const bool across : {true, false}) {
    const RadianceImage from = image;
    for (int y = 0; y < image.height_px; ++y) {
      for (int x = 0; x < image.width_px; ++x) {
        for (int c = 0; c < 3; ++c) {
          float light = 0.0f;
          for (int i = -reach; i <= reach; ++i) {
            const int u = across ? std::clamp(x + i, 0, image.width_px - 1) : x;
            const int v = across ? y : std::clamp(y + i, 0, image.height_px - 1);
            light += kernel[static_cast<size_t>(i + reach)] * from.at(u, v, c);
          }
          image.at(x, y, c) = light / sum;
        }
      }
    }
  }
}

}  // namespace

RadianceImage integrate(const Transport& transport, std::span<const MonitorEmission> emission,
                        const ExposureWindow& window, nanoseconds readout) {
  std::vector<RadianceImage> pictures(emission.size());
  bool all_steady = true;
  for (size_t m = 0; m < emission.size(); ++m) {
    if (emission[m].pictures.empty()) continue;  // black
    const RadianceImage* image = steady(emission[m], window.start, window.start + readout + window.exposure);
    all_steady = all_steady && image != nullptr;
    if (image != nullptr) pictures[m] = *image;
  }
  if (all_steady) return transport.respond(pictures);

  RadianceImage out(transport.width_px(), transport.height_px());
  for (int y = 0; y < out.height_px; ++y) {
    const nanoseconds from = window.start + readout * y / std::max(out.height_px - 1, 1);
    const nanoseconds until = from + window.exposure;
    // share[m][i][row]: the part of this row's exposure during which a monitor's row shows picture i.
    std::vector<std::vector<std::vector<float>>> share(emission.size());
    for (size_t m = 0; m < emission.size(); ++m) {
      for (size_t i = 0; i < emission[m].pictures.size(); ++i) {
        std::vector<float>& rows = share[m].emplace_back();
        for (int row = 0; row < emission[m].monitor.height_px; ++row) {
          const Interval seen = seen_on_row(emission[m], i, row);
          const nanoseconds overlap = std::min(seen.until, until) - std::max(seen.from, from);
          rows.push_back(static_cast<float>(std::max(overlap, nanoseconds(0)).count()) /
                         static_cast<float>(window.exposure.count()));
        }
      }
    }
    for (int x = 0; x < out.width_px; ++x) {
      for (int c = 0; c < 3; ++c) {
        float light = transport.foreground(x, y, c);
        for (const Tap& tap : transport.taps(x, y, c)) {
          const auto m = static_cast<size_t>(tap.monitor);
          for (size_t i = 0; i < share[m].size(); ++i) {
            const float part = share[m][i][static_cast<size_t>(tap.y_px)];
            if (part > 0.0f)
              light += tap.weight * part * emission[m].pictures[i].image->at(tap.x_px, tap.y_px, c);
          }
        }
        out.at(x, y, c) = light;
      }
    }
  }
  return out;
}

Image16 expose(const RadianceImage& mean_radiance, double exposure_ms, const SensorModel& model,
               std::int64_t frame_number) {
  RadianceImage light = mean_radiance;
  if (model.blur_sigma_px > 0.0) blur(light, model.blur_sigma_px);
  std::seed_seq seed{model.seed & 0xffffffffu, model.seed >> 32,
                     static_cast<std::uint64_t>(frame_number) & 0xffffffffu,
                     static_cast<std::uint64_t>(frame_number) >> 32};
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const double levels = std::exp2(model.bits) - 1.0;
  Image16 image(light.width_px, light.height_px);
  for (size_t i = 0; i < light.samples.size(); ++i) {
    const double value = static_cast<double>(light.samples[i]) * exposure_ms / model.full_scale_exposure_ms;
    const double sd = std::sqrt(model.read_sd * model.read_sd + model.gain * std::max(value, 0.0));
    const double noisy = std::clamp(value + sd * normal(random), 0.0, 1.0);
    image.samples[i] = static_cast<std::uint16_t>(std::lround(std::round(noisy * levels) / levels * 65535.0));
  }
  return image;
}

}  // namespace glasswing
