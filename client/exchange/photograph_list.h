// Photographs that others took, and what was on the monitor in each: a table (docs/archive.md).
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// What the command line says goes before what the list says.
struct PhotographOptions {
  std::vector<std::string> monitors;    // NAME:WIDTHxHEIGHT
  std::optional<std::string> response;  // of PhotographResponse
  std::optional<double> black;          // codes of the photographs
};

struct PhotographList {
  // Frames in the list's order, their files below the photographs' directory. The camera is not known before
  // one is read.
  v1::CaptureManifest manifest;
  std::string response;    // of PhotographResponse
  double black = 0.0;      // codes of the photographs
  std::vector<int> lines;  // of the frames, in the list

  // "photos.tsv:17", for complaints about a frame.
  std::string place(int frame) const;
  std::filesystem::path path;
};

// Of "NAME:WIDTHxHEIGHT". INVALID_ARGUMENT: it is not that.
absl::StatusOr<v1::Monitor> monitor_of(const std::string& text);

// INVALID_ARGUMENT names file, line, what is wrong and what would be accepted; NOT_FOUND: there is none.
absl::StatusOr<PhotographList> read_photograph_list(const std::filesystem::path& path,
                                                    const PhotographOptions& options);

}  // namespace glasswing
