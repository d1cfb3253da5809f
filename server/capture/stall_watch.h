// Detects that pictures are shown but nothing is being proven any more. Makes no calls and reads no clock.
#pragma once

#include <optional>

#include "core/base/time.h"

namespace glasswing {

class StallWatch {
 public:
  // Consecutive steps without a proof that cannot be chance: if every second one is proven, such a run occurs
  // once in a million.
  static constexpr int kSteps = 20;

  // `step`: how long a step is on screen; `frame_wait`: how long its frame may take to arrive.
  StallWatch(nanoseconds step, nanoseconds frame_wait) : step_(step), frame_wait_(frame_wait) {}

  // The next program begins. Time between programs does not count. `held_back`: pictures that it shows before
  // the first frame can be judged.
  void begin_program(int held_back) {
    held_back_ = held_back;
    looked_ = std::nullopt;
  }
  // To be called repeatedly while the program plays. `proven`: steps with a proof.
  bool is_stalled(nanoseconds now, int proven) {
    if (proven != proven_) unproven_ = nanoseconds(0);
    unproven_ += now - looked_.value_or(now);
    proven_ = proven;
    looked_ = now;
    return unproven_ > (kSteps + held_back_) * step_ + frame_wait_;
  }

 private:
  const nanoseconds step_, frame_wait_;
  int held_back_ = 0, proven_ = 0;
  nanoseconds unproven_{};             // time played since the last proof
  std::optional<nanoseconds> looked_;  // in this program
};

}  // namespace glasswing
