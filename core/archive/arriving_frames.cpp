#include "core/archive/arriving_frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <filesystem>

#include "core/base/status.h"

namespace glasswing {
namespace {

// No frame has such a name (is_stored_name).
std::string temporary_name() {
  static std::atomic<std::uint64_t> arrivals = 0;
  return fmt::format(".arriving-{}.tmp", ++arrivals);
}

}  // namespace

ArrivingFrames::~ArrivingFrames() {
  (void)flushing_.wait();
  std::error_code ignored;
  for (const Archive::ArrivedFrame& frame : arrived_) std::filesystem::remove(frame.file, ignored);
}

absl::Status ArrivingFrames::begin(const v1::Frame& record) {
  GW_RETURN_IF_ERROR(end_frame());
  GW_ASSIGN_OR_RETURN(const bool is_new, archive_->is_new(record));
  if (!is_new) return absl::OkStatus();
  if (arrived_.size() == kMaxFrames)
    return absl::InvalidArgumentError(fmt::format("a call may bring at most {} frames", kMaxFrames));
  GW_RETURN_IF_ERROR(room_.check(static_cast<std::int64_t>(tiff_size_bytes(archive_->shape()))));
  const std::filesystem::path path = archive_->directory() / "frames" / temporary_name();
  GW_ASSIGN_OR_RETURN(FileWriter file, FileWriter::create(path));
  file_.emplace(std::move(file));
  arrived_.push_back({.record = record, .file = path});
  head_.clear();
  size_bytes_ = 0;
  checksum_.start();
  return absl::OkStatus();
}

absl::Status ArrivingFrames::add(std::string_view bytes) {
  if (!file_) return absl::OkStatus();
  const size_t whole = tiff_size_bytes(archive_->shape());
  if (bytes.size() > whole - size_bytes_) {
    return absl::InvalidArgumentError(fmt::format(
        "{} has more bytes than the {} of a frame of {}x{} px with {} channel{}",
        arrived_.back().record.file(), whole, archive_->shape().width_px, archive_->shape().height_px,
        archive_->shape().channels, archive_->shape().channels == 1 ? "" : "s"));
  }
  size_bytes_ += bytes.size();
  head_ += bytes.substr(0, tiff_head_bytes(archive_->shape()) - head_.size());
  checksum_.add(bytes);
  return file_->add(bytes);
}

absl::Status ArrivingFrames::end_frame() {
  if (!file_) return absl::OkStatus();
  v1::Frame& record = arrived_.back().record;
  if (const std::string checksum = checksum_.text(); checksum != record.checksum()) {
    return absl::InvalidArgumentError(fmt::format("{} arrived with checksum {}; {} was announced",
                                                  record.file(), checksum, record.checksum()));
  }
  const absl::Status head = check_tiff_head(head_, size_bytes_, archive_->shape());
  if (!head.ok())
    return absl::InvalidArgumentError(fmt::format("{}: {}", record.file(), std::string(head.message())));
  record.set_size_bytes(static_cast<std::int64_t>(size_bytes_));
  flushing_.add(*std::exchange(file_, std::nullopt));
  return absl::OkStatus();
}

absl::Status ArrivingFrames::finish() {
  GW_RETURN_IF_ERROR(end_frame());
  GW_RETURN_IF_ERROR(flushing_.wait());
  return archive_->add_arrived(arrived_);
}

}  // namespace glasswing
