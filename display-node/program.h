// A loaded program: which pictures each step puts on which monitor.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

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
  // One for each screen; null is black. Rasterises unless it was done ahead.
  std::vector<Picture> pictures(size_t index) const;

 private:
  struct Lit {
    size_t screen;
    std::optional<Pattern> pattern;
    Picture picture;  // of a photo, or rasterised ahead
  };
  struct Step {
    int number;
    std::vector<Lit> lit;
  };
  std::string name_;
  int hold_refreshes_ = 2;
  size_t screen_count_ = 0;
  std::vector<Step> steps_;
};

}  // namespace glasswing
