// The list of a directory's files with their checksums, as `sha256sum` writes and checks it.
#pragma once

#include <absl/status/status.h>

#include <filesystem>
#include <string>

namespace glasswing {

inline constexpr char kChecksumList[] = "SHA256SUMS";

// Writes the list of all files below the directory, durably.
absl::Status write_checksum_list(const std::filesystem::path& directory);

// Reads every file. `title`: what the directory is called in errors. DATA_LOSS names the file that is
// damaged, missing or not listed. NOT_FOUND: there is no list.
absl::Status check_checksum_list(const std::filesystem::path& directory, const std::string& title);

}  // namespace glasswing
