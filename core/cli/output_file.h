// The files that commands write: checked before any work, and standard output instead of one.
#pragma once

#include <absl/status/status.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace glasswing {

// The output that is not a file. The command's messages then go to standard error (command_line.cpp).
inline constexpr const char* kStandardOutput = "-";

// Of an option that names a file to write: its name ends in one of these (".exr"), it is not a directory, and
// the user may write it there; or it is kStandardOutput, if that is among the endings.
CLI::Validator output_file(std::vector<std::string> endings);

// Of an option that names a directory to write into: the user may do so, or create it.
CLI::Validator output_directory();

// output_file(): OK, or INVALID_ARGUMENT.
absl::Status check_output_file(const std::filesystem::path& file, const std::vector<std::string>& endings);
// Without the ending.
absl::Status check_writable(const std::filesystem::path& file);

// Writes a file like write_file_durably(), or to standard output. UNAVAILABLE: standard output does not
// accept it.
absl::Status write_output(const std::string& output, std::string_view bytes);

// A file that is removed unless it gets its name, or is copied to standard output.
class UnfinishedFile {
 public:
  explicit UnfinishedFile(std::filesystem::path output);
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;
  ~UnfinishedFile();
  // Its location until it is complete: beside the output, or with other temporary files.
  const std::filesystem::path& path() const { return unfinished_; }
  // Gives the file its name durably, or copies it. UNAVAILABLE as in write_output().
  absl::Status finish();

 private:
  const std::filesystem::path output_, unfinished_;
};

}  // namespace glasswing
