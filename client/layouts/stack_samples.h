// Lines of the photographs of a stack: evenly spaced rows and columns, at full resolution, of the green
// channel. They are enough to see what the patterns were, and what curve the camera has.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace glasswing {

// Parallel lines of every photograph.
struct SampledLines {
  int count = 0, length_px = 0;
  std::vector<std::vector<float>> codes;  // by photograph, line after line; 1 = the highest code

  size_t size() const { return static_cast<size_t>(count) * length_px; }
};

struct StackSamples {
  int width_px = 0, height_px = 0, bits = 0;  // of a photograph
  int largest_code = 0;                       // of all pixels and photographs; of 65535
  SampledLines rows, columns;
};

// Reads the photographs. INVALID_ARGUMENT: one is not of the first one's size and bits. CANCELLED: Ctrl-C.
// Other errors are those of read_photograph, which takes `white`.
absl::StatusOr<StackSamples> sample_stack(const std::filesystem::path& directory,
                                          const std::vector<std::string>& files,
                                          std::optional<int> white = std::nullopt);

}  // namespace glasswing
