// OpenEXR files of float planes, part by part: how mattes and maps of them are stored.
#pragma once

#include <absl/status/statusor.h>

#include <map>
#include <string>
#include <vector>

#include "core/matte/matte.h"

namespace glasswing {

inline constexpr int kQuickZip = 1, kSmallZip = 4;  // the latter is OpenEXR's own choice

// One channel of one part, such as "mode1.weight.R": its pixels, row by row.
struct ExrPlane {
  std::string name;
  std::vector<float> values;
};
struct ExrPart {
  std::string name;
  std::vector<ExrPlane> planes;
};

// get(x, y) of every pixel of a matte.
template <typename Get>
ExrPlane plane_of(const Matte& matte, std::string name, const Get& get) {
  ExrPlane plane{.name = std::move(name), .values = {}};
  plane.values.reserve(static_cast<size_t>(matte.width_px()) * static_cast<size_t>(matte.height_px()));
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) plane.values.push_back(get(x, y));
  }
  return plane;
}

// Scan lines, float32, ZIP. The data window is the matte's pixels, the display window the camera's picture;
// every part has the same string attributes. `zip_level`: 1, quick, to 9, small. Same input, same bytes.
// INTERNAL: OpenEXR refuses it.
absl::StatusOr<std::string> encode_exr(const std::vector<ExrPart>& parts, const Matte& matte,
                                       const std::map<std::string, std::string>& attributes,
                                       int zip_level = kSmallZip);

}  // namespace glasswing
