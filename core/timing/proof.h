// The proof that a frame shows a step (docs/architecture.md): its whole exposure, first row to last, lies
// inside
//
//   [scanout_end + optical lag + settle, replaced + optical lag]
//
// of every monitor, shrunk by the error bounds of both nodes' clocks and timestamps. The caller checks that
// the frame has the exposure and size asked for. A frame without proof is never bound to a step.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "core/base/time.h"

namespace glasswing {

// The interval in which one step was stable on all monitors, rig time.
struct StableWindow {
  int step = 0;
  nanoseconds from{};
  nanoseconds until{};  // already shrunk by the displays' uncertainty
  // Until when the id patches, the last rows to be replaced, show the step as well; until, if there are none.
  nanoseconds patch_until{};
};

// One step on one monitor, rig time.
struct MonitorWindow {
  int step = 0;
  nanoseconds scanout_end{};
  nanoseconds replaced{};
  nanoseconds lag{};
  nanoseconds settle{};
  nanoseconds uncertainty{};
  nanoseconds patch_delay{};  // from the scan-out of the first row to that of the id patch; 0: it has none
};

// The intersection over all monitors; may be empty (until < from).
StableWindow stable_window(const std::vector<MonitorWindow>& monitors);

struct FrameTime {
  std::int64_t sequence = 0;
  nanoseconds start{};  // rig time
  nanoseconds end{};
  nanoseconds uncertainty{};
};

bool proves(const FrameTime& frame, const StableWindow& window);

// Pairs frames with windows as they arrive, each in time order. A step is paired with the first frame that
// proves it; a frame proves at most one step.
class FrameMatcher {
 public:
  struct Match {
    int step = 0;
    FrameTime frame;
  };

  void add_frame(const FrameTime& frame);
  void add_window(const StableWindow& window);
  // Forgets the windows that still wait for a frame, and matches that were not taken.
  void forget_windows();
  // Matches since the last call.
  std::vector<Match> take();
  // The end of the newest frame; empty before the first.
  std::optional<nanoseconds> frames_seen_until() const { return seen_until_; }

 private:
  void match(const StableWindow& window);

  std::map<nanoseconds, FrameTime> frames_;  // by start; recent ones that may still prove a step
  std::vector<StableWindow> open_;           // windows without a frame yet
  std::vector<Match> matches_;
  std::optional<nanoseconds> seen_until_;
};

}  // namespace glasswing
