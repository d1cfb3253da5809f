#include "client/cli/output_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace glasswing {
namespace fs = std::filesystem;

namespace {

// ".exr, .png or .tif"
std::string listed(const std::vector<std::string>& endings) {
  std::string text = endings.front();
  for (size_t i = 1; i < endings.size(); ++i) text += (i + 1 == endings.size() ? " or " : ", ") + endings[i];
  return text;
}

}  // namespace

absl::Status check_writable(const fs::path& file) {
  std::error_code ignored;
  if (fs::is_directory(file, ignored))
    return absl::InvalidArgumentError(fmt::format("the output {} is a directory", file.string()));
  const fs::path directory = file.has_parent_path() ? file.parent_path() : ".";
  if (!fs::is_directory(directory, ignored)) {
    return absl::InvalidArgumentError(fmt::format("the output {} cannot be written: there is no directory {}",
                                                  file.string(), directory.string()));
  }
  // A new file takes the old one's place, except where it is no ordinary file (/dev/full).
  const fs::path& written =
      fs::exists(file, ignored) && !fs::is_regular_file(file, ignored) ? file : directory;
  if (::access(written.c_str(), W_OK) == 0) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("the output {} cannot be written: {}", file.string(), std::strerror(errno)));
}

absl::Status check_output_file(const fs::path& file, const std::vector<std::string>& endings) {
  if (std::ranges::find(endings, file.extension().string()) == endings.end()) {
    return absl::InvalidArgumentError(
        fmt::format("the output is {}; its name must end in {}", file.string(), listed(endings)));
  }
  return check_writable(file);
}

CLI::Validator output_file(std::vector<std::string> endings) {
  const auto check = [endings = std::move(endings)](const std::string& name) {
    return std::string(check_output_file(name, endings).message());
  };
  return CLI::Validator(check, "");
}

}  // namespace glasswing
