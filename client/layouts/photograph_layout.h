// What the monitor showed in each photograph of a folder, by the order in which programs show their
// patterns. With t = x for columns and y for rows, in monitor px, from 0 to `side`:
//
//   opencv-graycode  bit b of the Gray code t ^ (t >> 1): lit from 2^b to 3 2^b px, and so every 4 2^b px
//   binary           bit b of t: lit from 2^b to 2 2^b px, and so every 2 2^b px
//   phase-shift      (1 + cos(2 pi (t / period - step / steps))) / 2, all steps of a period together
//
// Bits go from ceil(log2(side)) - 1 down to 0, periods as they are given. The Gray code and its order are
// those of OpenCV's GrayCodePattern.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

enum class PatternCode { kGray, kBinary, kPhaseShift };
enum class LayoutBlock { kColumns, kRows, kWhite, kBlack };  // columns are vertical bars, across x
enum class Complements { kNone, kAfter, kBefore };           // each after or before its pattern

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
  int steps = 0;                      // of phase-shift
  std::vector<FringePeriod> periods;  // of phase-shift, along either side
  bool backward = false;              // fringes move towards smaller x and y from step to step
};

// The command line's options, as they were typed.
struct LayoutOptions {
  std::string layout{};  // "auto" too; empty: none
  std::optional<std::string> order{}, inverse{}, periods{}, shift{};
  std::optional<int> steps{};
};

inline constexpr const char* kLayoutNames = "opencv-graycode, binary, phase-shift or auto";

// A layout other than auto. INVALID_ARGUMENT names the option, its value and what is accepted.
absl::StatusOr<PhotographLayout> layout_of(const LayoutOptions& options);
// --periods and --shift. INVALID_ARGUMENT as above.
absl::StatusOr<std::vector<FringePeriod>> periods_of(const std::string& text);
absl::StatusOr<bool> is_backward(const std::string& text);

// The options that stand for this layout: "--layout binary --order rows,columns --inverse none".
std::string options_of(const PhotographLayout& layout);

// How many photographs a block has. `side_px`: the monitor's width for columns, its height for rows.
int count_of(const PhotographLayout& layout, LayoutBlock block, const v1::Monitor& monitor);

// Frames of an object, one for each of these files, in their order. INVALID_ARGUMENT: there are more or fewer
// files than the layout has patterns; it tells the patterns by block.
absl::StatusOr<std::vector<v1::Frame>> frames_of(const PhotographLayout& layout, const v1::Monitor& monitor,
                                                 const std::vector<std::string>& files);

// Pictures (PNG, JPEG, TIFF) in `directory`, or with a glob those of it and the folders below it whose path
// from there fits it (`*` fits `/` too). In natural order, numbers by value: 2.png before 10.png. NOT_FOUND:
// no picture. INVALID_ARGUMENT: more than kMaxPhotographs.
inline constexpr size_t kMaxPhotographs = 512;
absl::StatusOr<std::vector<std::string>> photographs_in(const std::filesystem::path& directory,
                                                        const std::string& glob);

// Natural order: digits compare as numbers, all else byte by byte.
bool natural_less(const std::string& a, const std::string& b);

}  // namespace glasswing
