// The interface between reading frames and turning them into a matte.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/image/mosaic.h"
#include "core/matte/matte.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing {

struct FrameCorrections;  // solver/method/frame_correction.h
struct StageMaps;         // solver/background/stage_maps.h

// Samples from this code on are saturated: 0.9995 of full scale.
inline constexpr std::uint16_t kSaturatedCode = 65502;

// Channels [first, last) of a pixel, to be looped over.
struct ChannelRange {
  int first = 0, last = kChannels;

  int size() const { return last - first; }
  struct Iterator {
    int channel;
    int operator*() const { return channel; }
    Iterator& operator++() {
      ++channel;
      return *this;
    }
    bool operator==(const Iterator&) const = default;
  };
  Iterator begin() const { return {first}; }
  Iterator end() const { return {last}; }
};

// Some rows of the frames that a method needs. `owner` keeps the samples alive: buffers received from a node,
// or mapped files.
struct FrameStack {
  int width_px = 0;
  int first_row = 0;
  int row_count = 0;
  // By index in manifest.frames: r, g, b for each pixel of the rows, or what a mosaic's photosites measured.
  // Empty for frames that are not needed.
  std::vector<std::span<const std::uint16_t>> rows;
  std::shared_ptr<const void> owner;
  // Radiance = (sample - zero) * unit.
  float zero = 0.0f, unit = 1.0f / 65535.0f;
  float full = INFINITY;  // the light of what is saturated, where codes reach beyond
  // The camera clips noise below this light, so samples at this value are upper bounds.
  float cut_off = 0.0f;
  // By index in manifest.frames and channel: the brightness of its monitor relative to the session's first
  // white (brightness_drift.h). Empty: constant.
  std::vector<std::array<float, 3>> brightness = {};
  // Of the whole session; the frames before those of `rows` from which ghosts come are also in `rows`. Null:
  // nothing is corrected.
  std::shared_ptr<const FrameCorrections> corrections = nullptr;
  // Of the whole session. Null: not measured.
  std::shared_ptr<const StageMaps> stage_maps = nullptr;
  int column_step = 1;  // the stack's columns are every so-manyth of the picture's; odd
  std::optional<Mosaic> mosaic = std::nullopt;  // of the camera

  int samples_per_pixel() const { return mosaic ? 1 : kChannels; }
  // The measurements of a pixel.
  ChannelRange channels(int x, int y) const {
    if (!mosaic) return {};
    const int own = mosaic->channel(x * column_step, first_row + y);
    return {.first = own, .last = own + 1};
  }
  // Index into `rows` of a frame, of a channel that was measured.
  size_t sample_index(int x, int y, int channel) const {
    const size_t pixel = static_cast<size_t>(y) * width_px + x;
    return mosaic ? pixel : pixel * kChannels + static_cast<size_t>(channel);
  }
  // The channel of a sample, by index into `rows`.
  int channel_at(size_t index) const {
    if (!mosaic) return static_cast<int>(index % kChannels);
    const size_t width = width_px;
    return channels(static_cast<int>(index % width), static_cast<int>(index / width)).first;
  }
  float radiance(std::uint16_t sample) const { return (static_cast<float>(sample) - zero) * unit; }
  float light(std::uint16_t sample) const {
    return sample >= kSaturatedCode ? std::min(radiance(sample), full) : radiance(sample);
  }
  // Radiance; x counts from the left, y from first_row.
  float at(int frame, int x, int y, int channel) const {
    return light(rows[frame][sample_index(x, y, channel)]);
  }
};

// INVALID_ARGUMENT names a needed frame whose sample count is not that of the stack's rows.
absl::Status check_rows(const FrameStack& stack, const v1::CaptureManifest& manifest,
                        const std::vector<int>& needed);

using MethodOptions = std::map<std::string, std::string>;

// The metadata that all tiles of a matte share.
v1::MatteMetadata metadata_of(const v1::CaptureManifest& manifest, const std::string& method,
                              const MethodOptions& options);

// A matte of the stack's rows whose pixels are still blank.
Matte blank_matte(const FrameStack& stack, const v1::MatteMetadata& metadata, int modes_per_channel);

// A method laid out for one archive. Thread-safe: bands of rows are solved in parallel.
class PreparedMethod {
 public:
  virtual ~PreparedMethod() = default;
  // The frames to read: indices in manifest.frames, never a reference frame.
  virtual const std::vector<int>& frames_needed() const = 0;
  // The matte of these rows, whose samples are light (linear_stack.h) and have passed check_rows(). Each
  // pixel depends on samples of its own row, and on what was measured of the whole session (FrameStack's
  // brightness and stage_maps), so tiles join without seams.
  virtual absl::StatusOr<Matte> solve(const FrameStack& rows) const = 0;
};

class Method {
 public:
  virtual ~Method() = default;
  // Whether prepared methods solve stacks of a mosaic: each photosite for its own channel. If not, they
  // receive its frames interpolated.
  virtual bool solves_mosaics() const { return false; }
  // `manifest` carries the noise of light (LinearStack::manifest_of_light); the result keeps no reference to
  // it. FAILED_PRECONDITION says what the archive lacks.
  virtual absl::StatusOr<std::unique_ptr<PreparedMethod>> prepare(
      const v1::CaptureManifest& manifest) const = 0;
};

}  // namespace glasswing
