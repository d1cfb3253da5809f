#include "client/picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>

namespace glasswing {

absl::Status check_output(const std::filesystem::path& output) {
  static constexpr std::array<std::string_view, 4> kSuffixes = {".exr", ".png", ".tif", ".tiff"};
  if (std::find(kSuffixes.begin(), kSuffixes.end(), output.extension().string()) == kSuffixes.end()) {
    return absl::InvalidArgumentError(
        fmt::format("the output is {}; its name must end in .exr, .png, .tif or .tiff", output.string()));
  }
  std::error_code ignored;
  const std::filesystem::path directory = output.has_parent_path() ? output.parent_path() : ".";
  if (!std::filesystem::is_directory(directory, ignored)) {
    return absl::NotFoundError(
        fmt::format("the output is {}; there is no directory {}", output.string(), directory.string()));
  }
  return absl::OkStatus();
}

absl::StatusOr<RadianceImage> cropped(const RadianceImage& picture, const std::string& region) {
  if (region.empty()) return picture;
  int width = 0, height = 0, left = 0, top = 0, read = 0;
  const bool parsed =
      std::sscanf(region.c_str(), "%dx%d+%d+%d%n", &width, &height, &left, &top, &read) == 4 &&
      static_cast<size_t>(read) == region.size();
  const bool inside = parsed && width > 0 && height > 0 && left >= 0 && top >= 0 &&
                      left <= picture.width_px - width && top <= picture.height_px - height;
  if (!inside) {
    return absl::InvalidArgumentError(
        fmt::format("--crop is {}; it must be WIDTHxHEIGHT+X+Y and lie within the picture, which is {}x{}",
                    region, picture.width_px, picture.height_px));
  }
  RadianceImage part(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) part.at(x, y, c) = picture.at(left + x, top + y, c);
    }
  }
  return part;
}

}  // namespace glasswing
