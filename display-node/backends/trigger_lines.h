// The kinds of trigger lines, each named by --line:
//
//   command:PROGRAM ARGUMENTS   a program that is started once and raises the line whenever it reads a line
//   of
//                               text from its standard input
//   serial:DEVICE               the RTS output of a serial port: asserted for a millisecond
//   gpio:DEVICE:LINE            an output of a GPIO chip, such as gpio:/dev/gpiochip0:17
//
// For the last two, ",inverted" swaps the two levels: serial adapters with TTL levels pull RTS low when it is
// asserted.
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "display-node/trigger_line.h"

namespace glasswing {

// The line is low when this returns. INVALID_ARGUMENT: it is none of these. FAILED_PRECONDITION: the device
// or program cannot be used; the message says why.
absl::StatusOr<std::unique_ptr<TriggerLine>> open_trigger_line(const std::string& text);

}  // namespace glasswing
