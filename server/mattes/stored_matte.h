// A matte's file as it is sent to a client, in pieces.
#pragma once

#include <absl/functional/function_ref.h>
#include <absl/status/status.h>

#include <string>
#include <string_view>
#include <utility>

#include "core/file/positioned_file.h"

namespace glasswing {

class StoredMatte {
 public:
  // `checksum`: checksum_of() all bytes, which are checked against it again as they are sent; empty: the file
  // has no name through which others could write to it.
  explicit StoredMatte(PositionedFile file, std::string checksum = "")
      : file_(std::move(file)), checksum_(std::move(checksum)) {}

  const PositionedFile& file() const { return file_; }
  // Passes on all bytes, at most 1 MiB at a time, until `take` returns false. DATA_LOSS, which names the
  // file: it was altered since it was verified.
  absl::Status send(absl::FunctionRef<bool(std::string_view chunk)> take) const;

 private:
  PositionedFile file_;
  std::string checksum_;
};

}  // namespace glasswing
