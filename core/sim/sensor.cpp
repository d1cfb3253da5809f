#include "core/sim/sensor.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/sim/radial_shading.h"

namespace glasswing {
namespace {

using Codes = const std::uint16_t*;

// The integral of r (emission_timeline.h) up to u.
double ramp_integral_ns(double u_ns, double settle_ns) {
  if (u_ns <= 0.0) return 0.0;
  return u_ns < settle_ns ? 0.5 * u_ns * u_ns / settle_ns : u_ns - 0.5 * settle_ns;
}

// One monitor's light during one camera row's exposure.
class RowLight {
 public:
  RowLight(const MonitorEmission& emission, Transport::Rows rows, nanoseconds from, nanoseconds until)
      : emission_(emission), from_(from), until_(until) {
    if (rows.last < rows.first || emission.pictures.empty()) return;  // the row sees nothing
    for (size_t i = 0; i < emission.pictures.size(); ++i) {
      const bool over = i + 1 < emission.pictures.size() && settled(i + 1, rows.last) <= from;
      if (over || turns(i, rows.first) >= until) continue;
      const bool steady = flicker().amplitude == 0.0 && settled(i, rows.last) <= from &&
                          (i + 1 == emission.pictures.size() || turns(i + 1, rows.first) >= until);
      if (steady) {
        steady_ = emission.pictures[i].image->samples.data();
        return;
      }
      add_changing(i, rows);
    }
  }
  // The codes of the one picture visible on all rows; null if the light changes.
  Codes steady() const { return steady_; }
  bool black() const { return steady_ == nullptr && changing_.empty(); }
  // Mean light of a sample over the exposure.
  float operator()(std::uint32_t sample) const {
    const size_t row = sample / static_cast<std::uint32_t>(3 * emission_.monitor.width_px) - first_row_;
    float light = 0.0f;
    for (const Changing& picture : changing_)
      light += picture.shares[row] * radiance_of(picture.codes[sample]);
    return light;
  }

 private:
  struct Changing {
    Codes codes;
    std::vector<float> shares;  // of the exposure, by monitor row
  };
  nanoseconds turns(size_t i, int row) const {
    const EmissionMonitor& monitor = emission_.monitor;
    return emission_.pictures[i].scanout_start + monitor.lag + monitor.scanout * row / monitor.height_px;
  }
  const Flicker& flicker() const { return emission_.monitor.flicker; }
  nanoseconds settled(size_t i, int row) const { return turns(i, row) + emission_.monitor.settle; }
  // How long, within the exposure, a row shows picture i or a later one, weighted by the light of each
  // moment.
  double turned_ns(size_t i, int row) const {
    if (i == emission_.pictures.size()) return 0.0;
    const auto settle_ns = static_cast<double>(emission_.monitor.settle.count());
    const nanoseconds turn = turns(i, row);
    const double turned = ramp_integral_ns(static_cast<double>((until_ - turn).count()), settle_ns) -
                          ramp_integral_ns(static_cast<double>((from_ - turn).count()), settle_ns);
    if (flicker().amplitude == 0.0) return turned;
    return turned + flicker().amplitude *
                        flicker_integral_ns(flicker().hz, turn, emission_.monitor.settle, from_, until_);
  }
  void add_changing(size_t i, Transport::Rows rows) {
    first_row_ = static_cast<size_t>(rows.first);
    Changing& picture = changing_.emplace_back();
    picture.codes = emission_.pictures[i].image->samples.data();
    const auto exposure_ns = static_cast<double>((until_ - from_).count());
    for (int row = rows.first; row <= rows.last; ++row) {
      const double share = (turned_ns(i, row) - turned_ns(i + 1, row)) / exposure_ns;
      picture.shares.push_back(static_cast<float>(share));
    }
  }

  const MonitorEmission& emission_;
  const nanoseconds from_, until_;
  Codes steady_ = nullptr;
  size_t first_row_ = 0;
  std::vector<Changing> changing_;
};

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
            light += kernel[i + reach] * from.at(u, v, c);
          }
          image.at(x, y, c) = light / sum;
        }
      }
    }
  }
}

void vignette(RadianceImage& image, double share) {
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      const float left = radial_shading(share, x, y, image.width_px, image.height_px);
      for (int c = 0; c < 3; ++c) image.at(x, y, c) *= left;
    }
  }
}

}  // namespace

RadianceImage integrate(const Transport& transport, std::span<const MonitorEmission> emission,
                        const ExposureWindow& window, nanoseconds readout) {
  RadianceImage out(transport.width_px(), transport.height_px());
  const size_t row_samples = static_cast<size_t>(out.width_px) * 3;
  for (int y = 0; y < out.height_px; ++y) {
    const nanoseconds from = window.start + readout * y / std::max(out.height_px - 1, 1);
    const std::span<float> row(out.samples.data() + static_cast<size_t>(y) * row_samples, row_samples);
    transport.start_row(y, row);
    for (size_t m = 0; m < emission.size(); ++m) {
      const RowLight light(emission[m], transport.rows_seen(m, y), from, from + window.exposure);
      if (light.black()) continue;
      if (const Codes codes = light.steady(); codes != nullptr) {
        transport.add_row(m, y, row, [codes](std::uint32_t sample) { return radiance_of(codes[sample]); });
      } else {
        transport.add_row(m, y, row, light);
      }
    }
  }
  return out;
}

RadianceImage through_lens(const RadianceImage& rays, double sigma_px) {
  RadianceImage blurred = rays;
  blur(blurred, kRaysAcross * sigma_px);
  RadianceImage out(rays.width_px / kRaysAcross, rays.height_px / kRaysAcross);
  constexpr float kShare = 1.0f / (kRaysAcross * kRaysAcross);
  for (int y = 0; y < kRaysAcross * out.height_px; ++y) {
    for (int x = 0; x < kRaysAcross * out.width_px; ++x) {
      for (int c = 0; c < 3; ++c) out.at(x / kRaysAcross, y / kRaysAcross, c) += kShare * blurred.at(x, y, c);
    }
  }
  return out;
}

Image16 expose(const RadianceImage& mean_radiance, double exposure_ms, const SensorModel& model,
               std::int64_t frame_number) {
  RadianceImage vignetted;
  if (model.vignetting > 0.0) {
    vignetted = mean_radiance;
    vignette(vignetted, model.vignetting);
  }
  const std::vector<float>& light = vignetted.empty() ? mean_radiance.samples : vignetted.samples;
  const SampleResponse response{.scale = static_cast<float>(exposure_ms / model.full_scale_exposure_ms),
                                .read_variance = static_cast<float>(model.read_sd * model.read_sd),
                                .gain = static_cast<float>(model.gain),
                                .black = static_cast<float>(model.black_level),
                                .curve = model.curve,
                                .levels = (1 << model.bits) - 1};
  Image16 image(mean_radiance.width_px, mean_radiance.height_px);
  std::array<float, kSampleBlock> noise{}, in{};
  std::array<std::uint16_t, kSampleBlock> out{};
  for (size_t at = 0; at < light.size(); at += kSampleBlock) {
    const size_t count = std::min(kSampleBlock, light.size() - at);
    standard_normals(model.seed, frame_number, static_cast<std::uint32_t>(at / kSampleBlock), noise);
    std::copy_n(light.begin() + at, count, in.begin());
    respond(response, in, noise, out);
    std::copy_n(out.begin(), count, image.samples.begin() + at);
  }
  return image;
}

}  // namespace glasswing
