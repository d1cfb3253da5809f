// What the monitor showed in each photograph of a folder, by the order in which programs show their
// patterns. With t = x for columns and y for rows, in monitor px, from 0 to `side`:
//
//   opencv-graycode  bit b of the Gray code n ^ (n >> 1) of cell n = floor(t / cell): lit from 2^b to
//                    3 2^b cells, and so every 4 2^b cells
//   binary           bit b of n: lit from 2^b to 2 2^b cells, and so every 2 2^b cells
//   phase-shift      (1 + cos(2 pi (t / period - step / steps) - phase)) / 2, all steps of a period together
//
// Bits go from ceil(log2(side / cell)) - 1 down to 0, periods in the given order. The Gray code and its order
// are those of OpenCV's GrayCodePattern. Bars and fringes may follow one another; a complementary Gray code
// has cells of half a period.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>
#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

enum class PatternCode { kGray, kBinary, kPhaseShift };
// Columns are vertical bars or fringes, across x. In a layout that also has bars, fringes are separate
// blocks.
enum class LayoutBlock { kColumns, kRows, kWhite, kBlack, kFringeColumns, kFringeRows };
enum class Complements { kNone, kAfter, kBefore };  // each after or before its pattern

// One period of fringes: their number along a side, or a length.
struct FringePeriod {
  double value = 0.0;
  bool in_px = false;
  double px(int side_px) const { return in_px ? value : side_px / value; }
};

struct PhotographLayout {
  PatternCode code = PatternCode::kGray;
  std::vector<LayoutBlock> order;
  Complements complements = Complements::kNone;
  double cell_px = 1.0;               // of a code of bars
  int steps = 0;                      // of fringes
  std::vector<FringePeriod> periods;  // of fringes, along either side
  bool backward = false;              // fringes move towards smaller x and y from step to step
  double phase_deg = 0.0;             // of the first step
};

bool is_fringe(LayoutBlock block);
// Columns and rows of phase-shift are fringes too.
bool has_fringes(const PhotographLayout& layout, LayoutBlock block);
bool is_solid(LayoutBlock block);
// 0: along x; 1: along y. For blocks other than solids.
size_t axis_of(LayoutBlock block);

// The command line's options, as typed.
struct LayoutOptions {
  std::string layout{};  // "auto" too; empty: none
  std::optional<std::string> order{}, inverse{}, periods{}, shift{};
  std::optional<int> steps{};
  std::optional<double> cell_px{}, phase_deg{};
};

inline constexpr const char* kLayoutNames = "opencv-graycode, binary, phase-shift or auto";

// A layout other than auto. INVALID_ARGUMENT names the option, its value and what is accepted.
absl::StatusOr<PhotographLayout> layout_of(const LayoutOptions& options);
// --periods and --shift. INVALID_ARGUMENT as above.
absl::StatusOr<std::vector<FringePeriod>> periods_of(const std::string& text);
absl::StatusOr<bool> is_backward(const std::string& text);

// The equivalent options for this layout: "--layout binary --order rows,columns --inverse none".
std::string options_of(const PhotographLayout& layout);

// The bits of a code of this many cells.
int bits_of(double cells);

// The number of photographs in a block.
int count_of(const PhotographLayout& layout, LayoutBlock block, const v1::Monitor& monitor);

// Frames of an object, one for each of these files, in their order. INVALID_ARGUMENT: there are more or fewer
// files than the layout has patterns; the message lists the patterns by block.
absl::StatusOr<std::vector<v1::Frame>> frames_of(const PhotographLayout& layout, const v1::Monitor& monitor,
                                                 const std::vector<std::string>& files);

}  // namespace glasswing
