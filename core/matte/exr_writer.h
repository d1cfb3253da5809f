// OpenEXR files of float planes, part by part and row by row: how mattes and maps of them are stored.
#pragma once

#include <absl/functional/function_ref.h>
#include <absl/status/statusor.h>

#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/matte/matte.h"

namespace glasswing {

struct ExrPart {
  std::string name;
  std::vector<std::string> channels;              // such as "mode1.weight.R", sorted
  std::map<std::string, std::string> attributes;  // texts
};

// The pixels of a file, and of which picture they are.
struct ExrWindow {
  int x0_px = 0, y0_px = 0, width_px = 0, height_px = 0;
  int picture_width_px = 0, picture_height_px = 0;
};
ExrWindow window_of(const Matte& matte);

// Scan lines, each packed by itself (ZIPS), float32, in memory. Same input in the same order, same bytes.
// Throws what OpenEXR throws.
class ExrWriter {
 public:
  ExrWriter(const std::vector<ExrPart>& parts, const ExrWindow& window);
  ~ExrWriter();

  // The next row of a part, of each of its channels the first pixel.
  void put(size_t part, std::span<const float* const> channels);
  // All that was written: of a file without rows the headers, and a table of chunks that is blank.
  std::string finish();

 private:
  class File;
  std::unique_ptr<File> file_;
};

// What `write` returns, or INTERNAL in place of what OpenEXR throws.
absl::StatusOr<std::string> written_exr(absl::FunctionRef<std::string()> write);

}  // namespace glasswing
