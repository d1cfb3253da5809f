// How far long work has got, on standard error: a bar with the time left on a terminal, an occasional
// plain line elsewhere.
#pragma once

#include <chrono>
#include <string>

namespace glasswing {

class Progress {
 public:
  explicit Progress(std::string label);
  ~Progress();  // clears the bar, so that the next line starts clean
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // `fraction` in [0, 1]; `detail` is a few words: "120 of 311 steps".
  void update(double fraction, const std::string& detail = "");

 private:
  using Clock = std::chrono::steady_clock;

  const std::string label_;
  const bool terminal_;
  bool drawn_ = false;
  double first_fraction_ = -1.0;  // where the work stood when first seen
  Clock::time_point first_seen_{};
  Clock::time_point last_written_{};
};

}  // namespace glasswing
