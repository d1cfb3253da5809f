// Photographs and what the monitor showed in each, from a table (docs/archive.md) or from a layout.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// Command-line options, which override the list.
struct PhotographOptions {
  std::vector<std::string> monitors;    // NAME:WIDTHxHEIGHT
  std::optional<std::string> response;  // of PhotographResponse
  std::optional<double> black = {};     // codes of the photographs
  std::optional<int> white = {};        // the highest of these codes, where it is not the files' own
};

struct PhotographList {
  // Frames in the list's order; their files are relative to the photographs' directory. Without the camera,
  // which is known only after a photograph is read.
  v1::CaptureManifest manifest;
  std::string response;        // of PhotographResponse; empty: not declared
  double black = 0.0;          // codes of the photographs
  std::optional<int> white;    // as in PhotographOptions
  std::vector<int> lines;      // the frames' line numbers in the list; empty: a layout's
  std::filesystem::path path;  // of the list; of the photographs' directory for a layout

  // "photos.tsv:17", for errors about a frame.
  std::string place(int frame) const;
};

// Asks for the white code if the largest code of all photographs, which have `bits`, is the maximum for fewer
// bits: codes of 10, 12 or 14 bits, stored at either end of 16, would then be too dark, or their saturation
// would go unnoticed. INVALID_ARGUMENT: that is the case.
absl::Status check_white(const std::filesystem::path& path, int largest, int bits);

// INVALID_ARGUMENT names the file, the line, the wrong value and what would be accepted. NOT_FOUND: no such
// file.
absl::StatusOr<PhotographList> read_photograph_list(const std::filesystem::path& path,
                                                    const PhotographOptions& options);

}  // namespace glasswing
