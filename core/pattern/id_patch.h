// The id patch: a strip below the pattern whose pixels say which showing a picture is of, so that a camera
// frame can prove it.
//
// A strip has sixteen columns of two cells. The upper cell of column b is lit where bit b of the id is 1, the
// lower one where it is 0: every column has one lit cell, whatever the id, so the strip's light hardly
// changes, and a bit is read by which of its two cells is the brighter.
//
// Where a camera sees the cells is learned, not calibrated: ten ids are shown, under which every cell goes
// through a sequence of its own, and each camera pixel that goes through the sequence of a cell belongs to
// it.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/frame/image.h"

namespace glasswing {

struct IdPatch {
  static constexpr int kBits = 16;
  static constexpr int kMinWidth_px = 32;
  static constexpr int kMinRows = 4;
  int width_px = 0;  // of the monitor
  int first_row = 0;
  int rows = 0;

  // Draws the strip of an id, radiance 0 and 1, over what the picture has there. Cells stand apart by a
  // quarter of their size.
  void draw(std::uint16_t id, RadianceImage& picture) const;
};

// What is shown to learn where the cells are, in order.
std::span<const std::uint16_t> patch_learning_ids();

class PatchReader {
 public:
  // `frames`: one of each learning id, of the same size. NOT_FOUND: they are all alike. FAILED_PRECONDITION:
  // some column is seen nowhere.
  static absl::StatusOr<PatchReader> learn(std::span<const Image16> frames);

  // The id in a frame of that size. None where any bit is in doubt: hidden, or exposed while the picture
  // changed.
  std::optional<std::uint16_t> read(const Image16& frame) const;

 private:
  struct Pixel {
    size_t at = 0;  // of the red sample
    float dark = 0.0f, lit = 0.0f;
  };
  static constexpr int kCells = 2 * IdPatch::kBits;
  // Where a cell is between dark (-1) and lit (1).
  double level(int cell, const Image16& frame) const;

  size_t sample_count_ = 0;
  std::array<std::vector<Pixel>, kCells> cells_;  // bit b: 2b its cell, 2b + 1 its complement's
};

}  // namespace glasswing
