// Picture files of the offline subcommands.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <string>

#include "client/cli/client.h"
#include "core/frame/image.h"
#include "core/frame/image_file.h"

namespace glasswing {

// Says that a picture was written: "vase.png: 1280x720", or the same as JSON.
void print_written(const Client& client, const std::string& file, int width_px, int height_px);

// Before any work: INVALID_ARGUMENT for a suffix that cannot be written, or not with so many bits (0: the
// usual ones), NOT_FOUND for a directory that is not there.
absl::Status check_output(const std::filesystem::path& output, int bits = 0);

// A frame of an archive whose calibrations say what its samples mean is light by these, as a composite of its
// matte is; any other picture as `encoding` says. Errors are those of read_radiance() and of the archive's
// calibrations.
absl::StatusOr<RadianceImage> read_picture(const std::filesystem::path& file, Encoding encoding);

// The part of a picture that "WIDTHxHEIGHT+X+Y" names, px from its top-left corner; all of it if `region` is
// empty. INVALID_ARGUMENT: it is not of that form, or reaches beyond the picture.
absl::StatusOr<RadianceImage> cropped(const RadianceImage& picture, const std::string& region);
// The picture moved right by dx and down by dy px, of which parts are shared between the pixels that they
// touch; what leaves at one side comes in at the other.
RadianceImage shifted(const RadianceImage& picture, double dx_px, double dy_px);

inline constexpr const char* kCropHelp =
    "WIDTHxHEIGHT+X+Y: only this part of the picture, px from its top left corner";

}  // namespace glasswing
