#include "console/routes/scratch_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>

#include "core/base/status.h"

namespace glasswing {

namespace fs = std::filesystem;

absl::StatusOr<ScratchFile> ScratchFile::create() {
  std::error_code error;
  std::string path = (fs::temp_directory_path(error) / "glasswing-XXXXXX").string();
  const int fd = error ? -1 : ::mkstemp(path.data());
  if (fd < 0) return absl::UnavailableError(fmt::format("cannot create {}: {}", path, std::strerror(errno)));
  ::close(fd);
  return ScratchFile(std::move(path));
}

ScratchFile::~ScratchFile() {
  std::error_code ignored;
  if (!path_.empty()) fs::remove(path_, ignored);
}

absl::StatusOr<std::shared_ptr<const MappedFile>> ScratchFile::map() const {
  GW_ASSIGN_OR_RETURN(const FileIdentity identity, identity_of(path_));
  return MappedFile::open(path_, static_cast<size_t>(identity.size_bytes));
}

}  // namespace glasswing
