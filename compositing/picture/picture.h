// Picture files for the verbs that need no server.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <string>

#include "compositing/colour/picture_colours.h"
#include "core/cli/command_line.h"
#include "core/image/image.h"
#include "core/image/image_file.h"

namespace glasswing {

// Reports a written picture: "vase.png: 1280x720", or the same as JSON.
void print_written(const CommandLine& command_line, const std::string& file, int width_px, int height_px);

// Checks an output before any work. INVALID_ARGUMENT: a suffix that cannot be written, or not with this many
// bits (0: the default). NOT_FOUND: its directory does not exist.
absl::Status check_output(const std::filesystem::path& output, int bits = 0);

// Says on standard error which layer of a picture is read, if it is not the default one.
void tell_layer(const std::filesystem::path& file);

// An error with the file's name before it.
absl::Status in_file(const std::string& file, const absl::Status& status);

// Reads a picture as radiance. A frame of a calibrated archive is linearised by the archive's calibrations,
// like the composite of its matte; any other picture by `encoding`. Errors: as in read_radiance(), and of the
// calibrations.
absl::StatusOr<RadianceImage> read_picture(const std::filesystem::path& file, Encoding encoding);
// The same, with what is known about its colours; a picture that is not a frame is read by `colours`.
// Also INVALID_ARGUMENT: they would convert a frame, whose colours are the camera's.
struct CapturedPicture {
  RadianceImage light;
  PictureColour colour;
};
absl::StatusOr<CapturedPicture> read_picture(const std::filesystem::path& file, const PictureColours& colours,
                                             Encoding encoding);

// The region "WIDTHxHEIGHT+X+Y" of a picture, px from its top-left corner; all of it if `region` is empty.
// INVALID_ARGUMENT: `region` is not of that form, or reaches beyond the picture.
absl::StatusOr<RadianceImage> cropped(const RadianceImage& picture, const std::string& region);
// Shifts the picture by dx px right and dy px down, interpolating linearly. Beyond its edges its edge pixels
// continue (clamp), or it repeats if it wraps.
RadianceImage shifted(const RadianceImage& picture, double dx_px, double dy_px, bool wraps);

inline constexpr const char* kCropHelp =
    "WIDTHxHEIGHT+X+Y: write only this region, px from the top-left corner";

}  // namespace glasswing
