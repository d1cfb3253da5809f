// How another node's clock relates to rig time, from four-timestamp exchanges.
//
// An exchange gives sent (rig), received and answered (node), returned (rig). The node's clock read, at the
// middle of the round trip, offset = ((received - sent) + (answered - returned)) / 2, and the true offset is
// within half of the round trip of it, whatever the two delays were (NTP, RFC 5905 section 8).
#pragma once

#include <chrono>
#include <deque>
#include <optional>

#include "core/base/time.h"

namespace glasswing {

struct ClockExchange {
  nanoseconds sent;      // rig time
  nanoseconds received;  // node time
  nanoseconds answered;  // node time
  nanoseconds returned;  // rig time
};

class ClockModel {
 public:
  void add(const ClockExchange& exchange);

  bool ready() const { return !recent_.empty(); }
  // Node time minus rig time, and a bound on its error that holds however the delays were split. The bound
  // widens with the age of the best exchange by the fastest drift we allow for.
  nanoseconds offset() const;
  nanoseconds error_bound(nanoseconds rig_now) const;

  nanoseconds rig_from_node(nanoseconds node_time) const { return node_time - offset(); }
  nanoseconds node_from_rig(nanoseconds rig_time) const { return rig_time + offset(); }

 private:
  struct Sample {
    nanoseconds at, offset, half_trip;
  };
  const Sample& best() const;
  std::deque<Sample> recent_;  // the last kKept
};

}  // namespace glasswing
