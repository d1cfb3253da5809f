#include "solver/method/brightness_drift.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <tuple>

#include "core/base/median.h"
#include "core/base/status.h"
#include "core/image/mosaic.h"
#include "core/pattern/stimulus_kind.h"
#include "core/radiometry/frame_light.h"
#include "solver/method/exposure_changes.h"

namespace glasswing {
namespace {

constexpr int kRows = 16;
constexpr double kMaxError = 0.005, kMaxDrift = 0.2;
constexpr double kUsualNoise = 0.003;

struct White {
  int white = 0, black = 0;  // indices in the manifest
  std::int64_t time_ns = 0;
  double exposure_ms = 0.0;
};
using Key = std::tuple<std::string, bool, std::string>;  // monitor, object, stimulus

double gray_of(const v1::Stimulus& stimulus) {
  if (kind_of(stimulus) != StimulusKind::kSolid || stimulus.colour_size() != 3) return -1.0;
  const bool gray = stimulus.colour(0) == stimulus.colour(1) && stimulus.colour(1) == stimulus.colour(2);
  return gray ? stimulus.colour(0) : -1.0;
}

// Repeated whites, by time, each with the nearest black in time of the same object and exposure.
std::map<Key, std::vector<White>> find_whites(const v1::CaptureManifest& manifest) {
  std::map<std::pair<bool, double>, std::vector<int>> blacks;
  const auto usable = [](const v1::Frame& frame) {
    return !frame.stimulus().reference() && frame.also_lit().empty() && frame.exposure_start_ns() > 0 &&
           frame.exposure_ms() > 0.0;
  };
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    if (usable(frame) && gray_of(frame.stimulus()) == 0.0)
      blacks[{frame.object(), frame.exposure_ms()}].push_back(i);
  }
  std::map<Key, std::vector<White>> whites;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    const auto dark = blacks.find({frame.object(), frame.exposure_ms()});
    if (!usable(frame) || gray_of(frame.stimulus()) <= 0.0 || dark == blacks.end()) continue;
    const std::int64_t time_ns = frame.exposure_start_ns();
    const int black = *std::ranges::min_element(dark->second, {}, [&](int index) {
      return std::abs(manifest.frames(index).exposure_start_ns() - time_ns);
    });
    whites[{frame.stimulus().panel(), frame.object(), frame.stimulus().SerializeAsString()}].push_back(
        {.white = i, .black = black, .time_ns = time_ns, .exposure_ms = frame.exposure_ms()});
  }
  // A solid shown only once with each exposure is not a repeat.
  std::erase_if(whites, [](const auto& entry) {
    std::map<double, int> shown;
    for (const White& white : entry.second) ++shown[white.exposure_ms];
    return std::ranges::none_of(shown, [](const auto& count) { return count.second > 1; });
  });
  for (auto& [key, list] : whites) std::ranges::sort(list, {}, &White::time_ns);
  return whites;
}

// Sums over one row of one white and the reference: light per exposure, where neither is saturated.
struct RowSums {
  double light = 0.0, reference = 0.0, variance = 0.0;
};

struct Point {
  std::int64_t time_ns = 0;
  double brightness = 1.0;
};

// The median of the rows' ratios, weighted by their light.
double usual_ratio(const std::vector<RowSums>& rows) {
  WeightedValues ratios;
  for (const RowSums& row : rows) {
    if (row.reference > 0.0) ratios.emplace_back(row.light / row.reference, row.reference);
  }
  return weighted_median(std::move(ratios));
}

class Measurement {
 public:
  Measurement(const v1::CaptureManifest& manifest, FrameLight light, const RowReader& read)
      : manifest_(manifest), light_(std::move(light)), read_(read), mosaic_(mosaic_of(manifest.camera())) {
    const bool calibrated = manifest.has_camera_calibration();
    const double read_sd = calibrated ? manifest.camera_calibration().read_sd() : manifest.camera().read_sd();
    read_sd_ = read_sd > 0.0 ? read_sd : kUsualNoise;
    gain_ = calibrated ? manifest.camera_calibration().shot_gain() : manifest.camera().gain();
  }

  absl::StatusOr<std::vector<Point>> points(const std::vector<White>& whites) const {
    const White& reference = *std::ranges::min_element(
        whites, {}, [](const White& white) { return std::pair(white.exposure_ms, white.time_ns); });
    std::vector<int> frames;
    for (const White& white : whites) frames.insert(frames.end(), {white.white, white.black});
    const size_t reference_index = &reference - whites.data();
    const int height = manifest_.camera().height_px();
    std::vector<std::vector<RowSums>> sums(whites.size());
    const int rows = std::min(kRows, height);
    for (int k = 0; k < rows; ++k) {
      const int y = (2 * k + 1) * height / (2 * rows);
      GW_ASSIGN_OR_RETURN(const std::vector<std::uint16_t> samples, read_(y, frames));
      for (size_t w = 0; w < whites.size(); ++w)
        sums[w].push_back(row_sums(samples, y, w, whites[w], reference_index, reference));
    }
    std::vector<Point> points;
    for (size_t w = 0; w < whites.size(); ++w) {
      RowSums all;
      for (const RowSums& row : sums[w]) {
        all.reference += row.reference;
        all.variance += row.variance;
      }
      if (!(all.reference > 0.0) || std::sqrt(all.variance) > kMaxError * all.reference) continue;
      points.push_back({.time_ns = whites[w].time_ns, .brightness = usual_ratio(sums[w])});
    }
    if (points.empty()) return points;
    // The first white is 1, whatever its exposure.
    const double first = points.front().brightness;
    for (Point& point : points) point.brightness /= first;
    return points;
  }

 private:
  RowSums row_sums(const std::vector<std::uint16_t>& samples, int y, size_t w, const White& white, size_t r,
                   const White& reference) const {
    RowSums sums;
    const size_t row = shape_of(manifest_.camera()).row_samples();
    for (size_t at = 0; at < row; ++at) {
      const auto sample = [&](size_t frame) { return samples[frame * row + at]; };
      const auto light = [&](size_t frame) {
        return static_cast<double>(light_.light(sample(frame), row_channel(mosaic_, at, y)));
      };
      if (light_.saturated(sample(2 * w)) || light_.saturated(sample(2 * r))) continue;
      const double lit = light(2 * w), first_lit = light(2 * r);
      sums.light += (lit - light(2 * w + 1)) / white.exposure_ms;
      sums.reference += (first_lit - light(2 * r + 1)) / reference.exposure_ms;
      const double variance = read_sd_ * read_sd_ + gain_ * std::max(lit, 0.0),
                   first = read_sd_ * read_sd_ + gain_ * std::max(first_lit, 0.0);
      sums.variance += 2.0 * variance / (white.exposure_ms * white.exposure_ms) +
                       2.0 * first / (reference.exposure_ms * reference.exposure_ms);
    }
    return sums;
  }

  const v1::CaptureManifest& manifest_;
  const FrameLight light_;
  const RowReader& read_;
  const std::optional<Mosaic> mosaic_;
  double read_sd_ = 0.0, gain_ = 0.0;
};

double brightness_at(const std::vector<Point>& points, std::int64_t time_ns) {
  const auto after = std::ranges::lower_bound(points, time_ns, {}, &Point::time_ns);
  if (after == points.begin()) return points.front().brightness;
  if (after == points.end()) return points.back().brightness;
  const Point &a = *(after - 1), &b = *after;
  const double part = static_cast<double>(time_ns - a.time_ns) / static_cast<double>(b.time_ns - a.time_ns);
  return a.brightness + part * (b.brightness - a.brightness);
}

}  // namespace

absl::StatusOr<std::vector<std::array<float, 3>>> measure_brightness_drift(
    const v1::CaptureManifest& manifest, const RowReader& read) {
  const std::map<Key, std::vector<White>> whites = find_whites(manifest);
  if (whites.empty()) return measure_exposure_changes(manifest, read);
  GW_ASSIGN_OR_RETURN(FrameLight light, FrameLight::create(manifest));
  const Measurement measurement(manifest, std::move(light), read);
  std::map<std::pair<std::string, bool>, std::vector<Point>> of_monitors;
  for (const auto& [key, list] : whites) {
    GW_ASSIGN_OR_RETURN(std::vector<Point> points, measurement.points(list));
    for (const Point& point : points) {
      if (std::abs(point.brightness - 1.0) > kMaxDrift) {
        return absl::FailedPreconditionError(
            fmt::format("the white of monitor \"{}\" changed by {:.0f} % during the session; up to {:.0f} % "
                        "can be corrected",
                        std::get<0>(key), 100.0 * (point.brightness - 1.0), 100.0 * kMaxDrift));
      }
    }
    std::vector<Point>& known = of_monitors[{std::get<0>(key), std::get<1>(key)}];
    if (points.size() > known.size()) known = std::move(points);
  }
  std::vector<std::array<float, 3>> brightness;
  for (const v1::Frame& frame : manifest.frames()) {
    const auto known = of_monitors.find({frame.stimulus().panel(), frame.object()});
    const bool drifted = known != of_monitors.end() && known->second.size() > 1 &&
                         frame.exposure_start_ns() > 0 && frame.also_lit().empty();
    const float own =
        drifted ? static_cast<float>(brightness_at(known->second, frame.exposure_start_ns())) : 1.0f;
    brightness.push_back({own, own, own});
  }
  return brightness;
}

}  // namespace glasswing
