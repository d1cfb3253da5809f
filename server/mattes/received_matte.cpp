#include "server/mattes/received_matte.h"

#include <fmt/format.h>

#include <atomic>
#include <utility>

#include "core/base/status.h"
#include "core/file/positioned_file.h"
#include "core/matte/packed_matte.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// Two calls may deliver the same tile, if the first one's answer is late.
std::string temporary_name() {
  static std::atomic<int> number = 0;
  return fmt::format("{}.tmp", ++number);
}

}  // namespace

ReceivedMatte::ReceivedMatte(const fs::path& directory, std::int64_t max_bytes)
    : path_(directory / temporary_name()), max_bytes_(max_bytes) {
  written_.start();
}

ReceivedMatte::~ReceivedMatte() {
  std::error_code ignored;
  if (writer_ != nullptr) fs::remove(path_, ignored);
}

absl::Status ReceivedMatte::add(std::string_view chunk) {
  GW_RETURN_IF_ERROR(status_);
  size_bytes_ += static_cast<std::int64_t>(chunk.size());
  const auto write = [&]() -> absl::Status {
    if (size_bytes_ > max_bytes_)
      return absl::InvalidArgumentError(fmt::format("the matte is larger than {} bytes", max_bytes_));
    if (writer_ == nullptr) {
      GW_ASSIGN_OR_RETURN(FileWriter writer, FileWriter::create(path_));
      writer_ = std::make_unique<FileWriter>(std::move(writer));
    }
    return writer_->add(chunk);
  };
  written_.add(chunk);
  return status_ = write();
}

absl::Status ReceivedMatte::check(const std::string& announced) const {
  GW_RETURN_IF_ERROR(status_);
  if (checksum() == announced) return absl::OkStatus();
  return absl::DataLossError(
      fmt::format("the matte's checksum is {}; {} was announced", checksum(), announced));
}

absl::StatusOr<MatteOutline> ReceivedMatte::verify(PixelCount* counted) const {
  GW_ASSIGN_OR_RETURN(const PositionedFile file, PositionedFile::open(path_));
  GW_ASSIGN_OR_RETURN(const PackedMatteReader reader, PackedMatteReader::open(file));
  const MatteOutline& outline = reader.outline();
  GW_RETURN_IF_ERROR(reader.for_rows(0, outline.height_px, [&](const Matte& rows) {
    if (counted != nullptr) *counted += count_pixels(rows);
    return absl::OkStatus();
  }));
  return outline;
}

absl::Status ReceivedMatte::flush() {
  return writer_ == nullptr ? absl::OkStatus() : writer_->flush();
}

absl::Status ReceivedMatte::place(const fs::path& path) {
  GW_RETURN_IF_ERROR(rename_file(path_, path));
  writer_ = nullptr;
  return absl::OkStatus();
}

}  // namespace glasswing
