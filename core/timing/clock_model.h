// How another node's clock relates to rig time, from four-timestamp exchanges, with bounds that hold.
//
// An exchange gives sent (rig), received and answered (node), returned (rig). Whatever the delays were, rig
// time was at least `sent` when the node's clock read `received`, and at most `returned` when it read
// `answered` (NTP, RFC 5905 section 8, has the same facts as one interval). So with
//
//   rig(u) = u + c + s u,     |s| <= kMaxSkew
//
// each exchange cuts the plane of (c, s) twice. What is left of it after many exchanges says between which
// bounds rig(u) lies at any u: the middle is the estimate, half of the distance the bound on its error. The
// shortest trips cut closest; early and late ones together tell the skew.
//
// Crystals wander: s may change by kWander while an exchange is remembered, which widens its cut with its
// age. If nothing is left the clock was set or the node started again; then the oldest exchanges are
// forgotten.
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

// A time on the other clock. The true one is within `error`.
struct ClockReading {
  nanoseconds time{};
  nanoseconds error{};
};

class ClockModel {
 public:
  static constexpr double kMaxSkew = 250e-6;  // two poor crystals, one of them cold
  static constexpr double kWander = 2e-6;

  void add(const ClockExchange& exchange);

  // The rest only after the first exchange.
  bool ready() const { return !recent_.empty(); }
  ClockReading rig_from_node(nanoseconds node_time) const;
  ClockReading node_from_rig(nanoseconds rig_time) const;
  // The middle of what is possible: 1e-6 is 1 ppm, positive if the node's clock is slow.
  double skew() const { return 0.5 * (min_skew_ + max_skew_); }

 private:
  // rig - node at two node times, relative to origin_: not less than `least` at the one, not more than `most`
  // at the other.
  struct Cut {
    double min_at, least, max_at, most;
  };
  // The bounds of rig - node at `at` if the skew is s.
  double highest(double at, double skew) const;
  double lowest(double at, double skew) const;
  bool find_skews();

  std::deque<ClockExchange> recent_;
  nanoseconds origin_node_{}, origin_offset_{};  // of the newest exchange
  std::deque<Cut> cuts_;
  double min_skew_ = -kMaxSkew, max_skew_ = kMaxSkew;
};

}  // namespace glasswing
