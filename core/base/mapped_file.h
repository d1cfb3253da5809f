// A file mapped for reading. Its pages come when somebody looks at them. One that cannot come any more (the
// file was cut short, its disk fails) ends no program by SIGBUS: it and all after it read as zeros from then
// on, and the mapping is no longer intact(). So: look at the bytes, then ask whether they were the file's.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>

namespace glasswing {

struct MappedRegion;  // what the signal's handler knows of a mapping

// Of a file's bytes: another one, or another length or time of change, and they may be others.
struct FileIdentity {
  std::uint64_t device = 0, inode = 0;
  std::int64_t size_bytes = 0, modified_ns = 0, changed_ns = 0;
  bool operator==(const FileIdentity&) const = default;
};
// The system's own error, with the path.
absl::StatusOr<FileIdentity> identity_of(const std::filesystem::path& path);

class MappedFile {
 public:
  // The system's own error, with the path; OUT_OF_RANGE: it has not `size_bytes` (> 0).
  static absl::StatusOr<std::shared_ptr<const MappedFile>> open(const std::filesystem::path& path,
                                                                size_t size_bytes);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  std::string_view bytes() const { return bytes_; }
  const FileIdentity& identity() const { return identity_; }
  // Whether every byte that was read so far was the file's, as it was when it was mapped. Asks the system: a
  // file that is cut short within a page raises nothing. One that was removed or replaced meanwhile stays
  // whole as long as it is mapped.
  bool intact() const;

 private:
  MappedFile(std::filesystem::path path, std::string_view bytes, const FileIdentity& identity);

  const std::filesystem::path path_;
  const std::string_view bytes_;
  const FileIdentity identity_;
  MappedRegion* const region_;
};

}  // namespace glasswing
