#include "solver/frames/session_samples.h"

#include <algorithm>
#include <cmath>

#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr int kMaxRows = 48, kMaxColumns = 128;

// `count` places in [0, length), of both parities if `alternate` is set.
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

FrameSampler::FrameSampler(const v1::CaptureManifest& manifest, std::vector<int> frames)
    : frames_(std::move(frames)) {
  const v1::Camera& camera = manifest.camera();
  const bool mosaic = !camera.mosaic().empty();
  columns_ = places(camera.width_px(), kMaxColumns, mosaic);
  rows_ = places(camera.height_px(), kMaxRows, mosaic);
  samples_.light.resize(manifest.frames_size());
  samples_.middle_x_px = 0.5 * (camera.width_px() - 1);
  samples_.middle_y_px = 0.5 * (camera.height_px() - 1);
}

absl::Status FrameSampler::read_to(int end_row, const LightReader& read) {
  for (; rows_read_ < rows_.size() && rows_[rows_read_] < end_row; ++rows_read_) {
    const int y = rows_[rows_read_];
    GW_ASSIGN_OR_RETURN(const FrameStack row, read(y, frames_));
    samples_.lanes_per_pixel = row.samples_per_pixel();
    for (const int x : columns_) {
      samples_.pixels.push_back({.x = x, .y = y});
      for (const int c : row.channels(x, 0)) {
        samples_.channel.push_back(c);
        const size_t at = row.sample_index(x, 0, c);
        for (const int frame : frames_) {
          const std::uint16_t code = row.rows[frame][at];
          samples_.light[frame].push_back(code >= kSaturatedCode ? NAN : row.radiance(code));
        }
      }
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<SessionSamples> sample_frames(const v1::CaptureManifest& manifest,
                                             const std::vector<int>& frames, const LightReader& read) {
  FrameSampler sampler(manifest, frames);
  GW_RETURN_IF_ERROR(sampler.read_to(manifest.camera().height_px(), read));
  return std::move(sampler).take();
}

}  // namespace glasswing
