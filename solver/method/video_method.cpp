#include "solver/method/video_method.h"

#include <fmt/format.h>

namespace glasswing {

absl::Status in_frame(int frame, const absl::Status& status) {
  return absl::Status(status.code(), fmt::format("frame {}: {}", frame, std::string(status.message())));
}

}  // namespace glasswing
