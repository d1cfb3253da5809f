// Progress of long work, on standard error: a bar with the time left on a terminal, otherwise a line every
// few seconds. Short work shows nothing.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

namespace glasswing {

class Progress {
 public:
  using Clock = std::chrono::steady_clock;

  explicit Progress(std::string label, std::function<Clock::time_point()> now = Clock::now);
  ~Progress();  // clears the bar, so that the next line starts clean
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // `fraction` in [0, 1]; `detail` is a few words: "120 of 311 steps".
  void update(double fraction, const std::string& detail = "");
  // For work of unknown size.
  void update_unknown(const std::string& detail = "");
  void clear();  // removes the bar until the next update
  // Reports how long the work took, unless it was short.
  void done(const std::string& detail);

 private:
  bool is_due();
  void write(const std::string& plain, const std::string& bar);
  // Smoothed; negative: not known yet.
  double seconds_left(double fraction);

  const std::string label_;
  const bool terminal_;
  const std::function<Clock::time_point()> now_;
  const Clock::time_point begun_;
  Clock::time_point last_written_;
  bool drawn_ = false;
  // State at the first advance, before which a rig starts, and the expected end.
  double first_fraction_ = -1.0;
  Clock::time_point first_seen_{}, last_seen_{}, end_{};
};

// Shows the elapsed time while waiting for one call.
class Waiting {
 public:
  explicit Waiting(std::string label);
  // Sets the detail to show.
  void tell(std::string detail);
  // Clears the line while `write` writes to the terminal.
  void aside(const std::function<void()>& write);

 private:
  std::mutex mutex_;
  std::condition_variable_any never_;
  Progress progress_;   // guarded by mutex_
  std::string detail_;  // guarded by mutex_
  std::jthread drawing_;
};

// "12 s", "2 min 30 s", "1 h 5 min": rounded coarsely, since it is an estimate.
std::string left_text(double seconds);

// One line of at most `columns` characters. If space is short, the bar is left out first, then the detail.
std::string bar_line(const std::string& label, double fraction, const std::string& detail,
                     const std::string& left, int columns);

}  // namespace glasswing
