#include "core/axis/board.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "core/axis/axis_fit.h"
#include "core/axis/axis_module.h"
#include "core/base/scanner.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

// OpenCV's numbers of its dictionaries, and how many markers each has.
struct Dictionary {
  std::string_view name;
  int number, markers;
};
constexpr std::array<Dictionary, 16> kDictionaries{{{"4x4_50", 0, 50},
                                                    {"4x4_100", 1, 100},
                                                    {"4x4_250", 2, 250},
                                                    {"4x4_1000", 3, 1000},
                                                    {"5x5_50", 4, 50},
                                                    {"5x5_100", 5, 100},
                                                    {"5x5_250", 6, 250},
                                                    {"5x5_1000", 7, 1000},
                                                    {"6x6_50", 8, 50},
                                                    {"6x6_100", 9, 100},
                                                    {"6x6_250", 10, 250},
                                                    {"6x6_1000", 11, 1000},
                                                    {"7x7_50", 12, 50},
                                                    {"7x7_100", 13, 100},
                                                    {"7x7_250", 14, 250},
                                                    {"7x7_1000", 15, 1000}}};
constexpr int kMinSquares = 3, kMaxSquares = 60;
constexpr double kMaxSquare_mm = 1000.0;

}  // namespace

std::string dictionary_names() {
  std::vector<std::string_view> names;
  for (const Dictionary& dictionary : kDictionaries) names.push_back(dictionary.name);
  return fmt::format("{}", fmt::join(names, ", "));
}

absl::StatusOr<Board> parse_board(std::string_view option, std::string_view text,
                                  std::string_view dictionary) {
  Board board;
  Scanner scan(text);
  scan.number(board.columns).then("x").number(board.rows).then(":").number(board.square_mm);
  scan.then(":").number(board.marker_mm);
  if (scan.more()) scan.then(":").number(board.count);
  const auto squares = [](int count) { return count >= kMinSquares && count <= kMaxSquares; };
  if (!scan.done() || !squares(board.columns) || !squares(board.rows) ||
      !(board.square_mm <= kMaxSquare_mm) || !(board.marker_mm > 0.0 && board.marker_mm < board.square_mm) ||
      board.count < 1 || board.count > kMaxAxisBoards) {
    return absl::InvalidArgumentError(fmt::format(
        "{} is \"{}\"; it must be COLUMNSxROWS:SQUARE_MM:MARKER_MM, {} to {} squares across and down, "
        "markers "
        "smaller than squares, such as 7x5:8:6, or with :COUNT, 1 to {} boards, such as 7x5:8:6:4",
        option, text, kMinSquares, kMaxSquares, kMaxAxisBoards));
  }
  const auto found = std::ranges::find(kDictionaries, dictionary, &Dictionary::name);
  if (found == kDictionaries.end()) {
    return absl::InvalidArgumentError(
        fmt::format("the dictionary is \"{}\"; there are: {}", dictionary, dictionary_names()));
  }
  if (const int needed = board.count * board.markers(); needed > found->markers) {
    return absl::InvalidArgumentError(fmt::format("{} is {}, which needs {} markers; dictionary {} has {}",
                                                  option, text, needed, dictionary, found->markers));
  }
  board.dictionary = found->number;
  return board;
}

absl::StatusOr<std::vector<BoardCorner>> find_corners(const Board& board, const RadianceImage& picture) {
  GW_ASSIGN_OR_RETURN(const AxisModule* const module, axis_module());
  const size_t pixels = static_cast<size_t>(picture.width_px) * picture.height_px;
  std::vector<float> light(pixels);
  for (size_t i = 0; i < picture.samples.size(); ++i) light[i / picture.channels] += picture.samples[i];
  // White is what a hundredth of the picture exceeds.
  std::vector<float> sorted = light;
  const auto white = sorted.begin() + static_cast<std::ptrdiff_t>(pixels - 1 - pixels / 100);
  std::ranges::nth_element(sorted, white);
  if (!(*white > 0.0f)) return std::vector<BoardCorner>();
  std::vector<std::uint8_t> grey(pixels);
  std::ranges::transform(light, grey.begin(), [scale = 255.0f / *white](float value) {
    return static_cast<std::uint8_t>(std::clamp(value * scale + 0.5f, 0.0f, 255.0f));
  });
  return module->find_corners(board, picture.width_px, picture.height_px, grey);
}

}  // namespace glasswing
