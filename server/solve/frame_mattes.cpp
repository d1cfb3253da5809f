#include "server/solve/frame_mattes.h"

#include <fmt/format.h>

#include <atomic>
#include <utility>

#include "core/base/mapped_file.h"
#include "core/base/status.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

}  // namespace

FrameMattes::~FrameMattes() {
  std::error_code ignored;
  for (const auto& [frame, file] : files_) fs::remove(file, ignored);
  if (writer_ != nullptr) fs::remove(writer_->path(), ignored);
}

absl::Status FrameMattes::begin(int frame, const std::string& checksum) {
  GW_RETURN_IF_ERROR(finish());
  if (frame < first_ || frame >= first_ + count_ || frame <= frame_) {
    return absl::InvalidArgumentError(fmt::format("frame is {}; it must be {} to {}, each once and in order",
                                                  frame, first_, first_ + count_ - 1));
  }
  // Two calls may bring the same tile, if the first one's answer is late.
  static std::atomic<int> number = 0;
  GW_ASSIGN_OR_RETURN(FileWriter writer,
                      FileWriter::create(directory_ / fmt::format("{:04d}.{}.tmp", frame, ++number)));
  writer_ = std::make_unique<FileWriter>(std::move(writer));
  frame_ = frame;
  announced_ = checksum;
  written_.start();
  return absl::OkStatus();
}

absl::Status FrameMattes::add(std::string_view chunk) {
  if (writer_ == nullptr) return absl::InvalidArgumentError("a chunk came before its frame was named");
  written_.add(chunk);
  return writer_->add(chunk);
}

absl::Status FrameMattes::finish() {
  if (writer_ == nullptr) return absl::OkStatus();
  if (written_.text() != announced_)
    return absl::DataLossError(
        fmt::format("the checksum of frame {} is {}, announced was {}", frame_, written_.text(), announced_));
  GW_RETURN_IF_ERROR(writer_->flush());
  files_.emplace(frame_, writer_->path());
  writer_ = nullptr;
  return absl::OkStatus();
}

absl::Status FrameMattes::verify() const {
  for (const auto& [frame, path] : files_) {
    GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> file, MappedFile::open(path));
    const absl::Status whole = verify_matte(file->bytes());
    if (!whole.ok())
      return absl::DataLossError(fmt::format("frame {}: {}", frame, std::string(whole.message())));
  }
  return absl::OkStatus();
}

absl::Status FrameMattes::place(const std::function<fs::path(int)>& name) {
  fs::path directory;
  while (!files_.empty()) {
    const auto first = files_.begin();
    const fs::path path = name(first->first);
    GW_RETURN_IF_ERROR(rename_file(first->second, path));
    directory = path.parent_path();
    files_.erase(first);
  }
  return directory.empty() ? absl::OkStatus() : flush_directory(directory);
}

}  // namespace glasswing
