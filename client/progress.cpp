#include "client/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "client/output.h"

namespace glasswing {
namespace {

constexpr int kBarCells = 30;
constexpr std::chrono::milliseconds kRedraw(100);
constexpr std::chrono::seconds kPlainLine(5);

}  // namespace

Progress::Progress(std::string label) : label_(std::move(label)), terminal_(::isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() {
  if (drawn_) std::fputs("\r\x1b[K", stderr);
}

void Progress::update(double fraction, const std::string& detail) {
  const Clock::time_point now = Clock::now();
  fraction = std::clamp(fraction, 0.0, 1.0);
  if (first_fraction_ < 0.0) {
    first_fraction_ = fraction;
    first_seen_ = now;
    if (!terminal_) last_written_ = now;  // short work stays silent in a log
  }
  if (now - last_written_ < (terminal_ ? Clock::duration(kRedraw) : Clock::duration(kPlainLine))) return;
  last_written_ = now;

  const double elapsed_s = std::chrono::duration<double>(now - first_seen_).count();
  const double advanced = fraction - first_fraction_;
  std::string left;
  if (elapsed_s > 1.0 && advanced > 0.01) {
    left = seconds_text(elapsed_s / advanced * (1.0 - fraction)) + " left";
  }
  if (terminal_) {
    const int full = static_cast<int>(fraction * kBarCells);
    fmt::print(stderr, "\r{} [{:#>{}}{:.>{}}] {:3.0f} %  {}  {}\x1b[K", label_, "", full, "",
               kBarCells - full, fraction * 100.0, detail, left);
    std::fflush(stderr);
    drawn_ = true;
  } else {
    fmt::print(stderr, "{}: {:.0f} %{}{}{}{}\n", label_, fraction * 100.0, detail.empty() ? "" : ", ", detail,
               left.empty() ? "" : ", ", left);
  }
}

}  // namespace glasswing
