#include "server/mattes/frame_mattes.h"

#include <fmt/format.h>

#include <utility>

#include "core/base/status.h"
#include "core/file/file.h"

namespace glasswing {

namespace fs = std::filesystem;

absl::Status FrameMattes::begin(int frame, const std::string& checksum) {
  GW_RETURN_IF_ERROR(finish());
  if (frame < first_ || frame >= first_ + count_ || frame <= frame_) {
    return absl::InvalidArgumentError(fmt::format("frame is {}; it must be {} to {}, each once and in order",
                                                  frame, first_, first_ + count_ - 1));
  }
  written_.emplace(directory_);
  frame_ = frame;
  announced_ = checksum;
  return absl::OkStatus();
}

absl::Status FrameMattes::add(std::string_view chunk) {
  if (!written_) return absl::InvalidArgumentError("a chunk arrived before its frame was named");
  return written_->add(chunk);
}

absl::Status FrameMattes::finish() {
  if (!written_) return absl::OkStatus();
  if (const absl::Status whole = written_->check(announced_); !whole.ok())
    return absl::Status(whole.code(), fmt::format("frame {}: {}", frame_, std::string(whole.message())));
  GW_RETURN_IF_ERROR(written_->flush());
  files_.emplace(frame_, *std::exchange(written_, std::nullopt));
  return absl::OkStatus();
}

absl::Status FrameMattes::verify() const {
  for (const auto& [frame, file] : files_) {
    const absl::Status whole = file.verify().status();
    if (!whole.ok())
      return absl::Status(whole.code(), fmt::format("frame {}: {}", frame, std::string(whole.message())));
  }
  return absl::OkStatus();
}

absl::Status FrameMattes::place(const std::function<fs::path(int)>& name) {
  fs::path directory;
  while (!files_.empty()) {
    const auto first = files_.begin();
    const fs::path path = name(first->first);
    GW_RETURN_IF_ERROR(first->second.place(path));
    directory = path.parent_path();
    files_.erase(first);
  }
  return directory.empty() ? absl::OkStatus() : flush_directory(directory);
}

}  // namespace glasswing
