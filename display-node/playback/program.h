// A loaded program: which pictures each step puts on which monitor.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/pattern/pattern.h"
#include "display-node/display.h"
#include "display-node/playback/screen_response.h"
#include "glasswing/v1/display_service.pb.h"

namespace glasswing {

// The most recently sent photos, by content hash. Thread-safe.
class ImageStore {
 public:
  // Capacity for decoded photos, 2 bytes a sample.
  explicit ImageStore(size_t capacity_bytes = size_t{512} << 20) : capacity_bytes_(capacity_bytes) {}
  // Returns the name. The oldest ones are dropped to make room. INVALID_ARGUMENT: not a PNG.
  // RESOURCE_EXHAUSTED: larger than the capacity.
  absl::StatusOr<std::string> add(const std::string& png);
  // Null: there is no photo with that name.
  std::shared_ptr<const Image16> find(const std::string& name) const;

 private:
  const size_t capacity_bytes_;
  mutable std::mutex mutex_;
  std::map<std::string, std::shared_ptr<const Image16>> images_;  // guarded by mutex_
  std::deque<std::string> sent_;  // their names, latest last; guarded by mutex_
  size_t held_bytes_ = 0;         // guarded by mutex_
};

// Memory for pictures that are drawn before they are shown: when a program is loaded, and again while it
// plays.
inline constexpr size_t kAheadBytes = size_t{256} << 20;

class Program {
 public:
  // INVALID_ARGUMENT names the step or the calibration, and the problem. FAILED_PRECONDITION: an image is
  // missing.
  static absl::StatusOr<Program> create(const v1::LoadProgramRequest& request,
                                        const std::vector<ScreenInfo>& screens, const ImageStore& images);

  const std::string& name() const { return name_; }
  int hold_refreshes() const { return hold_refreshes_; }
  size_t size() const { return steps_.size(); }
  int number(size_t index) const { return steps_[index].number; }
  size_t bytes_of_pictures() const;  // of one step, if no screen is black
  // One picture of full size for each screen; null is black. Draws those that were not drawn ahead.
  std::vector<Picture> pictures(size_t index) const;

 private:
  // The content of a screen: a photo, a pattern, or black; and below it the id patch, or black.
  struct Shown {
    std::optional<Pattern> pattern;
    std::shared_ptr<const Image16> photo;
    bool are_codes = false;  // the pattern's values are codes: no calibration applies
    std::optional<std::uint16_t> patch_id;
    // Drawn when the program was loaded: the whole picture, or the part above the patch if only the patch
    // differs from an earlier step.
    Picture ahead, above_patch;
  };
  struct Step {
    int number;
    std::vector<Shown> shown;  // one for each screen
  };
  absl::StatusOr<Step> checked(const v1::ProgramStep& wanted, const ImageStore& images) const;
  Picture drawn(const Shown& shown, size_t screen) const;
  void draw_ahead(const v1::LoadProgramRequest& request);

  std::string name_;
  int hold_refreshes_ = 2;
  std::vector<ScreenInfo> screens_;
  std::vector<std::optional<Dither>> dithers_;  // one for each screen; empty: it counts as linear
  std::vector<Step> steps_;
};

}  // namespace glasswing
