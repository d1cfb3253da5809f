#include "server/mattes/verified_mattes.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <utility>

#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/matte/packed_matte.h"

namespace glasswing {
namespace {

constexpr size_t kChunkBytes = 1 << 20;

absl::Status verify(const PositionedFile& file) {
  GW_ASSIGN_OR_RETURN(const PackedMatteReader reader, PackedMatteReader::open(file));
  return reader.for_rows(0, reader.outline().height_px, [](const Matte&) { return absl::OkStatus(); });
}

}  // namespace

absl::Status for_chunks(const PositionedFile& file, absl::FunctionRef<bool(std::string_view chunk)> take) {
  GW_ASSIGN_OR_RETURN(const std::uint64_t size, file.size_bytes());
  std::string chunk;
  for (std::uint64_t at = 0; at < size; at += chunk.size()) {
    chunk.resize(std::min<std::uint64_t>(kChunkBytes, size - at));
    GW_RETURN_IF_ERROR(file.read_at(at, chunk));
    if (!take(chunk)) break;
  }
  return absl::OkStatus();
}

absl::StatusOr<StoredMatte> VerifiedMattes::open(const std::filesystem::path& path) {
  absl::StatusOr<PositionedFile> file = PositionedFile::open(path);
  if (!file.ok()) return absl::DataLossError(file.status().message());
  RunningChecksum running;
  running.start();
  const absl::Status read = for_chunks(*file, [&](std::string_view chunk) {
    running.add(chunk);
    return true;
  });
  if (!read.ok()) return absl::DataLossError(read.message());
  const std::string checksum = running.text();
  bool known = false;
  {
    const std::lock_guard lock(mutex_);
    known = good_.contains(checksum);
  }
  if (!known) {
    if (const absl::Status whole = verify(*file); !whole.ok())
      return absl::DataLossError(
          fmt::format("{} is damaged: {}", path.string(), std::string(whole.message())));
    const std::lock_guard lock(mutex_);
    if (good_.size() >= kMaxGood) good_.clear();
    good_.insert(checksum);
  }
  return StoredMatte(*std::move(file), checksum);
}

}  // namespace glasswing
