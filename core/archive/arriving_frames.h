// Frames of one call, whose files arrive in pieces, one frame after another. They are written under temporary
// names and flushed while the next ones arrive; finish() stores them together.
#pragma once

#include <absl/status/status.h>

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/archive/disk_room.h"
#include "core/base/checksum.h"
#include "core/file/file.h"
#include "core/frame/archive.h"

namespace glasswing {

class ArrivingFrames {
 public:
  static constexpr size_t kMaxFrames = 1024;

  // `room` must outlive it.
  ArrivingFrames(std::shared_ptr<Archive> archive, const DiskRoom& room)
      : archive_(std::move(archive)), room_(room) {}
  ~ArrivingFrames();  // removes what is not stored
  ArrivingFrames(const ArrivingFrames&) = delete;
  ArrivingFrames& operator=(const ArrivingFrames&) = delete;

  // Ends a frame and begins the next. Errors as in Archive::add(), and INVALID_ARGUMENT: the previous frame
  // is incomplete, or there are more than kMaxFrames. RESOURCE_EXHAUSTED: no space for another. After any
  // error of these functions nothing is stored.
  absl::Status begin(const v1::Frame& record);
  // Bytes of the most recently begun frame. INVALID_ARGUMENT: more than a frame of the archive has. Those of
  // an already stored frame are ignored.
  absl::Status add(std::string_view bytes);
  // Durable when it returns.
  absl::Status finish();

 private:
  absl::Status end_frame();

  const std::shared_ptr<Archive> archive_;
  const DiskRoom& room_;
  std::optional<FileWriter> file_;  // of the frame that arrives; none: it is stored already
  std::string head_;                // its first tiff_head_bytes()
  size_t size_bytes_ = 0;
  RunningChecksum checksum_;
  std::vector<Archive::ArrivedFrame> arrived_;
  FlushQueue flushing_;
};

}  // namespace glasswing
