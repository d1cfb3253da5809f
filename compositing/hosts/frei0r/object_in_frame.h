// A matte's object in frames of 8-bit sRGB, as video editors have them.
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/composite/fast_compositor.h"
#include "core/image/image.h"

namespace glasswing {

// Where the matte's picture is in the frame, and what is behind the object.
struct Placement {
  // Of the picture's centre, as fractions of the frame's width and height from its top left.
  double x = 0.5, y = 0.5;
  double size = 1.0;  // of the picture; 1: the largest that fits the frame
  // True: the camera's whole picture, with the frame stretched over the monitor, as `glasswing composite`
  // makes it. False: only the object, with the frame continuing behind it; the monitor's position in the
  // camera's picture is found from what is seen of it beside the object.
  bool whole_picture = false;
  std::string monitor = {};  // the one that the frame is on, others are black; empty: the first
};

// 2x3: x' = A (x, y, 1).
using AffineMap = Eigen::Matrix<double, 2, 3>;

class ObjectInFrame {
 public:
  // Reads a matte's file and prepares it, which takes the time of some dozen composites. Errors name the
  // file.
  static absl::StatusOr<ObjectInFrame> open(const std::filesystem::path& file);

  // `frame`, `out`: width x height pixels of r, g, b, a. Alpha and everything outside the picture are copied;
  // a frame's pixel under a part of the object's edge is blended in linear light. Thread-safe.
  // INVALID_ARGUMENT: the matte has no such monitor, or the size or position is out of range.
  absl::Status composite(const Placement& placement, int width_px, int height_px,
                         std::span<const std::uint8_t> frame, std::span<std::uint8_t> out) const;

  // For each monitor: from px of the camera's picture to px of the monitor, both from the outer corner of the
  // top-left pixel, fitted to pixels that the object does not cover. Empty: fewer than 16 of them see it.
  const std::vector<std::optional<AffineMap>>& monitor_views() const { return views_; }

 private:
  ObjectInFrame(FastCompositor compositor, v1::MatteMetadata metadata, RadianceImage coverage,
                std::vector<std::optional<AffineMap>> views)
      : compositor_(std::move(compositor)),
        metadata_(std::move(metadata)),
        coverage_(std::move(coverage)),
        views_(std::move(views)) {}

  FastCompositor compositor_;
  v1::MatteMetadata metadata_;
  RadianceImage coverage_;  // one channel
  std::vector<std::optional<AffineMap>> views_;
};

}  // namespace glasswing
