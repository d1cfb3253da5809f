#include "solver/ramp/smoother/ramp_smoother_refine.h"

#include <algorithm>

#include "core/base/for_rows.h"

namespace glasswing {
namespace {

constexpr int kRows = 32;  // at a time, so that everything stays in the cache
constexpr int kFirstRadius_px = 1, kSecondRadius_px = 2;
constexpr int kRim = kFirstRadius_px + kSecondRadius_px;  // rows used above and below

// A few rows of the picture's area with a rim.
class Strip {
 public:
  Strip(const SmoothPilot& pilot, const SmoothState& coarse) : pilot_(pilot), coarse_(coarse) {
    area_ = pilot.fine->area;
    area_.height = kRows + 2 * kRim;
    resize(samples_, area_.size());
    resize(narrow_, area_.size());
    for (Plane& plane : refined_.value) plane.resize(area_.size());
    refined_.info.resize(area_.size());
  }

  // Rows [first, last) of the fine area, at most kRows.
  void refine(int first, int last, RampFrame& frame) {
    const SmoothFine& fine = *pilot_.fine;
    const int rows = last - first;
    area_.y0 = fine.area.y0 + first - kRim;
    take(first - kRim, rows + 2 * kRim);
    internal::SmoothStep step{.area = area_,
                              .radius = kFirstRadius_px,
                              .rho_info = fine.rho_info,
                              .samples = &samples_,
                              .after = &narrow_};
    internal::smooth_rows(step, kFirstRadius_px, rows + 2 * kRim - kFirstRadius_px);
    step.radius = kSecondRadius_px;
    step.before = &narrow_;
    step.after = &refined_;
    internal::refine_rows({.fine = step, .coarse_area = pilot_.area, .coarse = &coarse_}, kRim, kRim + rows);
    put_rows(pilot_.straight, area_, samples_, fine.rho_info, refined_, kRim, kRim + rows, frame);
  }

 private:
  void take(int first, int count) {
    const SmoothSamples& from = pilot_.fine->samples;
    const auto copy = [&](const Plane& plane, Plane& to) {
      for (int y = 0; y < count; ++y)
        std::copy_n(&plane[pilot_.fine->area.at(0, first + y)], area_.width, &to[area_.at(0, y)]);
    };
    for (size_t k = 0; k < 3; ++k) copy(from.value[k], samples_.value[k]);
    copy(from.info, samples_.info);
    copy(from.object, samples_.object);
  }

  const SmoothPilot& pilot_;
  const SmoothState& coarse_;
  SmoothArea area_;
  SmoothSamples samples_;
  SmoothState narrow_, refined_;
};

}  // namespace

void refine(const SmoothPilot& pilot, const SmoothState& state, int thread_count, RampFrame& frame) {
  for_rows(pilot.fine->area.height, thread_count, [&](int first, int last) {
    Strip strip(pilot, state);
    for (int y = first; y < last; y += kRows) strip.refine(y, std::min(y + kRows, last), frame);
  });
}

}  // namespace glasswing
