#include "solver/frames/session_samples.h"

#include <algorithm>
#include <cmath>

#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr int kMaxRows = 48, kMaxColumns = 128;

// `count` places in [0, length), of both parities where `alternate` says so.
std::vector<int> places(int length, int max_count, bool alternate) {
  const int count = std::min(length, max_count);
  std::vector<int> places;
  for (int i = 0; i < count; ++i) {
    const int middle = (2 * i + 1) * length / (2 * count);
    places.push_back(alternate ? std::min(middle / 2 * 2 + i % 2, length - 1) : middle);
  }
  return places;
}

}  // namespace

absl::StatusOr<SessionSamples> sample_frames(const v1::CaptureManifest& manifest,
                                             const std::vector<int>& frames, const LightReader& read) {
  SessionSamples samples;
  samples.light.resize(manifest.frames_size());
  samples.middle_x_px = 0.5 * (manifest.camera().width_px() - 1);
  samples.middle_y_px = 0.5 * (manifest.camera().height_px() - 1);
  const bool mosaic = !manifest.camera().mosaic().empty();
  const std::vector<int> columns = places(manifest.camera().width_px(), kMaxColumns, mosaic);
  for (const int y : places(manifest.camera().height_px(), kMaxRows, mosaic)) {
    GW_ASSIGN_OR_RETURN(const FrameStack row, read(y, frames));
    samples.lanes_per_pixel = row.samples_per_pixel();
    for (const int x : columns) {
      samples.pixels.push_back({.x = x, .y = y});
      for (const int c : row.channels(x, 0)) {
        samples.channel.push_back(c);
        const size_t at = row.sample_index(x, 0, c);
        for (const int frame : frames) {
          const std::uint16_t code = row.rows[frame][at];
          samples.light[frame].push_back(code >= kSaturatedCode ? NAN : row.radiance(code));
        }
      }
    }
  }
  return samples;
}

}  // namespace glasswing
