// Statistics of live compositing.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/timing/clock_model.h"
#include "glasswing/v1/live_service.pb.h"

namespace glasswing {

// Latency is glass to glass: from a frame's exposure until its composite is delivered. The exposure starts
// with its first row; its middle is half way to the end of its last row.
class LiveFigures {
 public:
  // Times are in this program's clock.
  void add(const v1::LiveFrame& frame, ClockReading exposure_start, ClockReading exposure_end,
           nanoseconds shown);

  size_t frames() const { return from_middle_ms_.size(); }
  // "31.2 frames/s, latency 42 ms (95 %: 55, worst 71) from the exposure's middle, ..."
  std::string line() const;
  nlohmann::json json() const;

 private:
  double frames_per_second() const;

  std::vector<double> from_middle_ms_, from_start_ms_, solve_ms_;
  nanoseconds first_{}, last_{};
  std::int64_t passed_over_before_ = 0;
  double clock_error_ms_ = 0.0;
  v1::LiveFrame newest_;  // without its picture
};

}  // namespace glasswing
