// A loaded program: which pictures each step puts on which monitor.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/frame/image.h"
#include "core/pattern/pattern.h"
#include "display-node/display.h"
#include "glasswing/v1/display_service.pb.h"

namespace glasswing {

// Photo pictures by content hash. Thread-safe.
class ImageStore {
 public:
  // Capacity for pictures as they are shown: 4 bytes a sample.
  explicit ImageStore(size_t capacity_bytes = size_t{512} << 20) : capacity_bytes_(capacity_bytes) {}
  // INVALID_ARGUMENT: no PNG; RESOURCE_EXHAUSTED: the store is full. Returns the name.
  absl::StatusOr<std::string> add(const std::string& png);
  Picture find(const std::string& name) const;

 private:
  const size_t capacity_bytes_;
  mutable std::mutex mutex_;
  std::map<std::string, Picture> images_;  // guarded by mutex_
  size_t held_bytes_ = 0;                  // guarded by mutex_
};

class Program {
 public:
  // INVALID_ARGUMENT names the step and what is wrong; FAILED_PRECONDITION: an image is missing.
  static absl::StatusOr<Program> create(const v1::LoadProgramRequest& request,
                                        const std::vector<ScreenInfo>& screens, const ImageStore& images);

  const std::string& name() const { return name_; }
  int hold_refreshes() const { return hold_refreshes_; }
  size_t size() const { return steps_.size(); }
  int number(size_t index) const { return steps_[index].number; }
  // One for each screen, of its whole size; null is black. Draws what was not drawn ahead.
  std::vector<Picture> pictures(size_t index) const;

 private:
  // What a screen shows: a picture, a pattern, or black; and below it the id patch, or dark.
  struct Shown {
    std::optional<Pattern> pattern;
    Picture picture;  // of a photo, or the whole screen rasterised ahead
    std::optional<std::uint16_t> patch_id;
  };
  struct Step {
    int number;
    std::vector<Shown> shown;  // one for each screen
  };
  absl::StatusOr<Step> checked(const v1::ProgramStep& wanted, const ImageStore& images) const;
  Picture drawn(const Shown& shown, const ScreenInfo& screen) const;

  std::string name_;
  int hold_refreshes_ = 2;
  std::vector<ScreenInfo> screens_;
  std::vector<Step> steps_;
};

}  // namespace glasswing
