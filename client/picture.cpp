#include "client/picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

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

}  // namespace glasswing
