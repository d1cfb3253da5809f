// What the monitors really emitted, from when to when, in physical time. A picture's rows leave one after the
// other: row y of H turns to it at t = scanout_start + y/H * scanout + lag, until the next picture's row y
// does. The light goes linearly from one picture to the next: i has the weight r(t - t_i) - r(t - t_i+1),
// where r(u) = u / settle within [0, 1]. All of it flickers as the backlight does.
#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/base/time.h"
#include "core/frame/image.h"
#include "core/sim/flicker.h"

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
};

// One monitor's light during some interval: consecutive pictures, the first of which may have started
// earlier.
struct MonitorEmission {
  EmissionMonitor monitor;
  std::vector<EmittedPicture> pictures;
};

// Thread-safe: one thread feeds it, others wait and read. Before the first picture a monitor is black.
class EmissionTimeline {
 public:
  explicit EmissionTimeline(nanoseconds kept = std::chrono::seconds(10)) : kept_(kept) {}

  void add_monitor(const EmissionMonitor& monitor);  // again: replaces it, and its pictures are forgotten
  void add_picture(const std::string& monitor, EmittedPicture picture);
  void set_horizon(const std::string& monitor, nanoseconds until);
  void clear();  // the link broke: all monitors gone

  std::vector<EmissionMonitor> monitors() const;
  // Waits until every monitor's light is known up to physical time `until`, or for `timeout`. False: timed
  // out, or there are no monitors.
  bool wait_known_until(nanoseconds until, nanoseconds timeout) const;
  // Light that may touch [from, until] anywhere on each monitor, in the order of monitors().
  std::vector<MonitorEmission> between(nanoseconds from, nanoseconds until) const;

 private:
  struct Track {
    EmissionMonitor monitor;
    std::deque<EmittedPicture> pictures;
    nanoseconds horizon{};
  };
  const nanoseconds kept_;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  std::vector<Track> tracks_;  // guarded by mutex_
};

}  // namespace glasswing
