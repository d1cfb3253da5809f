#include "server/frame_mattes.h"

#include <fmt/format.h>

#include <atomic>
#include <utility>

#include "core/base/status.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
constexpr std::string_view kOpenExr = "\x76\x2f\x31\x01";  // how every such file starts

}  // namespace

FrameMattes::~FrameMattes() {
  std::error_code ignored;
  for (const auto& [frame, file] : files_) fs::remove(file, ignored);
  if (writer_ != nullptr) fs::remove(writer_->path(), ignored);
}

absl::Status FrameMattes::begin(int frame) {
  GW_RETURN_IF_ERROR(end());
  if (frame < first_ || frame >= first_ + count_ || frame <= frame_) {
    return absl::InvalidArgumentError(fmt::format("frame is {}; it must be {} to {}, each once and in order",
                                                  frame, first_, first_ + count_ - 1));
  }
  // Two calls may bring the same tile, when the answer to the first one is late.
  static std::atomic<int> number = 0;
  GW_ASSIGN_OR_RETURN(FileWriter writer,
                      FileWriter::create(directory_ / fmt::format("{:04d}.{}.tmp", frame, ++number)));
  writer_ = std::make_unique<FileWriter>(std::move(writer));
  frame_ = frame;
  start_.clear();
  return absl::OkStatus();
}

absl::Status FrameMattes::add(std::string_view chunk) {
  if (writer_ == nullptr) return absl::InvalidArgumentError("a chunk came before its frame was named");
  if (start_.size() < kOpenExr.size()) start_ += chunk.substr(0, kOpenExr.size() - start_.size());
  return writer_->add(chunk);
}

absl::Status FrameMattes::end() {
  if (writer_ == nullptr) return absl::OkStatus();
  if (start_ != kOpenExr)
    return absl::InvalidArgumentError(fmt::format("frame {} is no OpenEXR file", frame_));
  GW_RETURN_IF_ERROR(writer_->flush());
  files_.emplace(frame_, writer_->path());
  writer_ = nullptr;
  return absl::OkStatus();
}

absl::Status FrameMattes::finish() {
  GW_RETURN_IF_ERROR(end());
  return files_.empty() ? absl::OkStatus() : read_matte(files_.rbegin()->second).status();
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
