// One path of a matte as an STMap, with which compositors warp a picture (Nuke and Natron STMap, Blender Map
// UV, oiiotool --st_warp):
//
//   s = x / width,  t = 1 - y / height       of the mode's centre (x, y) on a monitor of width x height px
//
// so that the centre of the monitor's bottom-left pixel is (0.5 / width, 0.5 / height). An approximation: one
// path, the same in all channels, without its width.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "core/matte/matte.h"

namespace glasswing {

// Whether a mode has light, and no more than an object can physically send.
bool is_plausible(const Mode& mode);

// The mode of `channel` with the greatest weight on a monitor, or on any (`texture` -1); null if all weights
// are 0. Weights above 1.05, which no object has, do not count: such a mode only compensates for excess light
// in others.
const Mode* strongest_mode(const Matte& matte, int x, int y, int channel, int texture = -1);

// Green, whose path lies in the middle of the dispersed light; unless the strongest modes of another channel,
// summed over all pixels, have over a tenth more weight than green's: then that channel.
int strongest_channel(const Matte& matte, int texture = -1);

// The texture of a monitor; 0 for an empty name. INVALID_ARGUMENT: lists the matte's monitors. DATA_LOSS: it
// names none.
absl::StatusOr<int> texture_named(const v1::MatteMetadata& metadata, const std::string& monitor);

// Encodes an OpenEXR file with one float32 part over the matte's window:
//   R, G        s and t
//   B, A        1 where the centre lies on the monitor; elsewhere R, G, B and A are 0
//   weight.R, .G, .B   R of each channel's mode of that path
//   blur.Y      sigma, sqrt((xx + yy) / 2), monitor px
// `path`: 1 and up by LightPaths, or 0 for each pixel's and channel's strongest mode on the monitor.
// INVALID_ARGUMENT: the matte's metadata has no such texture, or lacks its size; the matte has fewer paths.
absl::StatusOr<std::string> encode_stmap(const Matte& matte, int texture, int channel, int path = 0);

struct StmapChoice {
  std::string monitor;                        // empty: the first
  std::optional<int> channel = std::nullopt;  // none: strongest_channel()
  int path = 0;
};
struct WrittenStmap {
  std::string monitor;
  int channel = 0, width_px = 0, height_px = 0;
};
// Writes the same to a new file, from the bytes of a matte's file. Path 0 needs the memory of a few rows, any
// other that of the whole matte. Errors are those of texture_named(), decode_matte() and encode_stmap();
// INTERNAL: the file cannot be written.
absl::StatusOr<WrittenStmap> write_stmap(std::string_view matte, const StmapChoice& choice,
                                         const std::filesystem::path& file);

}  // namespace glasswing
