// When a frame was exposed, told from the one time stamp that a driver gives it.
//
// A stamp t may mean several things, and how long after that data arrive is seldom known. What is known: the
// first row began no earlier than t - early, the last row ended no later than t + late, and never after the
// frame was complete on this machine.
//
//   stamp      early               late                 t is when
//   start      0                   exposure + readout   the first row's exposure began
//   readout    exposure            readout              it ended, and its readout began
//   arrival    exposure + delay    readout              its data reached this machine, at most `delay` later
//   unknown    exposure + delay    exposure + readout   one of these
//
// The window told is as long as exposure + readout, in the middle of [t - early, t + late]; the rest is its
// uncertainty.
#pragma once

#include <optional>

#include "core/base/time.h"

namespace glasswing {

// This machine's clocks, read together: BOOTTIME was read between two readings of MONOTONIC.
struct ClockReadings {
  nanoseconds before{}, boot{}, after{};
};
ClockReadings read_clocks();

struct Stamp {
  nanoseconds time{};  // CLOCK_MONOTONIC
  nanoseconds uncertainty{};
};
// libcamera calls its stamps CLOCK_BOOTTIME, but hands on what drivers gave it, and most read
// CLOCK_MONOTONIC. The two differ by the time that the machine has slept since it booted. A frame is fresh
// when it comes: the clock is the one by which the stamp lies in the last second, and where both do, the
// stamp may be either. None: by neither clock does it.
std::optional<Stamp> monotonic_stamp(nanoseconds stamp, const ClockReadings& now);

enum class StampMeaning { kUnknown, kStart, kReadout, kArrival };

struct SensorTiming {
  StampMeaning stamp = StampMeaning::kUnknown;
  nanoseconds readout{};  // from the first row's start to the last row's start
  nanoseconds delay{};    // at most, from the first row's readout to its data's arrival
};

struct ExposureTime {
  nanoseconds start{}, end{};  // of the first row, of the last row
  nanoseconds uncertainty{};   // of both
};
ExposureTime exposure_time(const Stamp& stamp, nanoseconds exposure, const SensorTiming& timing,
                           nanoseconds complete);

}  // namespace glasswing
