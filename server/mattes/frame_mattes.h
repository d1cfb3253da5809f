// The mattes of one tile of a video, between solver and disk; all get their final names together.
#pragma once

#include <absl/status/status.h>

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "server/mattes/received_matte.h"

namespace glasswing {

class FrameMattes {
 public:
  // For frames [first, first + count), in temporary files in `directory`.
  FrameMattes(std::filesystem::path directory, int first, int count)
      : directory_(std::move(directory)), first_(first), count_(count) {}

  // Begins the file of a frame; `checksum` is the whole file's (checksum_of()). INVALID_ARGUMENT: the frame
  // is not in this tile, or does not follow the previous frame. DATA_LOSS: the previous file's checksum
  // differs from the announced one. RESOURCE_EXHAUSTED: the disk is full.
  absl::Status begin(int frame, const std::string& checksum);
  absl::Status add(std::string_view chunk);
  // DATA_LOSS: the last file's checksum differs from the announced one, for example after an interrupted
  // call.
  absl::Status finish();

  // Reads the files as a client will. DATA_LOSS: one is not a matte; names the frame.
  absl::Status verify() const;

  bool has(int frame) const { return files_.contains(frame); }
  // Gives each file its final name, replacing files of that name; durable when it returns.
  absl::Status place(const std::function<std::filesystem::path(int frame)>& name);

 private:
  std::filesystem::path directory_;
  int first_ = 0, count_ = 0;
  std::map<int, ReceivedMatte> files_;    // flushed, by frame
  int frame_ = -1;                        // of the file that is written, or was last
  std::string announced_;                 // its checksum
  std::optional<ReceivedMatte> written_;  // that is written
};

}  // namespace glasswing
