// What a matte holds, as pictures: one panel a quantity, with what its colours mean.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/frame/image.h"
#include "core/matte/matte.h"

namespace glasswing {

using CodeImage = Image<std::uint8_t>;  // sRGB codes

// A colour, or the colours of a monitor's places, and its name.
struct PanelKey {
  CodeImage colours;
  std::string name;
};

// From low (left) to high; ticks in the quantity's unit, at 0 to 1 of the bar.
struct ColourBar {
  struct Tick {
    double place;
    std::string label;
  };
  CodeImage colours;  // one line
  std::vector<Tick> ticks;
};

struct MattePanel {
  std::string name;   // for a command line: "sigma"
  std::string title;  // for people
  CodeImage picture;  // a pixel for each of the matte's
  std::vector<PanelKey> keys;
  std::optional<ColourBar> bar;
};

inline constexpr std::array<const char*, 8> kPanelNames{"preview", "foreground", "coverage",    "modes",
                                                        "centre",  "sigma",      "uncertainty", "flags"};

// In the order of kPanelNames. `channel`: whose strongest modes centre, sigma and uncertainty are of. Ranges
// are those of the object's pixels, of all pixels where none shows the object. A value that is not finite, or
// not there, is kNoValue.
std::vector<MattePanel> panels_of(const Matte& matte, int channel);

inline constexpr std::array<std::uint8_t, 3> kNoValue{214, 214, 214};

}  // namespace glasswing
