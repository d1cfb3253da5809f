// Triggers the camera once in each picture of a program, in the middle of the time in which all monitors show
// it. A monitor reports when a picture is replaced, which is when the next one begins: its scan-out, lag and
// settling leave enough time to trigger. A late trigger only costs a step its proof.
#pragma once

#include <absl/status/statusor.h>

#include <map>
#include <mutex>
#include <optional>
#include <vector>

#include "core/timing/proof.h"
#include "server/rig/rig_link.h"

namespace glasswing {

class ExposureTriggers {
 public:
  // Whether the camera waits for triggers in captures.
  static bool are_wanted(const RigLinks& links) { return links.camera_info.trigger() == "software"; }
  // `links` are borrowed. `pictures`: of the program; the first one is not exposed. `monitor_count`: monitors
  // that report each picture.
  ExposureTriggers(const RigLinks& links, int pictures, int monitor_count, nanoseconds hold,
                   double exposure_ms);
  // A display's report of the picture that it has just replaced. Returns once the camera is triggered, if
  // this is the last monitor's report. From any thread.
  void note(const v1::Presentation& replaced, const DisplayLink& display);

 private:
  nanoseconds middle_of(const std::vector<MonitorWindow>& next) const;
  void expose(nanoseconds at) const;  // rig time

  const RigLinks& links_;
  const size_t pictures_, monitor_count_;
  const nanoseconds hold_, length_;  // of a picture; of an exposure, first row to last
  std::mutex mutex_;
  std::map<std::string, size_t> reports_;              // by monitor; guarded by mutex_
  std::map<size_t, std::vector<MonitorWindow>> next_;  // by number, until complete; guarded by mutex_
};

// For a camera that waits for its line: when the display that has a line must raise it in each picture, so
// that the exposure lies in the middle of the time in which all monitors show the picture. Empty for all
// other displays and cameras; then something else raises the line. INVALID_ARGUMENT: it does not fit; the
// message says what to change.
absl::StatusOr<std::optional<v1::LinePulse>> line_pulse(const RigLinks& links, const DisplayLink& display,
                                                        int hold_refreshes, double exposure_ms);

}  // namespace glasswing
