// The light that the monitors actually emitted, in physical time. A picture is scanned out row by row: row y
// of H switches to it at t = scanout_start + y/H * scanout + lag, until row y of the next picture replaces
// it. Light changes linearly between pictures: picture i has the weight r(t - t_i) - r(t - t_i+1), where r(u)
// = u / settle clamped to [0, 1]. The backlight's flicker multiplies all of it.
#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/time.h"
#include "core/image/image.h"
#include "core/sim/flicker.h"
#include "core/sim/panel_pose.h"

namespace glasswing {

struct EmittedPicture {
  nanoseconds scanout_start{};
  std::shared_ptr<const Image16> image;  // never null
};

struct EmissionMonitor {
  std::string name;
  int width_px = 0;
  int height_px = 0;
  nanoseconds scanout{};
  nanoseconds lag{};
  nanoseconds settle{};
  Flicker flicker = {};
  double pitch_mm = 1.0;  // of its pixels
  PanelPose pose = {};    // at the moment that was asked for
};

// One monitor's light during an interval: consecutive pictures, the first of which may have started before
// it. The monitor is where it was in the middle of the interval.
struct MonitorEmission {
  EmissionMonitor monitor;
  std::vector<EmittedPicture> pictures;
};

// Thread-safe: one thread feeds the timeline, others wait and read. A monitor is black before its first
// picture.
class EmissionTimeline {
 public:
  // Pictures are kept for a while, and fewer of them where a monitor's would take more memory.
  explicit EmissionTimeline(nanoseconds kept = std::chrono::seconds(10), size_t max_bytes = size_t{2} << 30)
      : kept_(kept), max_bytes_(max_bytes) {}

  void add_monitor(const EmissionMonitor& monitor);  // a known name is replaced, and its pictures dropped
  void add_picture(const std::string& monitor, EmittedPicture picture);
  // The monitor has this pose from `since` on; times increase. The pose that it was added with is that of the
  // time before.
  void set_pose(const std::string& monitor, nanoseconds since, const PanelPose& pose);
  void set_horizon(const std::string& monitor, nanoseconds until);
  void clear();  // the link broke: drops all monitors

  std::vector<EmissionMonitor> monitors() const;  // where they stand last
  // Waits until every monitor's light is known up to physical time `until`, or for `timeout`. False: timed
  // out, or there are no monitors.
  bool wait_known_until(nanoseconds until, nanoseconds timeout) const;
  // Pictures whose light may overlap [from, until] on any row, by monitor, in the order of monitors().
  // Nothing if some of these are no longer kept.
  std::optional<std::vector<MonitorEmission>> between(nanoseconds from, nanoseconds until) const;

 private:
  struct Track {
    EmissionMonitor monitor;
    std::deque<EmittedPicture> pictures;
    std::deque<std::pair<nanoseconds, PanelPose>> poses;  // from when on; before: the monitor's own
    size_t bytes = 0;                                     // of the pictures
    bool complete = true;                                 // since the monitor was added
    nanoseconds horizon{};

    void forget_first();
    EmissionMonitor at(nanoseconds time) const;
  };
  const nanoseconds kept_;
  const size_t max_bytes_;  // of a monitor's pictures
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  std::vector<Track> tracks_;  // guarded by mutex_
};

}  // namespace glasswing
