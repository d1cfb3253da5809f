#include "core/file/set_aside.h"

#include <fmt/format.h>

#include "core/base/status.h"
#include "core/file/file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// A free name below damaged/.
absl::StatusOr<fs::path> place_aside(const fs::path& root, const fs::path& path) {
  const fs::path place = root / kDamagedDirectory / path.lexically_relative(root);
  GW_RETURN_IF_ERROR(make_directory_durably(place.parent_path()));
  fs::path free = place;
  for (int i = 2; fs::exists(free); ++i) free = fmt::format("{}.{}", place.string(), i);
  return free;
}

}  // namespace

absl::Status set_aside(const fs::path& root, const fs::path& path) {
  GW_ASSIGN_OR_RETURN(const fs::path place, place_aside(root, path));
  GW_RETURN_IF_ERROR(rename_file(path, place));
  GW_RETURN_IF_ERROR(flush_directory(place.parent_path()));
  return flush_directory(path.parent_path());
}

absl::Status copy_aside(const fs::path& root, const fs::path& file) {
  if (!fs::exists(file)) return absl::OkStatus();
  GW_ASSIGN_OR_RETURN(const fs::path place, place_aside(root, file));
  GW_ASSIGN_OR_RETURN(const std::string bytes, read_file(file));
  return write_file_durably(place, bytes);
}

}  // namespace glasswing
