#include "core/sim/sensor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace glasswing {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr MonitorSize kBack{16, 12};
constexpr MonitorSize kLeft{10, 12};

Transport crystal() {
  return *build_transport("crystal", true, {{"back", kBack}, {"left", kLeft}}, 8, 6);
}

std::shared_ptr<const Image16> random_picture(MonitorSize size, std::mt19937_64& random) {
  auto picture = std::make_shared<Image16>(size.width_px, size.height_px);
  std::uniform_int_distribution<std::uint16_t> uniform;
  std::generate(picture->samples.begin(), picture->samples.end(), [&] { return uniform(random); });
  return picture;
}

MonitorEmission emission(const std::string& name, MonitorSize size, nanoseconds scanout, nanoseconds lag,
                         const std::vector<nanoseconds>& starts, std::mt19937_64& random) {
  MonitorEmission result{.monitor = {name, size.width_px, size.height_px, scanout, lag}, .pictures = {}};
  for (const nanoseconds start : starts) result.pictures.push_back({start, random_picture(size, random)});
  return result;
}

RadianceImage radiance_of(const Image16& picture) {
  RadianceImage radiance(picture.width_px, picture.height_px);
  std::transform(picture.samples.begin(), picture.samples.end(), radiance.samples.begin(),
                 [](std::uint16_t code) { return glasswing::radiance_of(code); });
  return radiance;
}

// The light of a monitor's rows at one moment.
RadianceImage shown_at(const MonitorEmission& emission, nanoseconds when) {
  RadianceImage out(emission.monitor.width_px, emission.monitor.height_px);
  for (int y = 0; y < out.height_px; ++y) {
    const double delay_ns = static_cast<double>(emission.monitor.lag.count()) +
                            static_cast<double>(emission.monitor.scanout.count()) * y / out.height_px;
    for (const EmittedPicture& picture : emission.pictures) {
      if (static_cast<double>((when - picture.scanout_start).count()) < delay_ns) continue;
      for (int x = 0; x < out.width_px; ++x) {
        for (int c = 0; c < 3; ++c) out.at(x, y, c) = glasswing::radiance_of(picture.image->at(x, y, c));
      }
    }
  }
  return out;
}

TEST(Integrate, AgreesWithManySlicesOfTime) {
  std::mt19937_64 random(4);
  const Transport transport = crystal();
  const std::vector<MonitorEmission> light{
      emission("back", kBack, milliseconds(7), milliseconds(2),
               {milliseconds(-30), milliseconds(-1), milliseconds(9)}, random),
      // Black until the first picture.
      emission("left", kLeft, milliseconds(16), microseconds(3300), {milliseconds(1), milliseconds(6)},
               random)};
  const ExposureWindow window{.start = milliseconds(1), .exposure = milliseconds(8)};
  const nanoseconds readout = milliseconds(5);
  const RadianceImage exact = integrate(transport, light, window, readout);

  constexpr int kSlices = 500;
  // A change is at most half a slice from a slice's border; a pixel's weights sum to at most 1, radiance is
  // at most 1, and no monitor row changes more than twice here. Float sums add about 1e-5.
  constexpr float kTolerance = 2.0f * 0.5f / kSlices + 1e-5f;
  for (int y = 0; y < 6; ++y) {
    const nanoseconds from = window.start + readout * y / 5;
    RadianceImage mean(8, 6);
    for (int s = 0; s < kSlices; ++s) {
      const nanoseconds when = from + window.exposure * (2 * s + 1) / (2 * kSlices);
      const RadianceImage seen =
          transport.respond(std::vector<RadianceImage>{shown_at(light[0], when), shown_at(light[1], when)});
      for (size_t i = 0; i < mean.samples.size(); ++i) mean.samples[i] += seen.samples[i] / kSlices;
    }
    for (int x = 0; x < 8; ++x) {
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(exact.at(x, y, c), mean.at(x, y, c), kTolerance);
    }
  }
}

// The light of a settling, flickering monitor row at one moment: each change takes `settle`, even if another
// follows.
RadianceImage settling_at(const MonitorEmission& emission, nanoseconds when) {
  RadianceImage out(emission.monitor.width_px, emission.monitor.height_px);
  for (int y = 0; y < out.height_px; ++y) {
    const double delay_ns = static_cast<double>(emission.monitor.lag.count()) +
                            static_cast<double>(emission.monitor.scanout.count()) * y / out.height_px;
    const Image16 black(out.width_px, out.height_px);
    const Image16* before = &black;
    for (const EmittedPicture& picture : emission.pictures) {
      const double since_ns = static_cast<double>((when - picture.scanout_start).count()) - delay_ns;
      const auto part = static_cast<float>(
          std::clamp(since_ns / static_cast<double>(emission.monitor.settle.count()), 0.0, 1.0));
      for (int x = 0; x < out.width_px; ++x) {
        for (int c = 0; c < 3; ++c)
          out.at(x, y, c) += part * (glasswing::radiance_of(picture.image->at(x, y, c)) -
                                     glasswing::radiance_of(before->at(x, y, c)));
      }
      before = picture.image.get();
    }
  }
  const Flicker& flicker = emission.monitor.flicker;
  const double turns = flicker.hz * std::chrono::duration<double>(when).count();
  const auto backlight =
      static_cast<float>(1.0 + flicker.amplitude * std::sin(2.0 * std::numbers::pi * turns));
  for (float& light : out.samples) light *= backlight;
  return out;
}

void expect_settling(const Flicker& flicker) {
  std::mt19937_64 random(8);
  const Transport transport = crystal();
  std::vector<MonitorEmission> light{emission("back", kBack, milliseconds(7), milliseconds(2),
                                              {milliseconds(-30), milliseconds(-1), milliseconds(9)}, random),
                                     // The second change starts before the first has settled.
                                     emission("left", kLeft, milliseconds(16), microseconds(3300),
                                              {milliseconds(1), milliseconds(3)}, random)};
  light[0].monitor.settle = milliseconds(4);
  light[1].monitor.settle = milliseconds(5);
  light[0].monitor.flicker = flicker;
  const nanoseconds readout = milliseconds(5);
  for (const int start_ms : {-4, 1, 6, 12}) {
    const ExposureWindow window{.start = milliseconds(start_ms), .exposure = milliseconds(8)};
    const RadianceImage exact = integrate(transport, light, window, readout);
    // The midpoint of a slice is its mean, except at the ends of a ramp, where a triangle of half a slice and
    // of slope 1 / settle is missed, four times at most; and for a sine, up to (2 pi f slice)^2 / 24. Float
    // sums add about 1e-5.
    constexpr int kSlices = 500;
    const double slice_of_settle = 8.0 / kSlices / 4.0;
    const double angle = 2.0 * std::numbers::pi * flicker.hz * 0.008 / kSlices;
    const double tolerance = (1.0 + flicker.amplitude) * 4.0 * slice_of_settle / 8.0 / kSlices +
                             flicker.amplitude * angle * angle / 24.0 + 1e-5;
    for (int y = 0; y < 6; ++y) {
      const nanoseconds from = window.start + readout * y / 5;
      RadianceImage mean(8, 6);
      for (int s = 0; s < kSlices; ++s) {
        const nanoseconds when = from + window.exposure * (2 * s + 1) / (2 * kSlices);
        const RadianceImage seen = transport.respond(
            std::vector<RadianceImage>{settling_at(light[0], when), settling_at(light[1], when)});
        for (size_t i = 0; i < mean.samples.size(); ++i) mean.samples[i] += seen.samples[i] / kSlices;
      }
      for (int x = 0; x < 8; ++x) {
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(exact.at(x, y, c), mean.at(x, y, c), tolerance);
      }
    }
  }
}

TEST(Integrate, SettlesFromOnePictureToTheNext) {
  expect_settling({});
}

TEST(Integrate, FlickersAsTheBacklightDoes) {
  expect_settling({.amplitude = 0.4, .hz = 100.0});
  expect_settling({.amplitude = 1.0, .hz = 370.0});
}

TEST(Integrate, IsTheTransportsResponseWhileNothingChanges) {
  std::mt19937_64 random(5);
  const Transport transport = crystal();
  const std::vector<MonitorEmission> light{
      emission("back", kBack, milliseconds(16), milliseconds(2),
               {milliseconds(-30), milliseconds(0), seconds(1)}, random),
      emission("left", kLeft, milliseconds(16), milliseconds(2), {}, random)};
  const RadianceImage seen =
      integrate(transport, light, {.start = milliseconds(18), .exposure = milliseconds(8)}, milliseconds(5));
  EXPECT_EQ(
      seen.samples,
      transport.respond(std::vector<RadianceImage>{radiance_of(*light[0].pictures[1].image), RadianceImage()})
          .samples);
}

constexpr SensorModel kNoiseless{.read_sd = 0.0, .gain = 0.0, .bits = 16};

RadianceImage uniform_light(int size_px, float radiance) {
  RadianceImage light(size_px, size_px);
  std::fill(light.samples.begin(), light.samples.end(), radiance);
  return light;
}

TEST(Expose, ScalesByExposureAndClips) {
  const double full_ms = kNoiseless.full_scale_exposure_ms;
  EXPECT_EQ(expose(uniform_light(2, 0.5f), 0.5 * full_ms, kNoiseless, 0).samples[0],
            16384);  // 65535 / 4, rounded
  EXPECT_EQ(expose(uniform_light(2, 0.5f), 3.0 * full_ms, kNoiseless, 0).samples[0], 65535);
  EXPECT_EQ(expose(uniform_light(2, 0.0f), full_ms, kNoiseless, 0).samples[0], 0);
}

TEST(Expose, QuantisesToItsBits) {
  std::mt19937_64 random(6);
  for (const int bits : {8, 10, 12, 14}) {
    SensorModel model = kNoiseless;
    model.bits = bits;
    const RadianceImage light = radiance_of(*random_picture({20, 20}, random));
    const Image16 image = expose(light, model.full_scale_exposure_ms, model, 0);
    const double step = 1.0 / (std::exp2(bits) - 1.0);
    for (size_t i = 0; i < light.samples.size(); ++i) {
      const double code = image.samples[i] / 65535.0 / step;
      EXPECT_NEAR(code, std::round(code), 0.5 / 65535.0 / step + 1e-9);  // storing rounds to 16 bits
      EXPECT_NEAR(code, light.samples[i] / step, 0.5 + 0.5 / 65535.0 / step + 1e-4);  // float light
    }
  }
}

TEST(Expose, NoiseHasTheModelsMeanAndVariance) {
  constexpr int kSize_px = 120;
  constexpr double kCount = kSize_px * kSize_px * 3;
  for (const float value : {0.2f, 0.7f}) {
    const SensorModel model{.read_sd = 0.004, .gain = 2e-4, .bits = 12};
    const Image16 image = expose(uniform_light(kSize_px, value), model.full_scale_exposure_ms, model, 3);
    double sum = 0.0, sum_of_squares = 0.0;
    for (const std::uint16_t sample : image.samples) {
      sum += sample / 65535.0 - value;
      sum_of_squares += std::pow(sample / 65535.0 - value, 2);
    }
    const double step = 1.0 / 4095.0;
    const double variance = model.read_sd * model.read_sd + model.gain * value + step * step / 12.0;
    // Five standard errors of a mean and of a Gaussian's variance.
    EXPECT_NEAR(sum / kCount, 0.0, 5.0 * std::sqrt(variance / kCount));
    EXPECT_NEAR(sum_of_squares / kCount, variance, 5.0 * variance * std::sqrt(2.0 / kCount));
  }
}

TEST(ThroughLens, PixelsGatherWhatIsBlurred) {
  constexpr int kSize_px = 31, kMiddle_px = 15;
  constexpr double kSigma_px = 1.5;
  RadianceImage rays(kRaysAcross * kSize_px, kRaysAcross * kSize_px);
  for (int y = 0; y < kRaysAcross; ++y) {
    for (int x = 0; x < kRaysAcross; ++x)
      rays.at(kRaysAcross * kMiddle_px + x, kRaysAcross * kMiddle_px + y, 1) = 1.0f;
  }
  const RadianceImage picture = through_lens(rays, kSigma_px);
  ASSERT_EQ(picture.width_px, kSize_px);
  double total = 0.0, second_moment = 0.0;
  for (int y = 0; y < kSize_px; ++y) {
    for (int x = 0; x < kSize_px; ++x) {
      total += static_cast<double>(picture.at(x, y, 1));
      second_moment += static_cast<double>(picture.at(x, y, 1)) * (x - kMiddle_px) * (x - kMiddle_px);
      EXPECT_EQ(picture.at(x, y, 0), 0.0f);
    }
  }
  EXPECT_NEAR(total, 1.0, 1e-4);  // float sums
  // The variance of the lens, of four rays in a row, and of gathering four rays. A Gaussian cut off at four
  // sigma lacks 0.11 % of its variance.
  const double four_rays = (1.0 - 1.0 / (kRaysAcross * kRaysAcross)) / 12.0;
  EXPECT_NEAR(second_moment, kSigma_px * kSigma_px + 2.0 * four_rays, 0.002 * kSigma_px * kSigma_px);
}

// sample = curve(black + (1 - black) * value), in doubles.
double coded(const SensorModel& model, double value) {
  const double raised = model.black_level + (1.0 - model.black_level) * value;
  const double u = std::pow(std::clamp(raised, 0.0, 1.0), double{model.curve.exponent});
  const double contrast = model.curve.contrast;
  return (1.0 - contrast) * u + contrast * (3.0 - 2.0 * u) * u * u;
}

constexpr SensorCurve kGamma{.exponent = 1.0f / 2.2f};
constexpr SensorCurve kSCurve{.exponent = 1.0f / 2.2f, .contrast = 0.5f};

TEST(Expose, CodesFollowBlackLevelAndCurve) {
  RadianceImage light(100, 100);
  for (size_t i = 0; i < light.samples.size(); ++i) light.samples[i] = static_cast<float>(i) / 25000.0f;
  for (const SensorCurve& curve : {SensorCurve(), kGamma, kSCurve}) {
    for (const double black_level : {0.0, 0.0625}) {
      SensorModel model = kNoiseless;
      model.curve = curve;
      model.black_level = black_level;
      for (const int bits : {8, 10, 16}) {
        model.bits = bits;
        const Image16 image = expose(light, model.full_scale_exposure_ms, model, 0);
        // Half a code, and half of a stored step. Logarithm and exponential are accurate to 4 and 1 ulp, so u
        // is off by up to |u log u| * 4 ulp + 2 ulp <= 5e-7, which moves a curve no steeper than 1.25 by less
        // than 1e-6. Light below 1e-30 counts as 1e-30.
        const double tolerance = 0.5 / ((1 << bits) - 1) + 0.5 / 65535.0 + 1e-6;
        for (size_t i = 0; i < light.samples.size(); ++i)
          ASSERT_NEAR(image.samples[i] / 65535.0, coded(model, light.samples[i]), tolerance)
              << light.samples[i] << " at " << bits << " bits";
      }
    }
  }
}

TEST(Expose, CornersLackTheirShareOfTheLight) {
  SensorModel model = kNoiseless;
  model.vignetting = 0.4;
  const Image16 image = expose(uniform_light(5, 0.5f), model.full_scale_exposure_ms, model, 0);
  const double rounding = 0.5 / 65535.0 + 1e-6;  // and a few operations on floats
  // A corner pixel's centre is at 2 of the 2.5 pixels to the corner.
  EXPECT_NEAR(image.at(2, 2, 0) / 65535.0, 0.5, rounding);
  EXPECT_NEAR(image.at(0, 4, 1) / 65535.0, 0.5 * (1.0 - 0.4 * 0.64), rounding);
  EXPECT_NEAR(image.at(0, 2, 2) / 65535.0, 0.5 * (1.0 - 0.4 * 0.32), rounding);
}

// Inverting the curve recovers the noise of linear light.
TEST(Expose, NoiseComesBeforeTheCurve) {
  constexpr int kSize_px = 120;
  constexpr double kCount = kSize_px * kSize_px * 3;
  for (const float value : {0.1f, 0.6f}) {
    const SensorModel model{.read_sd = 0.004, .gain = 2e-4, .black_level = 0.05, .curve = kGamma, .bits = 16};
    const Image16 image = expose(uniform_light(kSize_px, value), model.full_scale_exposure_ms, model, 3);
    double sum = 0.0, sum_of_squares = 0.0;
    for (const std::uint16_t sample : image.samples) {
      const double raised = std::pow(sample / 65535.0, 1.0 / double{kGamma.exponent});
      const double error = (raised - model.black_level) / (1.0 - model.black_level) - value;
      sum += error;
      sum_of_squares += error * error;
    }
    // A step of 1/65535 adds a millionth of this variance.
    const double variance = model.read_sd * model.read_sd + model.gain * value;
    // Five standard errors of a mean and of a Gaussian's variance.
    EXPECT_NEAR(sum / kCount, 0.0, 5.0 * std::sqrt(variance / kCount));
    EXPECT_NEAR(sum_of_squares / kCount, variance, 5.0 * variance * std::sqrt(2.0 / kCount));
  }
}

TEST(Expose, TheSameFrameHasTheSameNoiseAndNoOtherHas) {
  const SensorModel model{.seed = 9};
  SensorModel other = model;
  other.seed = 10;
  const RadianceImage light = uniform_light(10, 0.4f);
  const auto first = expose(light, 4.0, model, 7).samples;
  EXPECT_EQ(first, expose(light, 4.0, model, 7).samples);
  EXPECT_NE(first, expose(light, 4.0, model, 8).samples);
  EXPECT_NE(first, expose(light, 4.0, other, 7).samples);
}

}  // namespace
}  // namespace glasswing
