// Responses from synthetic photographs, whose light is known.
#include "core/import/response_estimate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "core/image/image_file.h"

namespace glasswing {
namespace {

constexpr int kPixels = 4000;
using Code = std::function<double(double)>;

Code power(double gamma) {
  return [gamma](double light) { return std::pow(light, 1.0 / gamma); };
}
double srgb(double light) {
  return static_cast<double>(srgb_of_linear(static_cast<float>(light)));
}

// Pixels that see `lit` of the monitor's light between their own black and white.
class Photographs {
 public:
  explicit Photographs(Code code, double black = 0.0) : code_(std::move(code)), black_(black) {}

  void add(const v1::Stimulus& stimulus, const std::function<double(int)>& lit, double exposure_ms = 0.0) {
    v1::Frame& frame = *manifest.add_frames();
    *frame.mutable_stimulus() = stimulus;
    frame.set_object(true);
    frame.set_exposure_ms(exposure_ms);
    const double time = exposure_ms > 0.0 ? exposure_ms / 10.0 : 1.0;
    std::vector<float>& all = codes.emplace_back();
    for (int i = 0; i < kPixels; ++i) {
      const double white = 0.3 + 0.6 * (i % 97) / 97.0, dark = 0.02 + 0.03 * (i % 13) / 13.0;
      const double code =
          black_ + (1.0 - black_) * code_(std::min(1.0, time * (dark + (white - dark) * lit(i))));
      all.push_back(static_cast<float>(std::round(255.0 * code + noise_(random_)) / 255.0));
    }
  }
  void add_solid(double level, double exposure_ms = 0.0) {
    v1::Stimulus stimulus;
    stimulus.set_kind("solid");
    for (int c = 0; c < 3; ++c) stimulus.add_colour(level);
    add(
        stimulus, [level](int) { return level; }, exposure_ms);
  }
  // Bars of this width and their complement; every `blurred`-th pixel sees an edge.
  void add_bars(double width_px, int blurred) {
    for (const bool inverse : {false, true}) {
      v1::Stimulus stimulus;
      stimulus.set_kind("square");
      stimulus.set_orient("vertical_bars");
      stimulus.set_bar_width_px(width_px);
      stimulus.set_inverse(inverse);
      add(stimulus, [=](int i) {
        const double lit = i % blurred == 0 ? (i / blurred % 31) / 31.0 : i / 7 % 2;
        return inverse ? 1.0 - lit : lit;
      });
    }
  }
  void add_fringes(int steps) {
    for (int step = 0; step < steps; ++step) {
      v1::Stimulus stimulus;
      stimulus.set_kind("sinusoid");
      stimulus.set_period_px(20);
      stimulus.set_peak(1.0);
      stimulus.set_phase_deg(360.0 * step / steps);
      add(stimulus,
          [=](int i) { return 0.5 + 0.5 * std::cos(0.37 * i - 2.0 * std::numbers::pi * step / steps); });
    }
  }
  ResponseEstimate estimate() const { return estimate_response(manifest, codes, black_); }

  v1::CaptureManifest manifest;
  std::vector<std::vector<float>> codes;

 private:
  Code code_;
  double black_;
  std::mt19937 random_{5};
  std::normal_distribution<double> noise_{0.0, 0.6};
};

Photographs bars(const Code& code, double black = 0.0, int blurred = 3) {
  Photographs photographs(code, black);
  photographs.add_solid(1.0);
  photographs.add_solid(0.0);
  for (const double width_px : {2.0, 4.0, 8.0}) photographs.add_bars(width_px, blurred);
  return photographs;
}

// Half of what separates linear from another curve.
constexpr double kNear = 0.05;

TEST(ResponseEstimate, ComplementsTellTheCurve) {
  for (const double gamma : {0.6, 1.0, 1.5, 2.2}) {
    for (const double black : {0.0, 0.05}) {
      const ResponseEstimate estimate = bars(power(gamma), black).estimate();
      EXPECT_NEAR(estimate.gamma, gamma, kNear) << estimate.reason;
      EXPECT_LT(estimate.error, kNear);
      if (gamma == 1.0) {
        EXPECT_EQ(estimate.response, "linear");
      } else {
        EXPECT_TRUE(estimate.response.starts_with("gamma:")) << estimate.response;
      }
    }
  }
  EXPECT_EQ(bars(srgb).estimate().response, "srgb");
}

TEST(ResponseEstimate, StepsOfFringesTellTheCurve) {
  for (const int steps : {4, 8}) {
    Photographs photographs(power(1.8));
    photographs.add_fringes(steps);
    EXPECT_NEAR(photographs.estimate().gamma, 1.8, kNear) << photographs.estimate().reason;
  }
}

TEST(ResponseEstimate, LevelsTellTheCurve) {
  Photographs photographs(power(2.2));
  for (const double level : {0.0, 0.2, 0.5, 0.8, 1.0}) photographs.add_solid(level);
  EXPECT_NEAR(photographs.estimate().gamma, 2.2, kNear) << photographs.estimate().reason;
}

TEST(ResponseEstimate, ExposuresTellTheCurve) {
  Photographs photographs(power(2.2));
  for (const double exposure_ms : {2.5, 5.0, 10.0}) photographs.add_solid(1.0, exposure_ms);
  EXPECT_NEAR(photographs.estimate().gamma, 2.2, kNear) << photographs.estimate().reason;
}

TEST(ResponseEstimate, PhotographsThatDoNotTellAreNotBelieved) {
  Photographs sharp = bars(power(2.2), 0.0, 1 << 20);
  EXPECT_EQ(sharp.estimate().response, "");
  EXPECT_NE(sharp.estimate().reason.find("too few pixels have codes between dark and light"),
            std::string::npos)
      << sharp.estimate().reason;

  Photographs lone(power(2.2));
  lone.add_solid(1.0);
  EXPECT_EQ(lone.estimate().response, "");
  EXPECT_NE(lone.estimate().reason.find("there are no complements"), std::string::npos);

  // A camera that changes its exposure from one photograph to the next.
  Photographs restless = bars(power(2.2));
  for (size_t i = 2; i < restless.codes.size(); ++i) {
    for (float& code : restless.codes[i]) code *= 1.0f - 0.1f * static_cast<float>(i / 2 % 3);
  }
  EXPECT_EQ(restless.estimate().response, "") << restless.estimate().reason;
}

}  // namespace
}  // namespace glasswing
