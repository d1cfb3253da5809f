#include "solver/corrections/quarters.h"

#include <algorithm>
#include <cmath>

#include "solver/frames/frame_statistics.h"

namespace glasswing {
namespace {

constexpr double kAlike = 0.3, kAlikeSds = 3.0;  // of what is found, and errors
constexpr size_t kMinVotes = 5;                  // frames

bool is_alike(double own, double whole, double sd) {
  return std::abs(own - whole) < kAlike * std::abs(whole) + kAlikeSds * sd;
}

}  // namespace

bool Quarters::say_ghosts(const FrameReport& whole) const {
  return std::ranges::all_of(reports(), [&](const FrameReport& own) {
    return is_alike(own.ghost[0].value, whole.ghost[0].value, own.ghost[0].sd);
  });
}

bool Quarters::say_flare(const FrameReport& whole) const {
  return std::ranges::all_of(reports(), [&](const FrameReport& own) {
    return is_alike(own.flare.value, whole.flare.value, own.flare.sd);
  });
}

bool Quarters::say_gains(const std::vector<GainStep>& steps, double scale) const {
  int voters = 0;
  for (const FrameReport& own : reports()) {
    double squares = 0.0, products = 0.0, variance = 0.0;
    size_t count = 0;
    for (const GainStep& step : steps) {
      const FrameMeasure& measure = own.frames[step.frame];
      const double away = step.gain - scale;
      if (!measure.measured) continue;
      squares += away * away;
      products += away * (mean_of(measure.gain) - scale);
      variance += away * away * (measure.gain_sd * measure.gain_sd + step.sd * step.sd);
      ++count;
    }
    if (count < kMinVotes) continue;
    if (!is_alike(products / squares, 1.0, std::sqrt(variance) / squares)) return false;
    ++voters;
  }
  return voters > 1;
}

bool Quarters::say_offset(int frame, double offset) const {
  return std::ranges::all_of(reports(), [&](const FrameReport& own) {
    const FrameMeasure& measure = own.frames[frame];
    return !measure.dark || is_alike(mean_of(measure.offset), offset, measure.offset_sd);
  });
}

const std::vector<FrameReport>& Quarters::reports() const {
  if (!reports_.empty()) return reports_;
  for (const std::vector<bool>& quarter : quarters_of(compared_.samples, compared_.beside))
    reports_.push_back(report_frames(manifest_, compared_, quarter, removed_));
  return reports_;
}

}  // namespace glasswing
