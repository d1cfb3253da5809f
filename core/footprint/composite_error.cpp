#include "core/footprint/composite_error.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>

#include "core/base/for_rows.h"
#include "core/base/status.h"
#include "core/composite/compositor.h"
#include "core/footprint/light_slopes.h"
#include "core/footprint/matte_covariance.h"
#include "core/matte/exr_writer.h"
#include "core/radiometry/primary_mix.h"

namespace glasswing {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// By texture; none if all is black.
using LitMonitors = std::vector<std::optional<LitMonitor>>;

// Of one channel, in the camera's light.
double variance_of(std::span<const Mode> modes, int channel, const MatteCovariance& covariance,
                   const LitMonitors& monitors) {
  const Eigen::MatrixXd root = covariance.root(modes);
  if (root.size() == 0) return kUnknown;
  Eigen::VectorXd slopes = Eigen::VectorXd::Zero(root.rows());
  slopes[0] = 1.0;
  Eigen::Index p = 1;
  for (const Mode& mode : modes) {
    if (mode.weight <= 0.0f) continue;
    if (const auto& monitor = monitors[mode.texture]) {
      const LightSlopes own = monitor->slopes(footprint_of(mode), channel);
      const double weight = mode.weight;
      slopes.segment<6>(p) << own.light, weight * own.by_x, weight * own.by_y, weight * own.by_xx,
          weight * own.by_xy, weight * own.by_yy;
    }
    p += 6;
  }
  return (root.transpose() * slopes).squaredNorm();
}

// Of a channel with pyramids; its modes on other monitors stand beside them.
double variance_of_pyramids(const Matte& matte, int x, int y, int channel, const MatteCovariance& covariance,
                            const LitMonitors& monitors) {
  const std::span<const PyramidFootprint> pyramids = matte.pyramids(x, y, channel);
  double sum = 0.0;
  for (const PyramidFootprint& pyramid : pyramids) {
    const auto [places, root] = covariance.errors_of(pyramid, matte.modes(x, y, channel));
    if (root.size() == 0) return kUnknown;
    Eigen::VectorXd light = Eigen::VectorXd::Zero(root.rows());
    light[0] = 1.0;
    for (size_t k = 0; monitors[pyramid.texture] && k < places.size(); ++k)
      light[static_cast<Eigen::Index>(k) + 1] = monitors[pyramid.texture]->slopes(places[k], channel).light;
    sum += (root.transpose() * light).squaredNorm();
  }
  std::vector<Mode> others = matte.modes_without_pyramid(x, y, channel);
  std::erase_if(others, [](const Mode& mode) { return !(mode.weight > 0.0f); });
  return others.empty() ? sum : sum + variance_of(others, channel, covariance, monitors);
}

// For the primaries to which a composite is converted: independent channels.
std::array<double, kChannels> mixed(const PrimaryMix& mix, const std::array<double, kChannels>& variances) {
  if (mix.is_unit()) return variances;
  std::array<double, kChannels> sum{};
  for (size_t c = 0; c < kChannels; ++c) {
    PrimaryMix::Light one{};
    one[c] = 1.0f;
    const PrimaryMix::Light parts = mix.primaries(one);
    for (size_t p = 0; p < kChannels; ++p)
      sum[p] += std::pow(static_cast<double>(parts[p]), 2) * variances[c];
  }
  return sum;
}

}  // namespace

absl::StatusOr<RadianceImage> composite_error(const Matte& matte,
                                              const std::vector<RadianceImage>& backgrounds, int thread_count,
                                              const std::function<void(double)>& progress) {
  GW_ASSIGN_OR_RETURN(const MatteCovariance covariance, MatteCovariance::create(matte.metadata));
  GW_RETURN_IF_ERROR(check_backgrounds(matte.metadata, backgrounds));
  GW_ASSIGN_OR_RETURN(const PrimaryMix mix, PrimaryMix::create(matte.metadata));
  LitMonitors monitors(static_cast<size_t>(matte.metadata.monitors_size()));
  for (size_t t = 0; t < backgrounds.size() && t < monitors.size(); ++t) {
    if (!backgrounds[t].empty()) monitors[t].emplace(backgrounds[t], mix, static_cast<int>(t), thread_count);
  }
  RadianceImage error(matte.width_px(), matte.height_px());
  std::atomic<int> rows_done = 0;
  for_rows(matte.height_px(), thread_count, [&](int first, int last) {
    for (int y = first; y < last; ++y) {
      for (int x = 0; x < matte.width_px(); ++x) {
        const bool solved = matte.coverage(x, y) > 0.0f && matte.flags(x, y) == kFlagNone;
        std::array<double, kChannels> variances{kUnknown, kUnknown, kUnknown};
        for (int c = 0; solved && c < kChannels; ++c)
          variances[c] = matte.pyramids(x, y, c).empty()
                             ? variance_of(matte.modes(x, y, c), c, covariance, monitors)
                             : variance_of_pyramids(matte, x, y, c, covariance, monitors);
        variances = mixed(mix, variances);
        for (int c = 0; c < kChannels; ++c) error.at(x, y, c) = static_cast<float>(std::sqrt(variances[c]));
      }
      const int done = ++rows_done;
      if (progress && first == 0) progress(static_cast<double>(done) / matte.height_px());
    }
  });
  return error;
}

absl::StatusOr<std::string> encode_composite_error(const RadianceImage& error) {
  std::array<std::vector<float>, 4> planes;  // A, B, G, R
  for (size_t i = 0; i < error.samples.size(); i += kChannels) {
    const float *const own = &error.samples[i], sum = own[0] + own[1] + own[2];
    const bool known = std::isfinite(sum);
    planes[0].push_back(known ? 1.0f : 0.0f);
    for (size_t c = 0; c < kChannels; ++c) planes[kChannels - c].push_back(known ? own[c] : 0.0f);
  }
  const ExrPart part{.name = "error",
                     .channels = {"A", "B", "G", "R"},
                     .attributes = {{"colorInteropID", "data"},
                                    {"glasswing:conventions",
                                     "R, G, B: the standard error of a composite due to noise, in its linear "
                                     "light; A: 1 where it is known, otherwise 0"}}};
  const int width_px = error.width_px, height_px = error.height_px;
  return written_exr([&] {
    ExrWriter writer({part}, {.width_px = width_px,
                              .height_px = height_px,
                              .picture_width_px = width_px,
                              .picture_height_px = height_px});
    for (int y = 0; y < height_px; ++y) {
      std::vector<const float*> row;
      for (const std::vector<float>& plane : planes)
        row.push_back(plane.data() + static_cast<std::ptrdiff_t>(y) * width_px);
      writer.put(0, row);
    }
    return writer.finish();
  });
}

}  // namespace glasswing
