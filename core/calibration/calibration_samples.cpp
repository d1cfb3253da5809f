#include "core/calibration/calibration_samples.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "core/base/status.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

constexpr size_t kMaxPixels = 40000;       // of all monitors
constexpr size_t kMinSeeingPixels = 1000;  // of a monitor that counts as seen
constexpr double kSeen = 0.3;              // of white's code above black where it is brightest
constexpr double kMinContrast = 0.1;       // of full scale, white above black
constexpr int kRim_px = 2;                 // pixels this close to a monitor's edge may see past it

using FrameIndex = std::vector<std::array<std::vector<int>, 3>>;  // [exposure][Shown]: frames

Shown shown_by(const v1::Stimulus& stimulus) {
  if (kind_of(stimulus) == StimulusKind::kStripe) return Shown::kStripe;
  return stimulus.colour_size() > 0 && stimulus.colour(0) == 0.0 ? Shown::kBlack : Shown::kWhite;
}

// White above black of each pixel, in its brightest channel, from one take of each.
std::vector<float> contrast(const MappedArchive& archive, const std::array<std::vector<int>, 3>& frames) {
  const v1::Camera& camera = archive.manifest().camera();
  const auto white = archive.rows(frames[static_cast<size_t>(Shown::kWhite)].front(), 0, camera.height_px());
  const auto black = archive.rows(frames[static_cast<size_t>(Shown::kBlack)].front(), 0, camera.height_px());
  std::vector<float> out(white.size() / 3);
  for (size_t i = 0; i < white.size(); ++i) {
    out[i / 3] = std::max(out[i / 3], static_cast<float>(white[i] - black[i]) / 65535.0f);
  }
  return out;
}

std::vector<size_t> seeing_pixels(const MappedArchive& archive, const FrameIndex& frames) {
  const int width = archive.manifest().camera().width_px(), height = archive.manifest().camera().height_px();
  std::vector<float> above;
  float contrast_of_white = 0.0f;
  for (const auto& exposure : frames) {  // the shortest with enough contrast, where white is not clipped
    above = contrast(archive, exposure);
    contrast_of_white = brightest(above);
    if (contrast_of_white >= kMinContrast) break;
  }
  std::vector<size_t> pixels;
  if (contrast_of_white < kMinContrast) return pixels;
  const auto seen = [&](int x, int y) {
    const size_t at = static_cast<size_t>(y) * width + x;
    return above[at] >= kSeen * contrast_of_white;
  };
  for (int y = kRim_px; y < height - kRim_px; ++y) {
    for (int x = kRim_px; x < width - kRim_px; ++x) {
      if (seen(x, y) && seen(x - kRim_px, y) && seen(x + kRim_px, y) && seen(x, y - kRim_px) &&
          seen(x, y + kRim_px)) {
        pixels.push_back(static_cast<size_t>(y) * width + x);
      }
    }
  }
  return pixels;
}

SampledMonitor sampled(const MappedArchive& archive, const std::string& name, const FrameIndex& frames,
                       const std::vector<size_t>& pixels, size_t every) {
  const int width = archive.manifest().camera().width_px(), height = archive.manifest().camera().height_px();
  SampledMonitor monitor{.name = name,
                         .radius2 = {},
                         .frames = std::vector<std::array<SampledMonitor::Takes, 3>>(frames.size())};
  const double corner2 = 0.25 * (1.0 * width * width + 1.0 * height * height);
  for (size_t i = 0; i < pixels.size(); i += every) {
    const double x = static_cast<double>(pixels[i] % static_cast<size_t>(width)) + 0.5 - 0.5 * width;
    const double y = static_cast<double>(pixels[i] / static_cast<size_t>(width)) + 0.5 - 0.5 * height;
    monitor.radius2.push_back((x * x + y * y) / corner2);
  }
  for (size_t j = 0; j < frames.size(); ++j) {
    for (const Shown shown : kAllShown) {
      const auto kind = static_cast<size_t>(shown);
      for (const int frame : frames[j][kind]) {
        const auto samples = archive.rows(frame, 0, height);
        std::vector<std::uint16_t>& take = monitor.frames[j][kind].emplace_back();
        take.reserve(monitor.sample_count());
        for (size_t i = 0; i < pixels.size(); i += every) {
          for (size_t c = 0; c < 3; ++c) take.push_back(samples[3 * pixels[i] + c]);
        }
      }
    }
  }
  return monitor;
}

}  // namespace

absl::StatusOr<CalibrationSamples> sample_calibration(const MappedArchive& archive) {
  const v1::CaptureManifest& manifest = archive.manifest();
  if (!manifest.plan().has_calibration() || manifest.plan().calibration().of() != "camera") {
    return absl::FailedPreconditionError(
        fmt::format("session {} was not captured to calibrate a camera; use `glasswing calibrate camera`",
                    manifest.session()));
  }
  std::vector<double> planned(manifest.plan().exposure_ms().begin(), manifest.plan().exposure_ms().end());
  std::ranges::sort(planned);
  planned.erase(std::unique(planned.begin(), planned.end()), planned.end());
  if (planned.size() < 2) {
    return absl::FailedPreconditionError(fmt::format(
        "session {} has {} exposure; a camera's response needs several", manifest.session(), planned.size()));
  }
  std::vector<int> order(manifest.frames_size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
  std::ranges::stable_sort(order, {}, [&](int i) { return manifest.frames(i).step(); });

  CalibrationSamples out;
  std::vector<double> sum(planned.size()), count(planned.size());
  std::map<std::string, FrameIndex> monitors;
  for (const int i : order) {
    const v1::Frame& frame = manifest.frames(i);
    const auto nearest =
        std::ranges::min_element(planned, {}, [&](double ms) { return std::abs(ms - frame.exposure_ms()); });
    const size_t j = nearest - planned.begin();
    sum[j] += frame.exposure_ms(), count[j] += 1.0;
    FrameIndex& frames = monitors[frame.stimulus().panel()];
    frames.resize(planned.size());
    frames[j][static_cast<size_t>(shown_by(frame.stimulus()))].push_back(i);
  }
  for (size_t j = 0; j < planned.size(); ++j) out.exposures_ms.push_back(sum[j] / count[j]);
  std::map<std::string, std::vector<size_t>> pixels;
  size_t all = 0;
  for (const auto& [name, frames] : monitors) {
    for (size_t j = 0; j < planned.size(); ++j) {
      if (std::ranges::all_of(frames[j], [](const auto& takes) { return takes.size() >= 2; })) continue;
      return absl::FailedPreconditionError(
          fmt::format("session {} lacks frames of monitor \"{}\" at {} ms; it needs two takes or more of "
                      "stripe, black and white",
                      manifest.session(), name, planned[j]));
    }
    std::vector<size_t> seeing = seeing_pixels(archive, frames);
    if (seeing.size() < kMinSeeingPixels) {
      out.unseen.push_back(name);
      continue;
    }
    all += seeing.size();
    pixels[name] = std::move(seeing);
  }
  if (pixels.empty()) {
    return absl::FailedPreconditionError(
        fmt::format("the camera sees no monitor: fewer than {} pixels of any get brighter by {} of full "
                    "scale from black to white at any exposure; point it at one, or take longer exposures",
                    kMinSeeingPixels, kMinContrast));
  }
  const size_t every = (all + kMaxPixels - 1) / kMaxPixels;
  for (const auto& [name, seeing] : pixels)
    out.monitors.push_back(sampled(archive, name, monitors[name], seeing, every));
  return out;
}

}  // namespace glasswing
