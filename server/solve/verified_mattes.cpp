#include "server/solve/verified_mattes.h"

#include <fmt/format.h>

#include "core/base/checksum.h"
#include "core/base/file.h"
#include "core/matte/matte_file.h"

namespace glasswing {

absl::StatusOr<std::string> VerifiedMattes::read(const std::filesystem::path& file) {
  absl::StatusOr<std::string> bytes = read_file(file);
  if (!bytes.ok()) return absl::DataLossError(bytes.status().message());
  std::string checksum = checksum_of(*bytes);
  {
    const std::lock_guard lock(mutex_);
    if (good_.contains(checksum)) return bytes;
  }
  if (const absl::Status whole = verify_matte(*bytes); !whole.ok()) {
    return absl::DataLossError(fmt::format("{} is damaged: {}", file.string(), std::string(whole.message())));
  }
  const std::lock_guard lock(mutex_);
  if (good_.size() >= kMaxGood) good_.clear();
  good_.insert(std::move(checksum));
  return bytes;
}

}  // namespace glasswing
