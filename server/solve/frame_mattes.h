// The mattes of one tile of a video, between solver and disk: each file is written as it comes, so that
// memory holds no more than a chunk, and all get their names together.
#pragma once

#include <absl/status/status.h>

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "core/base/checksum.h"
#include "core/base/file.h"

namespace glasswing {

class FrameMattes {
 public:
  // Frames [first, first + count), in files below `directory` for now.
  FrameMattes(std::filesystem::path directory, int first, int count)
      : directory_(std::move(directory)), first_(first), count_(count) {}
  ~FrameMattes();  // what has no name yet is removed
  FrameMattes(FrameMattes&&) = default;

  // Begins the file of a frame, which has that checksum (checksum_of()). INVALID_ARGUMENT: it is not of this
  // tile, or not after the one before. DATA_LOSS: the one before has another than was said.
  // RESOURCE_EXHAUSTED: the disk is full.
  absl::Status begin(int frame, const std::string& checksum);
  absl::Status add(std::string_view chunk);
  // DATA_LOSS: the last file has another checksum, as when a call broke off.
  absl::Status finish();

  bool has(int frame) const { return files_.contains(frame); }
  // Gives each file its name; durable when it returns. Files of those names are replaced.
  absl::Status place(const std::function<std::filesystem::path(int frame)>& name);

 private:
  std::filesystem::path directory_;
  int first_ = 0, count_ = 0;
  std::map<int, std::filesystem::path> files_;  // flushed, by frame
  int frame_ = -1;                              // of the file that is being written, or was last
  std::string announced_;                       // its checksum
  RunningChecksum written_;
  std::unique_ptr<FileWriter> writer_;
};

}  // namespace glasswing
