// Writes OpenEXR files of float planes, part by part and row by row: the files of mattes and STMaps.
#pragma once

#include <absl/functional/function_ref.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/matte/matte.h"
#include "core/matte/matte_file.h"

namespace glasswing {

struct ExrPart {
  std::string name;
  std::vector<std::string> channels;              // such as "mode1.weight.R"; sorted
  std::map<std::string, std::string> attributes;  // name to text
};

// The data window of a file within its picture.
struct ExrWindow {
  int x0_px = 0, y0_px = 0, width_px = 0, height_px = 0;
  int picture_width_px = 0, picture_height_px = 0;
};
ExrWindow window_of(const Matte& matte);
ExrWindow window_of(const MatteOutline& outline);

// Writes to memory, or to a new file: float32 scan lines, each compressed separately (ZIPS). Deterministic.
// Throws OpenEXR's exceptions.
class ExrWriter {
 public:
  ExrWriter(const std::vector<ExrPart>& parts, const ExrWindow& window,
            const std::optional<std::filesystem::path>& path = std::nullopt);
  ~ExrWriter();

  // Writes the next row of a part. `channels` points to the first pixel of each of its channels.
  void put(size_t part, std::span<const float* const> channels);
  // The bytes in memory, empty for a file. Without rows these are the headers and a blank table of chunks.
  std::string finish();

 private:
  class File;
  std::unique_ptr<File> file_;
};

// Calls `write`; converts exceptions of OpenEXR to INTERNAL.
absl::StatusOr<std::string> written_exr(absl::FunctionRef<std::string()> write);

}  // namespace glasswing
