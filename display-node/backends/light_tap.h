// Passes pictures on to a display and, once there is a reader, logs what it emitted and from when: the light
// that a simulated camera sees, whatever the screens behind it.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <vector>

#include "core/sim/panel_pose.h"
#include "display-node/display.h"

namespace glasswing {

// A picture that starts its scan-out, on monitor screens()[monitor]; or, with `pose`, a monitor that is
// elsewhere from then on and shows the same picture.
struct Emission {
  size_t monitor = 0;
  nanoseconds scanout_start{};
  Picture picture;
  std::optional<PanelPose> pose = {};
};

class LightTap final : public Display {
 public:
  // The display must outlive it, and be used only through it.
  explicit LightTap(Display& display);

  std::string backend() const override { return display_.backend(); }
  const std::vector<ScreenInfo>& screens() const override { return display_.screens(); }
  absl::StatusOr<std::vector<Scanout>> show(const std::vector<Picture>& pictures, nanoseconds at) override;

  // The monitor has this pose from now on. All are at their normal places at first.
  void place(size_t monitor, const PanelPose& pose);

  // Everything emitted since `cursor` (0: the pictures on screen now, and the monitors' poses), and a time
  // before which nothing else starts. Moves `cursor` on. Waits up to `timeout` for something new. False: the
  // reader has fallen too far behind.
  bool read(std::uint64_t& cursor, std::vector<Emission>& emissions, nanoseconds& horizon,
            std::chrono::milliseconds timeout);

 private:
  Display& display_;
  const size_t log_limit_;
  std::mutex mutex_;
  std::condition_variable emitted_;
  nanoseconds show_began_{};        // guarded by mutex_; 0: no show is under way
  nanoseconds shows_nothing_to_{};  // guarded by mutex_; the show under way starts nothing before this
  std::vector<Emission> current_;   // guarded by mutex_, one a monitor
  std::vector<PanelPose> poses_;    // guarded by mutex_, one a monitor
  bool is_read_ = false;            // guarded by mutex_; nothing is logged before the first read
  std::deque<Emission> log_;        // guarded by mutex_, the newest log_limit_
  std::uint64_t next_ = 1;          // guarded by mutex_, number of the next emission
};

}  // namespace glasswing
