#include "client/storage/archive_location.h"

#include <fmt/format.h>
#include <stdlib.h>

#include <chrono>

#include "client/storage/checksum_list.h"
#include "core/base/status.h"
#include "core/process/run_program.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::hours kTransfer(24);
constexpr std::chrono::minutes kLook(2);
constexpr std::string_view kS3 = "s3://", kRclonePrefix = "rclone:";

}  // namespace

absl::StatusOr<ArchiveLocation> ArchiveLocation::parse(const std::string& text) {
  std::string location = text;
  while (location.size() > 1 && location.ends_with('/')) location.pop_back();
  if (location.starts_with(kS3)) {
    if (location.size() > kS3.size()) return ArchiveLocation(Program::kS3cmd, location);
    return absl::InvalidArgumentError(fmt::format("{} names no bucket; write s3://BUCKET/PATH", text));
  }
  if (location.starts_with(kRclonePrefix)) {
    if (location.find(':', kRclonePrefix.size()) != std::string::npos ||
        location.find('/') != std::string::npos)
      return ArchiveLocation(Program::kRclone, location);
    return absl::InvalidArgumentError(fmt::format("{} names no remote; write rclone:REMOTE:PATH", text));
  }
  if (location.find("://") == std::string::npos && !location.empty())
    return ArchiveLocation(Program::kNone, location);
  return absl::InvalidArgumentError(
      fmt::format("\"{}\" is not a directory, s3://BUCKET/PATH or rclone:REMOTE:PATH", text));
}

std::string ArchiveLocation::remote(const std::string& name) const {
  const std::string whole = name.empty() ? location_ : location_of(name);
  return program_ == Program::kRclone ? whole.substr(kRclonePrefix.size()) : whole;
}

absl::Status ArchiveLocation::check_free(const std::string& name) const {
  const absl::Status taken = absl::AlreadyExistsError(
      fmt::format("{} exists; remove it, or archive to another place", location_of(name)));
  if (!is_remote()) {
    std::error_code ignored;
    return fs::exists(location_of(name), ignored) ? taken : absl::OkStatus();
  }
  // The list is uploaded with the rest, so that an interrupted upload may have it.
  const std::string list = remote(name) + "/" + kChecksumList;
  const std::vector<std::string> words =
      program_ == Program::kS3cmd ? std::vector<std::string>{"s3cmd", "ls", list}
                                  : std::vector<std::string>{"rclone", "lsf", "--include",
                                                             std::string("/") + kChecksumList, remote(name)};
  GW_ASSIGN_OR_RETURN(const ProgramEnd end, run_program(words, {.limit = kLook, .keep_output = true}));
  constexpr int kRcloneNoDirectory = 3;
  if (program_ == Program::kRclone && end.status == kRcloneNoDirectory) return absl::OkStatus();
  if (end.status != 0) return absl::FailedPreconditionError(fmt::format("{}: {}", words[0], end.error));
  return end.output.empty() ? absl::OkStatus() : taken;
}

absl::Status ArchiveLocation::upload(const fs::path& directory, const std::string& name) const {
  const std::vector<std::string> words =
      program_ == Program::kS3cmd
          ? std::vector<std::string>{"s3cmd",
                                     "sync",
                                     "--quiet",
                                     "--check-md5",
                                     directory.string() + "/",
                                     remote(name) + "/"}
          : std::vector<std::string>{"rclone", "copy", "--checksum", directory.string(), remote(name)};
  return run_command(words, {.limit = kTransfer, .keep_output = true});
}

absl::Status ArchiveLocation::download(const fs::path& directory) const {
  const std::vector<std::string> words =
      program_ == Program::kS3cmd
          ? std::vector<std::string>{"s3cmd",
                                     "get",
                                     "--quiet",
                                     "--recursive",
                                     "--force",
                                     remote("") + "/",
                                     directory.string() + "/"}
          : std::vector<std::string>{"rclone", "copy", remote(""), directory.string()};
  return run_command(words, {.limit = kTransfer, .keep_output = true});
}

absl::StatusOr<ScratchDirectory> ScratchDirectory::create() {
  std::error_code error;
  std::string pattern = (fs::temp_directory_path(error) / "glasswing-XXXXXX").string();
  if (error || ::mkdtemp(pattern.data()) == nullptr) {
    return absl::ErrnoToStatus(error ? error.value() : errno,
                               "cannot create a temporary directory; TMPDIR says where they are");
  }
  return ScratchDirectory(pattern);
}

ScratchDirectory::~ScratchDirectory() {
  std::error_code ignored;
  if (!path_.empty()) fs::remove_all(path_, ignored);
}

}  // namespace glasswing
