// A session of the simulated rig with a small object before letters: what lies beside the object is as sharp
// as the picture behind it.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <thread>

#include "core/composite/compositor.h"
#include "core/pattern/plan.h"
#include "core/pattern/stimulus_kind.h"
#include "core/sim/sensor.h"
#include "core/sim/transport.h"
#include "solver/methods.h"
#include "solver/worker/parallel_solve.h"
#include "tests/gate/floors.h"
#include "tests/gate/light.h"
#include "tests/solver/stack_of.h"

namespace glasswing::gate {
namespace {

// As the rig's: the last rows of the monitor show the id patch.
constexpr Size kPattern{.width_px = 640, .height_px = 480};
constexpr int kPatchRows = 8;
constexpr double kExposure_ms = 4.0;

// A glyph of 5 x 7 px, by rows, the left pixel first.
using Glyph = std::array<std::uint8_t, 7>;
constexpr std::array<Glyph, 9> kGlasswing{{{0b01110, 0b10001, 0b10000, 0b10111, 0b10001, 0b10001, 0b01111},
                                           {0b10000, 0b10000, 0b10000, 0b10000, 0b10000, 0b10000, 0b11111},
                                           {0b01110, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001},
                                           {0b01111, 0b10000, 0b10000, 0b01110, 0b00001, 0b00001, 0b11110},
                                           {0b01111, 0b10000, 0b10000, 0b01110, 0b00001, 0b00001, 0b11110},
                                           {0b10001, 0b10001, 0b10001, 0b10101, 0b10101, 0b11011, 0b10001},
                                           {0b01110, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110},
                                           {0b10001, 0b11001, 0b11001, 0b10101, 0b10011, 0b10011, 0b10001},
                                           {0b01110, 0b10001, 0b10000, 0b10111, 0b10001, 0b10001, 0b01111}}};

// Lines of letters, dark on bright, whose strokes are 1, 2 and 3 px wide in turn.
RadianceImage letters() {
  RadianceImage picture(kPattern.width_px, kPattern.height_px);
  std::ranges::fill(picture.samples, 0.9f);
  int line = 0;
  for (int top = 4; top + 24 < kPattern.height_px; ++line) {
    const int stroke = 1 + line % 3;
    for (int letter = 0; 6 * stroke * (letter + 1) + 4 < kPattern.width_px; ++letter) {
      const Glyph& glyph = kGlasswing[static_cast<size_t>(letter) % kGlasswing.size()];
      for (int y = 0; y < 7 * stroke; ++y) {
        for (int x = 0; x < 5 * stroke; ++x) {
          if ((glyph[y / stroke] >> (4 - x / stroke) & 1) == 0) continue;
          for (int c = 0; c < 3; ++c)
            picture.at(4 + 6 * stroke * letter + x, top + y, c) = 0.1f * static_cast<float>(c);
        }
      }
    }
    top += 9 * stroke;
  }
  return picture;
}

// With the rows of the id patch, which are black.
RadianceImage on_monitor(const RadianceImage& pattern) {
  RadianceImage whole(kPattern.width_px, kPattern.height_px + kPatchRows);
  std::ranges::copy(pattern.samples, whole.samples.begin());
  return whole;
}

class Session {
 public:
  explicit Session(const std::string& plan) {
    const int height = kPattern.height_px + kPatchRows;
    const std::vector<SceneMonitor> monitors{{.name = "back", .size = {kPattern.width_px, height}}};
    empty_ = build_transport("wobble", false, monitors, kPattern.width_px, height).value();
    object_ = build_transport("wobble", true, monitors, kPattern.width_px, height).value();
    v1::Camera& camera = *manifest_.mutable_camera();
    camera.set_width_px(kPattern.width_px);
    camera.set_height_px(height);
    camera.set_bits(model_.bits);
    camera.set_read_sd(model_.read_sd);
    camera.set_gain(model_.gain);
    v1::Monitor& monitor = *manifest_.add_monitors();
    monitor.set_name("back");
    monitor.set_width_px(kPattern.width_px);
    monitor.set_height_px(kPattern.height_px);
    monitor.set_patch_rows(kPatchRows);
    const std::vector<Step> steps = expand(parse_plan(plan, "letters").value(), {monitor}).value();
    for (const Step& step : steps) {
      if (kind_of(step.stimulus) == StimulusKind::kPatch) continue;
      v1::Frame& frame = *manifest_.add_frames();
      frame.set_file(std::to_string(step.number) + ".tif");
      frame.set_object(step.object);
      frame.set_exposure_ms(step.exposure_ms);
      *frame.mutable_stimulus() = step.stimulus;
    }
    frames_.resize(manifest_.frames_size());
    std::atomic<int> next = 0;
    const auto work = [&] {
      for (int i = next++; i < manifest_.frames_size(); i = next++) {
        const v1::Frame& frame = manifest_.frames(i);
        const RadianceImage light = seen(frame.object(), drawn(frame.stimulus(), kPattern));
        frames_[i] = expose(light, kExposure_ms, model_, i);
      }
    };
    std::vector<std::jthread> threads;
    for (unsigned i = 1; i < std::thread::hardware_concurrency(); ++i) threads.emplace_back(work);
    work();
  }

  absl::StatusOr<Matte> solve(const std::string& method) const {
    return solve_in_bands(*make_method(method, {}).value(), manifest_, stack_of(manifest_, frames_));
  }

  // Without noise, on the scale of the frames.
  RadianceImage photograph(const RadianceImage& pattern) const {
    RadianceImage light = seen(true, pattern);
    for (float& sample : light.samples)
      sample *= static_cast<float>(kExposure_ms / model_.full_scale_exposure_ms);
    return light;
  }

  // Whether the object changes nothing.
  bool outside(int x, int y) const {
    const auto same = [](const Tap& a, const Tap& b) {
      return a.x_px == b.x_px && a.y_px == b.y_px && a.weight == b.weight;
    };
    return object_.foreground(x, y, 1) == 0.0f &&
           std::ranges::equal(object_.taps(x, y, 1), empty_.taps(x, y, 1), same);
  }
  // Where the pixel looks without the object: the mean of its rays.
  std::array<double, 2> place(int x, int y) const {
    double u = 0.0, v = 0.0;
    for (const Tap& tap : empty_.taps(x, y, 1)) {
      u += static_cast<double>(tap.weight) * (tap.x_px + 0.5);
      v += static_cast<double>(tap.weight) * (tap.y_px + 0.5);
    }
    return {u, v};
  }

 private:
  RadianceImage seen(bool object, const RadianceImage& pattern) const {
    const std::vector<RadianceImage> shown{on_monitor(pattern)};
    return (object ? object_ : empty_).respond(shown);
  }

  const SensorModel model_;
  Transport empty_, object_;
  v1::CaptureManifest manifest_;
  std::vector<Image16> frames_;
};

TEST(Letters, BesideTheObjectAreAsSharpAsThePicture) {
  const Session session(
      "method: 'gaussian' solids { colour: [0, 0, 0] } solids { colour: [1, 1, 1] } "
      "square_waves { levels: 7 } "
      "sweeps { orientation_deg: 0 sigma_px: 12 step_px: 12 } "
      "sweeps { orientation_deg: 90 sigma_px: 12 step_px: 12 } "
      "sweeps { orientation_deg: 45 sigma_px: 12 step_px: 12 } "
      "exposure_ms: 4");
  const RadianceImage shown = letters(), truth = session.photograph(shown);
  const Matte matte = session.solve("gaussian").value();
  EXPECT_EQ(matte.metadata.warnings_size(), 0) << matte.metadata.warnings(0);
  const RadianceImage composited = composite(matte, {shown}).value();
  double squares_px = 0.0, worst_px = 0.0, squares = 0.0, count = 0.0;
  for (int y = 0; y < kPattern.height_px; ++y) {
    for (int x = 0; x < kPattern.width_px; ++x) {
      if (!session.outside(x, y)) continue;
      const auto [u, v] = session.place(x, y);
      const Mode& mode = matte.modes(x, y, 1)[0];
      const double off_px =
          std::hypot(static_cast<double>(mode.x_px) - u, static_cast<double>(mode.y_px) - v);
      squares_px += off_px * off_px;
      worst_px = std::max(worst_px, off_px);
      for (int c = 0; c < 3; ++c)
        squares += std::pow(static_cast<double>(composited.at(x, y, c) - truth.at(x, y, c)), 2.0) / 3.0;
      count += 1.0;
    }
  }
  const double rms_px = std::sqrt(squares_px / (2.0 * count));
  std::printf("%.0f pixels, centres %.4f px rms, %.2f px at most\n", count, rms_px, worst_px);
  EXPECT_LT(rms_px, 0.05);
  Floors("letters", "gaussian").reached("0.1", "letters", -10.0 * std::log10(squares / count));
}

}  // namespace
}  // namespace glasswing::gate
