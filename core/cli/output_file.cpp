#include "core/cli/output_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "core/base/status.h"
#include "core/file/file.h"

namespace glasswing {
namespace fs = std::filesystem;

namespace {

// "end in .exr, .png or .tif, or be - for standard output"
std::string described(std::vector<std::string> endings) {
  const bool is_taken = std::erase(endings, kStandardOutput) > 0;
  std::string text = "end in " + endings.front();
  for (size_t i = 1; i < endings.size(); ++i) text += (i + 1 == endings.size() ? " or " : ", ") + endings[i];
  return is_taken ? text + ", or be - for standard output" : text;
}

absl::Status to_standard_output(std::string_view bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), stdout) == bytes.size() && std::fflush(stdout) == 0)
    return absl::OkStatus();
  return absl::UnavailableError(fmt::format("cannot write to standard output: {}", std::strerror(errno)));
}

}  // namespace

CLI::Validator output_directory() {
  const auto check = [](const std::string& name) -> std::string {
    if (name == kStandardOutput) return "the output is -; it must be a directory";
    fs::path there = fs::absolute(name);  // or what of it there is
    std::error_code ignored;
    while (!fs::exists(there, ignored) && there.has_relative_path()) there = there.parent_path();
    if (!fs::is_directory(there, ignored))
      return fmt::format("the output {} must be a directory; {} is not one", name, there.string());
    if (::access(there.c_str(), W_OK | X_OK) == 0) return "";
    return fmt::format("the output {} cannot be written: {}: {}", name, there.string(), std::strerror(errno));
  };
  return CLI::Validator(check, "");
}

absl::Status check_writable(const fs::path& file) {
  std::error_code ignored;
  if (fs::is_directory(file, ignored))
    return absl::InvalidArgumentError(fmt::format("the output {} is a directory", file.string()));
  const fs::path directory = file.has_parent_path() ? file.parent_path() : ".";
  if (!fs::is_directory(directory, ignored)) {
    return absl::InvalidArgumentError(fmt::format("the output {} cannot be written: there is no directory {}",
                                                  file.string(), directory.string()));
  }
  // A new file takes the old one's place, unless it is not a regular file (/dev/full).
  const fs::path& written =
      fs::exists(file, ignored) && !fs::is_regular_file(file, ignored) ? file : directory;
  if (::access(written.c_str(), W_OK) == 0) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("the output {} cannot be written: {}", file.string(), std::strerror(errno)));
}

absl::Status check_output_file(const fs::path& file, const std::vector<std::string>& endings) {
  const bool is_standard = file == kStandardOutput;
  const std::string ending = is_standard ? kStandardOutput : file.extension().string();
  if (std::ranges::find(endings, ending) == endings.end()) {
    return absl::InvalidArgumentError(
        fmt::format("the output is {}; its name must {}", file.string(), described(endings)));
  }
  return is_standard ? absl::OkStatus() : check_writable(file);
}

CLI::Validator output_file(std::vector<std::string> endings) {
  const auto check = [endings = std::move(endings)](const std::string& name) {
    return std::string(check_output_file(name, endings).message());
  };
  return CLI::Validator(check, "");
}

absl::Status write_output(const std::string& output, std::string_view bytes) {
  return output == kStandardOutput ? to_standard_output(bytes) : write_file_durably(output, bytes);
}

UnfinishedFile::UnfinishedFile(fs::path output)
    : output_(std::move(output)),
      unfinished_(output_ == kStandardOutput
                      ? fs::temp_directory_path() / fmt::format("glasswing.{}.tmp", ::getpid())
                      : fs::path(fmt::format("{}.{}.tmp", output_.string(), ::getpid()))) {}

UnfinishedFile::~UnfinishedFile() {
  std::error_code ignored;
  fs::remove(unfinished_, ignored);
}

absl::Status UnfinishedFile::finish() {
  if (output_ != kStandardOutput) return place_file_durably(unfinished_, output_);
  GW_ASSIGN_OR_RETURN(FileReader file, FileReader::open(unfinished_));
  std::string piece(size_t{1} << 20, '\0');
  while (true) {
    GW_ASSIGN_OR_RETURN(const size_t size, file.read(piece));
    if (size == 0) return absl::OkStatus();
    GW_RETURN_IF_ERROR(to_standard_output(std::string_view(piece).substr(0, size)));
  }
}

}  // namespace glasswing
