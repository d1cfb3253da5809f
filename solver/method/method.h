// The seam between getting frames and turning them into a matte.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/import/mapped_archive.h"
#include "core/matte/matte.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing {

inline constexpr std::uint16_t kSaturatedCode =
    65502;  // 0.9995 of full scale; samples from it on say nothing

// Some rows of the frames that a method asked for. The pixels belong to `owner`: buffers read from a node, or
// mapped files.
struct FrameStack {
  v1::CaptureManifest manifest;
  int first_row = 0;
  int row_count = 0;
  // By place in manifest.frames: r, g, b for each pixel of the rows. Empty if it was not asked for.
  std::vector<std::span<const std::uint16_t>> rows;
  std::shared_ptr<const void> owner;
  // Radiance = (sample - zero) * unit.
  float zero = 0.0f, unit = 1.0f / 65535.0f;
  // By place in manifest.frames: how bright its monitor was, relative to the session's first white (drift.h).
  // Empty: always the same.
  std::vector<float> brightness = {};

  size_t place(int x, int y, int channel) const {
    const auto width = static_cast<size_t>(manifest.camera().width_px());
    return (static_cast<size_t>(y) * width + static_cast<size_t>(x)) * 3 + static_cast<size_t>(channel);
  }
  float radiance(std::uint16_t sample) const { return (static_cast<float>(sample) - zero) * unit; }
  // Radiance; x from the left, y from first_row.
  float at(int frame, int x, int y, int channel) const {
    return radiance(rows[static_cast<size_t>(frame)][place(x, y, channel)]);
  }
};

// All rows of all frames, and the drift of the monitors (drift.h); the mappings last as long as the stack.
absl::StatusOr<FrameStack> whole_stack(std::shared_ptr<const MappedArchive> archive);

// INVALID_ARGUMENT names a frame that is needed and has not the samples of the stack's rows.
absl::Status check_rows(const FrameStack& stack, const std::vector<int>& needed);

using MethodOptions = std::map<std::string, std::string>;

// A method's option as a number. INVALID_ARGUMENT: it is none, or outside [low, high].
absl::StatusOr<double> number_option(const std::string& key, const std::string& value, double low,
                                     double high);

// A matte of the stack's rows, all of it but pixels and footprints filled in.
Matte blank_matte(const FrameStack& stack, const std::string& method, const MethodOptions& options,
                  int modes_per_channel);

class Method {
 public:
  virtual ~Method() = default;
  // Which frames it reads: places in manifest.frames. Never a reference. FAILED_PRECONDITION says what the
  // archive lacks.
  virtual absl::StatusOr<std::vector<int>> frames_needed(const v1::CaptureManifest& manifest) const = 0;
  // The matte of those rows, whose samples are light (linear_stack.h). Each pixel depends on samples of its
  // own row only, so tiles join without seams.
  virtual absl::StatusOr<Matte> solve(const FrameStack& stack) const = 0;
};

}  // namespace glasswing
