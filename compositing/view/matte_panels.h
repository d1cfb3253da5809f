// A matte's quantities as pictures: one panel each, with a legend.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/matte/matte.h"

namespace glasswing {

using CodeImage = Image<std::uint8_t>;  // sRGB codes

// A legend's entry: a colour, or a chart of a monitor's positions, and its name.
struct PanelKey {
  CodeImage colours;
  std::string name;
};

// Runs from low (left) to high. Ticks are in the quantity's unit, at positions 0 to 1.
struct ColourBar {
  struct Tick {
    double place;
    std::string label;
  };
  CodeImage colours;  // one row
  std::vector<Tick> ticks;
};

struct MattePanel {
  std::string name;   // for a command line: "sigma"
  std::string title;  // human-readable
  CodeImage picture;  // of the matte's size
  std::vector<PanelKey> keys;
  std::optional<ColourBar> bar;
};

inline constexpr std::array<const char*, 9> kPanelNames{
    "preview", "foreground", "coverage", "modes", "shape", "centre", "sigma", "uncertainty", "flags"};

// In the order of kPanelNames. centre, sigma and uncertainty show the strongest modes of `channel`. Ranges
// are those of the object's pixels, or of all pixels if there is no object. Missing values and values that
// are not finite have the colour kNoValue.
std::vector<MattePanel> panels_of(const Matte& matte, int channel);

inline constexpr std::array<std::uint8_t, 3> kNoValue{214, 214, 214};

}  // namespace glasswing
