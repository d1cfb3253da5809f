// How another node's clock relates to rig time, from four-timestamp exchanges, with guaranteed bounds.
//
// An exchange gives sent (rig), received and answered (node), returned (rig). Whatever the network delays,
// rig time was at least `sent` when the node's clock read `received`, and at most `returned` when it read
// `answered` (NTP, RFC 5905 section 8, expresses the same as one interval). With
//
//   rig(u) = u + c + s u,     |s| <= kMaxSkew
//
// each exchange cuts the plane of (c, s) twice. The region left after many exchanges bounds rig(u) at any u:
// the middle of the bounds is the estimate, half their distance bounds its error. The shortest round trips
// give the tightest cuts; early and late ones together determine the skew.
//
// Crystals wander: s may change by kWander while an exchange is remembered, so its cut widens with its age.
// An empty region means that the clock was set or the node restarted; the oldest exchanges are then dropped.
#pragma once

#include <chrono>
#include <deque>

#include "core/base/time.h"

namespace glasswing {

struct ClockExchange {
  nanoseconds sent;      // rig time
  nanoseconds received;  // node time
  nanoseconds answered;  // node time
  nanoseconds returned;  // rig time
};

// A time on the other clock; the true time is within `error` of it.
struct ClockReading {
  nanoseconds time{};
  nanoseconds error{};
};

class ClockModel {
 public:
  static constexpr double kMaxSkew = 250e-6;  // two poor crystals, one of them cold
  static constexpr double kWander = 2e-6;

  void add(const ClockExchange& exchange);

  // False before the first exchange; the readings below require it.
  bool ready() const { return !recent_.empty(); }
  ClockReading rig_from_node(nanoseconds node_time) const;
  ClockReading node_from_rig(nanoseconds rig_time) const;
  // The middle of the possible skews: 1e-6 is 1 ppm, positive if the node's clock is slow.
  double skew() const { return 0.5 * (min_skew_ + max_skew_); }

 private:
  // Bounds on rig - node at two node times, relative to origin_: at least `min` at min_at, at most `max`
  // at max_at.
  struct Cut {
    double min_at, min, max_at, max;
  };
  // The bounds of rig - node at node time `at`, given a skew.
  double highest(double at, double skew) const;
  double lowest(double at, double skew) const;
  bool find_skews();

  std::deque<ClockExchange> recent_;
  nanoseconds origin_node_{}, origin_offset_{};  // of the newest exchange
  std::deque<Cut> cuts_;
  double min_skew_ = -kMaxSkew, max_skew_ = kMaxSkew;
};

}  // namespace glasswing
