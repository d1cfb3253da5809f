#include "core/cli/progress.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/base/utf8.h"
#include "core/cli/output.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kShort(500);          // shorter work shows nothing
constexpr milliseconds kWorthTelling(2000);  // longer work reports its duration
constexpr milliseconds kRedraw(100);
constexpr milliseconds kPlainLine(5000);
constexpr double kSettle_s = 3.0;  // time constant of the time left
constexpr int kMinBarCells = 10, kMaxBarCells = 30;

double seconds_of(Progress::Clock::duration time) {
  return std::chrono::duration<double>(time).count();
}

int terminal_columns() {
  winsize size{};
  return ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

std::string joined(const std::string& text, const char* between, const std::string& more) {
  return more.empty() ? text : text + between + more;
}

}  // namespace

std::string left_text(double seconds) {
  const long coarse = seconds < 20.0 ? 1 : seconds < 120.0 ? 5 : seconds < 3600.0 ? 30 : 300;
  const long whole = static_cast<long>(std::ceil(seconds / static_cast<double>(coarse) - 1e-6)) * coarse;
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600)
    return fmt::format("{} min{}", whole / 60, whole % 60 ? fmt::format(" {} s", whole % 60) : "");
  return fmt::format("{} h {} min", whole / 3600, whole % 3600 / 60);
}

std::string bar_line(const std::string& label, double fraction, const std::string& detail,
                     const std::string& left, int columns) {
  const std::string percent = fmt::format("{:3.0f} %", std::floor(fraction * 100.0));
  const std::string time = left.empty() ? "" : left + " left";
  for (const std::string& middle : {detail, std::string()}) {
    const std::string rest = joined(joined(percent, "  ", middle), "  ", time);
    const int room = columns - static_cast<int>(label.size() + rest.size());
    const int cells = std::min(room - 4, kMaxBarCells);  // less a space and a bracket on each side
    const int full = static_cast<int>(fraction * cells);
    if (cells >= kMinBarCells)
      return fmt::format("{} [{:#>{}}{:.>{}}] {}", label, "", full, "", cells - full, rest);
    if (room >= 1) return label + " " + rest;
  }
  return percent.substr(0, std::max(columns, 0));
}

Progress::Progress(std::string label, std::function<Clock::time_point()> now)
    : label_(std::move(label)),
      terminal_(::isatty(STDERR_FILENO) == 1),
      now_(std::move(now)),
      begun_(now_()),
      // The first line is due after kShort (terminal) or kPlainLine.
      last_written_(terminal_ ? begun_ + kShort - kRedraw : begun_) {}

Progress::~Progress() {
  clear();
}

void Progress::clear() {
  if (drawn_) std::fputs("\r\x1b[K", stderr);
  drawn_ = false;
}

bool Progress::is_due() {
  const Clock::time_point now = now_();
  if (now - last_written_ < (terminal_ ? kRedraw : kPlainLine)) return false;
  last_written_ = now;
  return true;
}

void Progress::write(const std::string& plain, const std::string& bar) {
  if (terminal_) {
    // A full last column would wrap on some terminals.
    fmt::print(stderr, "\r{}\x1b[K", printable(bar));
    drawn_ = true;
  } else {
    fmt::print(stderr, "{}\n", printable(plain));
  }
  std::fflush(stderr);
}

double Progress::seconds_left(double fraction) {
  const Clock::time_point now = now_();
  if (last_seen_ == Clock::time_point()) {  // no advance yet
    if (first_fraction_ >= 0.0 && fraction > first_fraction_) last_seen_ = now;
    first_fraction_ = fraction;
    first_seen_ = now;
  }
  const double elapsed_s = seconds_of(now - first_seen_), advanced = fraction - first_fraction_;
  if (elapsed_s < 1.0 || advanced < 0.01) return -1.0;
  const auto end = now + std::chrono::duration_cast<Clock::duration>(
                             std::chrono::duration<double>(elapsed_s / advanced * (1.0 - fraction)));
  const double weight = std::min(1.0, seconds_of(now - last_seen_) / kSettle_s);
  last_seen_ = now;
  end_ = end_ == Clock::time_point()
             ? end
             : end_ + std::chrono::duration_cast<Clock::duration>((end - end_) * weight);
  return std::max(0.0, seconds_of(end_ - now));
}

void Progress::update(double fraction, const std::string& detail) {
  fraction = std::clamp(fraction, 0.0, 1.0);
  const double left_s = seconds_left(fraction);
  if (!is_due()) return;
  const std::string left = left_s >= 0.0 ? left_text(left_s) : "";
  write(joined(joined(fmt::format("{}: {:.0f} %", label_, std::floor(fraction * 100.0)), ", ", detail), ", ",
               left.empty() ? "" : left + " left"),
        bar_line(label_, fraction, detail, left, terminal_columns() - 1));
}

void Progress::update_unknown(const std::string& detail) {
  if (!is_due()) return;
  const std::string line =
      fmt::format("{}: {}, {:.0f} s so far", label_, detail, seconds_of(now_() - begun_));
  const std::string bare = fmt::format("{}: {:.0f} s so far", label_, seconds_of(now_() - begun_));
  const size_t columns = std::max(terminal_columns() - 1, 0);
  write(detail.empty() ? bare : line,
        detail.empty() || line.size() > columns ? bare.substr(0, columns) : line);
}

void Progress::done(const std::string& detail) {
  clear();
  const Clock::duration taken = now_() - begun_;
  if (taken >= kWorthTelling)
    fmt::print(stderr, "{}\n",
               printable(fmt::format("{}: {} in {}", label_, detail, seconds_text(seconds_of(taken)))));
}

Waiting::Waiting(std::string label) : progress_(std::move(label)) {
  drawing_ = std::jthread([this](std::stop_token stop) {
    std::unique_lock lock(mutex_);
    while (!never_.wait_for(lock, stop, kShort, [&] { return stop.stop_requested(); }))
      progress_.update_unknown(detail_);
  });
}

void Waiting::tell(std::string detail) {
  const std::lock_guard lock(mutex_);
  detail_ = std::move(detail);
}

void Waiting::aside(const std::function<void()>& write) {
  const std::lock_guard lock(mutex_);
  progress_.clear();
  write();
}

}  // namespace glasswing
