// Reads OpenEXR pictures: the display window, black where the file has no data, of the layer that has the
// colours. That is the layer without a name (R, G, B, or Y), or the only one with R, G and B, or one named
// Combined, beauty, rgba or composite, of the first part that has one. Deep parts are skipped.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>

#include "core/image/image_file.h"

namespace glasswing {

// Colour attributes in headers.
inline constexpr const char* kOiioSpace = "oiio:ColorSpace";
inline constexpr const char* kInteropId = "colorInteropID";

// DATA_LOSS: damaged, or a display window of more than kMaxExr_px; or values are not finite, which it counts
// and locates. INVALID_ARGUMENT: no layer has colours, or several have; it names the channels or layers; or
// more parts or channels than exr_limits.h allows.
inline constexpr std::int64_t kMaxExr_px = std::int64_t{1} << 28;
absl::StatusOr<RadianceImage> read_open_exr(const std::filesystem::path& path);

// The colours according to the header of the part that is read; unknown if the file cannot be read.
PictureColour colour_of_open_exr(const std::filesystem::path& path);

// Which layer is read if it is not the first part's R, G and B, or Y: "layer ViewLayer.Combined", "part 2,
// beauty"; otherwise, or if the file cannot be read, empty.
std::string layer_of_open_exr(const std::filesystem::path& path);

}  // namespace glasswing
