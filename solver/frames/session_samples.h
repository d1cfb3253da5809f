// A sample of a session's pixels in all its frames: for the report of the frames (frame_report.h).
#pragma once

#include <absl/status/statusor.h>

#include <utility>
#include <vector>

#include "solver/background/stage_maps.h"

namespace glasswing {

// A lane is one channel of one pixel.
struct SessionSamples {
  struct Pixel {
    int x = 0, y = 0;
  };
  std::vector<Pixel> pixels;
  double middle_x_px = 0.0, middle_y_px = 0.0;  // of the picture, as a pixel's place
  int lanes_per_pixel = kChannels;              // 1: of a mosaic
  std::vector<int> channel;                     // by lane
  // By frame of the manifest and lane: light, NaN where saturated. Empty: not read.
  std::vector<std::vector<float>> light;

  size_t lane_count() const { return channel.size(); }
  size_t pixel_of(size_t lane) const { return lane / static_cast<size_t>(lanes_per_pixel); }
};

// Samples these frames evenly over the picture, at most 48 rows of 128 pixels.
class FrameSampler {
 public:
  FrameSampler(const v1::CaptureManifest& manifest, std::vector<int> frames);

  // Reads its rows before `end_row` that it has not read. Errors are those of `read`.
  absl::Status read_to(int end_row, const LightReader& read);
  // The samples, once all rows are read.
  SessionSamples take() && { return std::move(samples_); }

 private:
  std::vector<int> frames_, columns_, rows_;
  size_t rows_read_ = 0;
  SessionSamples samples_;
};

// Of the whole picture.
absl::StatusOr<SessionSamples> sample_frames(const v1::CaptureManifest& manifest,
                                             const std::vector<int>& frames, const LightReader& read);

}  // namespace glasswing
