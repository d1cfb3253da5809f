// Computes when a frame was exposed from the one time stamp that its driver gives.
//
// The meaning of a stamp t depends on the driver, and the delay until data arrives is seldom known. The
// bounds: the first row's exposure began no earlier than t - early; the last row's ended no later than t +
// late, and not after the frame was complete on this machine.
//
//   stamp      early               late                 t is when
//   start      0                   exposure + readout   the first row's exposure began
//   readout    exposure            readout              it ended, and its readout began
//   arrival    exposure + delay    readout              its data reached this machine, at most `delay` later
//   unknown    exposure + delay    exposure + readout   one of these
//
// The computed window is exposure + readout long and centred in [t - early, t + late]; the margin on each
// side is its uncertainty.
#pragma once

#include <optional>

#include "core/base/time.h"

namespace glasswing {

// This machine's clocks, read together: BOOTTIME between two readings of MONOTONIC.
struct ClockReadings {
  nanoseconds before{}, boot{}, after{};
};
ClockReadings read_clocks();

struct Stamp {
  nanoseconds time{};  // CLOCK_MONOTONIC
  nanoseconds uncertainty{};
};
// Finds which clock a stamp was read from. libcamera documents CLOCK_BOOTTIME but passes on the drivers'
// stamps, and most drivers read CLOCK_MONOTONIC; the two differ by the time the machine has slept since boot.
// A new frame's stamp lies in the last second of its clock. If that holds for both clocks, the result covers
// either. None: it holds for neither.
std::optional<Stamp> monotonic_stamp(nanoseconds stamp, const ClockReadings& now);

enum class StampMeaning { kUnknown, kStart, kReadout, kArrival };

struct SensorTiming {
  StampMeaning stamp = StampMeaning::kUnknown;
  nanoseconds readout{};  // from the first row's start to the last row's start
  nanoseconds delay{};    // max, from the first row's readout to the arrival of its data
};

struct ExposureTime {
  nanoseconds start{}, end{};  // start of the first row, end of the last row
  nanoseconds uncertainty{};   // of both
};
// `complete`: when the whole frame was in memory.
ExposureTime exposure_time(const Stamp& stamp, nanoseconds exposure, const SensorTiming& timing,
                           nanoseconds complete);

}  // namespace glasswing
