// A file mapped for reading. Pages are loaded on first access. If one cannot be loaded (the file was
// truncated, its disk fails), the process is not killed by SIGBUS: that page and all after it read as zeros,
// and the mapping is no longer intact(). So read the bytes first, then check intact().
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>

namespace glasswing {

struct MappedRegion;  // what the signal handler knows about a mapping

// Identifies a file's content: if any field differs, the bytes may differ.
struct FileIdentity {
  std::uint64_t device = 0, inode = 0;
  std::int64_t size_bytes = 0, modified_ns = 0, changed_ns = 0;
  bool operator==(const FileIdentity&) const = default;
};
// The system's error, with the path.
absl::StatusOr<FileIdentity> identity_of(const std::filesystem::path& path);

class MappedFile {
 public:
  // The system's error, with the path; OUT_OF_RANGE: the file's size is not `size_bytes` (> 0).
  static absl::StatusOr<std::shared_ptr<const MappedFile>> open(const std::filesystem::path& path,
                                                                size_t size_bytes);
  // The same for any size; INVALID_ARGUMENT: not a file, DATA_LOSS: it is empty.
  static absl::StatusOr<std::shared_ptr<const MappedFile>> open(const std::filesystem::path& path);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  std::string_view bytes() const { return bytes_; }
  const FileIdentity& identity() const { return identity_; }
  // True if every byte read so far was the file's content at the time of mapping. Stats the file, since
  // truncation within a page raises no signal. A file removed or replaced meanwhile stays intact while
  // mapped.
  bool intact() const;

 private:
  MappedFile(std::filesystem::path path, std::string_view bytes, const FileIdentity& identity);

  const std::filesystem::path path_;
  const std::string_view bytes_;
  const FileIdentity identity_;
  MappedRegion* const region_;
};

}  // namespace glasswing
