// The id patch: a strip below the pattern that encodes the id of a showing, so that a camera frame can prove
// which picture it shows.
//
// The strip has sixteen columns of two cells. The upper cell of column b is lit if bit b of the id is 1, the
// lower one if it is 0: every column has one lit cell for any id, so the strip's light hardly changes, and a
// bit is read by comparing its two cells.
//
// The positions of the cells in the camera's picture are learned, not calibrated: ten ids are shown that give
// every cell a distinct sequence, and each camera pixel with the sequence of a cell belongs to it. An object
// may hide or bend some cells: a bit is read from either of its cells, and kMinBits bits are enough.
//
// The ids come in pairs of complements, in which every cell is lit once. So the light of a pair is the same
// for all pairs, in any mixture of cells: a pixel for which it is not shows that the pictures changed at
// other times or in another order than assumed.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/image/image.h"

namespace glasswing {

struct IdPatch {
  static constexpr int kBits = 16;
  // Of the ids of eight showings in a row, no two agree in that many bits, whichever they are.
  static constexpr int kMinBits = 12;
  static constexpr int kMinWidth_px = 32;
  static constexpr int kMinRows = 4;
  int width_px = 0;  // of the monitor
  int first_row = 0;
  int rows = 0;

  // Draws the strip of an id, radiance 0 and 1, over the picture. Cells are separated by a quarter of their
  // size.
  void draw(std::uint16_t id, RadianceImage& picture) const;
};

// The ids shown to learn the positions of the cells, in order.
std::span<const std::uint16_t> patch_learning_ids();

class PatchReader {
 public:
  // `frames`: one per learning id, all of the same size. NOT_FOUND: no pixel changes. FAILED_PRECONDITION:
  // fewer than kMinBits bits are visible. OUT_OF_RANGE: pixels change, but not as these ids in this order do.
  static absl::StatusOr<PatchReader> learn(std::span<const Image16> frames);

  // The visible bits of the id in a frame of that size, the others 0; none if one is doubtful, such as of a
  // frame exposed while the picture changed.
  std::optional<std::uint16_t> read(const Image16& frame) const;
  // Which bits are visible.
  std::uint16_t bits() const;

 private:
  struct Pixel {
    size_t at = 0;  // index of its first sample
    float dark = 0.0f, lit = 0.0f;
  };
  static constexpr int kCells = 2 * IdPatch::kBits;
  static void keep_strongest(std::vector<Pixel>& pixels);
  bool sees(int cell) const { return !cells_[cell].empty(); }
  // The level of a cell that is seen, from dark (-1) to lit (1).
  double level(int cell, const Image16& frame) const;
  // Whether a bit is 1; none: doubtful. Requires that one of its cells is seen.
  std::optional<bool> read_bit(int bit, const Image16& frame) const;

  size_t sample_count_ = 0;
  std::array<std::vector<Pixel>, kCells> cells_;  // by cell: 2b is bit b's upper cell, 2b + 1 the lower
};

// Whether some pixel differs, by as much as a patch must to be seen. Frames of the same size.
bool differs(const Image16& frame, const Image16& other);

}  // namespace glasswing
