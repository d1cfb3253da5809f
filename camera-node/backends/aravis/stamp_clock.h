// Relates a camera's timestamps, with an unknown clock and meaning, to the start of its exposures on this
// machine's clock, with a bound.
//
// The timestamps at one exposure time differ from the start of the exposures by a constant, except for the
// drift of the camera's clock. For an exposure that was triggered at c, whose timestamp is s and whose data
// shows by q that it had begun,
//
//   c <= start <= q
//
// so over several triggers the constant is at least L = max(c - s) and at most A = min(q - s). The fastest
// trigger response took at most `trigger_delay`, so the constant is at most U = min(L + trigger_delay, A).
// From then on the minimum delay of many frames, min(q - s), shows the drift: it stays A - U to A - L above
// the constant, to within kJitter, or what the triggered frames show if that is more. ClockModel combines all
// these bounds.
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "core/timing/clock_model.h"

namespace glasswing {

struct Sighting {
  nanoseconds stamp{};      // the camera's
  nanoseconds begun_by{};   // CLOCK_MONOTONIC: its data shows that the exposure had begun
  nanoseconds triggered{};  // CLOCK_MONOTONIC: before the trigger was sent
};

class StampClock {
 public:
  static constexpr nanoseconds kJitter = std::chrono::microseconds(500);
  static constexpr int kBlock = 32;  // frames, of which the least delay counts

  // From triggered exposures; at least one. Those that cannot belong to their triggers are left out.
  static StampClock of_triggers(std::vector<Sighting> triggered, nanoseconds trigger_delay);
  // Without triggers: the exposure begins at most `delay` before the data shows it.
  static StampClock of_arrivals(nanoseconds delay);

  // Adds a frame; its trigger is ignored.
  void add(const Sighting& frame);
  // Requires a frame, or triggers.
  ClockReading start_of(nanoseconds stamp) const {
    const ClockReading start = clock_.rig_from_node(stamp);
    return {.time = start.time, .error = std::max(start.error, least_error_)};
  }

 private:
  // Minimum over many: how long after the exposure's start its data shows it.
  nanoseconds min_delay_{}, max_delay_{};
  std::optional<Sighting> least_;  // of this block
  int block_ = 0;
  // What the triggers leave open. Arrivals show the drift, and where they seem to narrow this further it is
  // by chance.
  nanoseconds least_error_{};
  ClockModel clock_;
};

// The start of an exposure whose camera follows this machine's CLOCK_REALTIME by PTP, apart from whole
// seconds (PTP counts leap seconds). `stamp`: as the start would have it. `realtime`: CLOCK_REALTIME -
// CLOCK_MONOTONIC. `known`: the start, from triggers or arrivals. Empty: the two contradict each other.
std::optional<ClockReading> ptp_start(nanoseconds stamp, nanoseconds realtime, const ClockReading& known,
                                      nanoseconds error);

}  // namespace glasswing
