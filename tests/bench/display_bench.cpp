// The time that a display node takes for a picture of 3840 x 2160, with dither and id patch, on two threads:
// wall time from one picture to the next while a program of stripes is drawn.
#include <algorithm>
#include <chrono>
#include <vector>

#include "core/process/freed_memory.h"
#include "core/radiometry/tone_curve.h"
#include "display-node/playback/picture_queue.h"
#include "tests/bench/rows.h"

namespace glasswing {
namespace {

constexpr int kStripes = 60;
const ScreenInfo kScreen = [] {
  ScreenInfo screen{.name = "back", .width_px = 3840, .height_px = 2160};
  screen.bits = 8;
  screen.patch_rows = 64;
  return screen;
}();

// Stripes of four directions across the whole screen. Too many to be drawn when the program is loaded.
Program stripes(double sigma_px) {
  v1::LoadProgramRequest request;
  request.set_program("stripes");
  request.set_hold_refreshes(2);
  v1::DisplayCalibration& calibration = *request.add_calibrations();
  calibration.set_format_version(1);
  calibration.set_monitor(kScreen.name);
  calibration.set_bits(kScreen.bits);
  calibration.set_width_px(kScreen.width_px);
  calibration.set_height_px(kScreen.height_px - kScreen.patch_rows);
  const ToneCurve curve = ToneCurve::power(2.2, kScreen.bits);
  for (int c = 0; c < 3; ++c) {
    v1::ToneCurve& primary = *calibration.add_primaries();
    for (const double radiance : curve.radiances()) primary.add_radiance(static_cast<float>(radiance));
  }
  for (int i = 0; i < kStripes; ++i) {
    v1::ProgramStep& step = *request.add_steps();
    step.set_step(i);
    step.set_patch_id(static_cast<std::uint32_t>(i));
    v1::Stimulus& stripe = *step.add_stimuli();
    stripe.set_kind("gauss_stripe");
    stripe.set_panel(kScreen.name);
    stripe.set_peak(1.0);
    stripe.set_sigma_px(sigma_px);
    stripe.set_phi_deg(45.0 * (i % 4));
    stripe.set_r_px(i % 4 == 3 ? -400.0 + 10.0 * i : 400.0 + 25.0 * i);
  }
  return Program::create(request, {kScreen}, ImageStore()).value();
}

double median_ms(double sigma_px) {
  const Program program = stripes(sigma_px);
  PictureQueue queue(program, 2);
  std::vector<double> times;
  auto before = std::chrono::steady_clock::now();
  for (int i = 0; i < kStripes; i += 2) {
    // Two threads finish two at a time.
    queue.next();
    queue.next();
    const auto now = std::chrono::steady_clock::now();
    times.push_back(std::chrono::duration<double, std::milli>(now - before).count() / 2.0);
    before = now;
  }
  times.erase(times.begin(), times.begin() + 5);  // drawn when the program was loaded
  std::ranges::nth_element(times, times.begin() + times.size() / 2);
  return times[times.size() / 2];
}

}  // namespace
}  // namespace glasswing

int main() {
  glasswing::keep_freed_memory(glasswing::LargeBlocks::kPictures);  // as glasswing-display does
  using glasswing::median_ms, glasswing::print_row;
  print_row("display, 3840x2160: a stripe of sigma 8 px, two threads", median_ms(8.0), "ms");
  print_row("display, 3840x2160: a stripe of sigma 60 px, two threads", median_ms(60.0), "ms");
  print_row("display, 3840x2160: a stripe of sigma 200 px, two threads", median_ms(200.0), "ms");
}
