// A serial line to a motor's controller: text, line by line.
#pragma once

#include <absl/status/statusor.h>

#include <chrono>
#include <stop_token>
#include <string>
#include <string_view>

#include "core/file/descriptor.h"

namespace glasswing {

class SerialLine {
 public:
  // Opens a terminal device, which no other process may then open, with 8 bits, no parity and no flow
  // control. INVALID_ARGUMENT: it is none, or has no such rate; the system's error if it cannot be opened.
  static absl::StatusOr<SerialLine> open(const std::string& path, int baud);

  // Sends all of it. UNAVAILABLE: the device is gone, or takes nothing any more.
  absl::Status write(std::string_view bytes);
  // The next line, without its end. DEADLINE_EXCEEDED: none came within `limit`. CANCELLED: stopped.
  // UNAVAILABLE: the device is gone. RESOURCE_EXHAUSTED: a line without an end.
  absl::StatusOr<std::string> read_line(std::chrono::milliseconds limit, const std::stop_token& stop = {});
  // Drops what has arrived.
  void flush();

 private:
  SerialLine(std::string path, Descriptor device) : path_(std::move(path)), device_(std::move(device)) {}
  std::string path_;
  Descriptor device_;
  std::string pending_;
};

}  // namespace glasswing
