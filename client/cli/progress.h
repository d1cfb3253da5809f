// How far long work has got, on standard error: on a terminal a bar with the time left, elsewhere a plain
// line now and then. Work that is soon done shows nothing.
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
  // Where nobody knows how much there is to do.
  void update_unknown(const std::string& detail = "");
  void clear();  // until the next update
  // The work is complete: says how long it took, if that was long.
  void done(const std::string& detail);

 private:
  bool is_due();
  void write(const std::string& plain, const std::string& bar);
  // Smoothed, so that it does not jump; negative: not known yet.
  double seconds_left(double fraction);

  const std::string label_;
  const bool terminal_;
  const std::function<Clock::time_point()> now_;
  const Clock::time_point begun_;
  Clock::time_point last_written_;
  bool drawn_ = false;
  // Where the work stood when first seen, and when it is expected to end.
  double first_fraction_ = -1.0;
  Clock::time_point first_seen_{}, last_seen_{}, end_{};
};

// Shows that something goes on, and for how long, while one call is waited for.
class Waiting {
 public:
  explicit Waiting(std::string label);
  // `detail` is shown from now on.
  void tell(std::string detail);
  // Clears the line for as long as `write` writes something else to the terminal.
  void aside(const std::function<void()>& write);

 private:
  std::mutex mutex_;
  std::condition_variable_any never_;
  Progress progress_;   // guarded by mutex_
  std::string detail_;  // guarded by mutex_
  std::jthread drawing_;
};

// "12 s", "2 min 30 s", "1 h 5 min": coarse, as guesses are.
std::string left_text(double seconds);

// One line of at most `columns` characters. What there is no room for is left out: first the bar, then the
// detail.
std::string bar_line(const std::string& label, double fraction, const std::string& detail,
                     const std::string& left, int columns);

}  // namespace glasswing
