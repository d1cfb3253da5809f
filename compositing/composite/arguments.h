// The options of `glasswing composite`.
#pragma once

#include <string>
#include <vector>

#include "compositing/colour/picture_colours.h"
#include "core/image/image_file.h"

namespace glasswing {

// The command line's options about backgrounds; each entry is "[TEXTURE=]VALUE".
struct BackgroundArguments {
  std::vector<std::string> pictures, matches;
  // DX,DY, monitor px right and down: of the first picture, and from each picture to the next.
  std::vector<std::string> shifts, pans;
  bool wraps = false;  // a shifted picture begins anew beyond its edges
};

struct CompositeArguments {
  std::string matte;  // a file, or a directory
  BackgroundArguments backgrounds;
  ColourArguments colours;
  std::string output;
  std::string format = "exr";
  int bits = 0;         // as for write_radiance()
  int frame_count = 0;  // for one matte; 0: as many as its backgrounds have
  double frame_rate_hz = 30.0;
  float foreground_gain = 1.0f;
  std::string crop;
  std::string error;  // a picture of the composite's standard error; empty: none
  bool linear = false, exact = false;
  bool fill = false;    // pixels that are not solved, from their neighbours
  bool object = false;  // the object alone, with its coverage as alpha
  std::string from;     // the monitor as whose picture it is made; empty: the camera's
  // For files of rays (composite_rays.h).
  std::vector<std::string> planes;
  std::string environment;
  double environment_turn_deg = 0.0;
  float environment_gain = 1.0f;
  bool lossless = false;

  Encoding encoding() const { return linear ? Encoding::kLinear : Encoding::kDisplay; }
};

}  // namespace glasswing
