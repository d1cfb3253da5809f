#include "display-node/playback/program.h"

#include <absl/strings/match.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "core/image/image_file.h"
#include "core/pattern/id_patch.h"
#include "core/sim/panel.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

const std::vector<ScreenInfo>& screens() {
  static const std::vector<ScreenInfo> list{{.name = "back", .width_px = 16, .height_px = 8},
                                            {.name = "left", .width_px = 6, .height_px = 4}};
  return list;
}

v1::LoadProgramRequest good_request() {
  v1::LoadProgramRequest request;
  request.set_program("p");
  request.set_hold_refreshes(2);
  v1::ProgramStep& step = *request.add_steps();
  step.set_step(17);
  v1::Stimulus& stripe = *step.add_stimuli();
  stripe.set_kind("gauss_stripe");
  stripe.set_panel("left");
  stripe.set_sigma_px(2.0);
  stripe.set_peak(1.0);
  return request;
}

std::string png_of(int width_px, int height_px, std::uint16_t code) {
  Image16 image(width_px, height_px);
  image.samples.assign(image.samples.size(), code);
  return encode_png16(image).value();
}

absl::StatusOr<Program> create(const v1::LoadProgramRequest& request) {
  return Program::create(request, screens(), ImageStore());
}

void expect_refused(const v1::LoadProgramRequest& request, const std::string& message) {
  const absl::Status status = create(request).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_TRUE(absl::StrContains(status.message(), message)) << status;
}

// The code that a screen without calibration shows.
std::vector<std::uint16_t> codes_of(const RadianceImage& radiance, int bits = 16) {
  std::vector<std::uint16_t> codes;
  for (const float sample : radiance.samples) {
    const long code = std::lround(sample * static_cast<float>((1 << bits) - 1));
    codes.push_back(static_cast<std::uint16_t>(code));
  }
  return codes;
}

TEST(Program, RastersItsPatternsOnTheirMonitorAndLeavesOthersBlack) {
  const v1::LoadProgramRequest request = good_request();
  const Program program = create(request).value();
  ASSERT_EQ(program.size(), 1u);
  EXPECT_EQ(program.number(0), 17);
  const std::vector<Picture> pictures = program.pictures(0);
  ASSERT_EQ(pictures.size(), 2u);
  EXPECT_EQ(pictures[0], nullptr);
  const Pattern pattern =
      Pattern::create(request.steps(0).stimuli(0), {.width_px = 6, .height_px = 4}).value();
  EXPECT_EQ(pictures[1]->samples, codes_of(pattern.rasterised()));
}

TEST(Program, DrawsWhatStandsForManyStepsOnce) {
  v1::LoadProgramRequest request;
  request.set_program("p");
  request.set_hold_refreshes(2);
  for (int i = 0; i < 20000; ++i) {
    v1::ProgramStep& step = *request.add_steps();
    step.set_step(i);
    v1::Stimulus& stimulus = *step.add_stimuli();
    stimulus.set_kind(i < 19999 ? "ramp" : "solid");
    stimulus.set_panel("back");
  }
  const Program program =
      Program::create(request, {{.name = "back", .width_px = 512, .height_px = 256}}, ImageStore()).value();
  const Picture first = program.pictures(0)[0];
  for (const size_t step : {1u, 10000u, 19998u}) EXPECT_EQ(program.pictures(step)[0], first);
  EXPECT_EQ(program.number(19998), 19998);
  EXPECT_NE(program.pictures(19999)[0]->samples, first->samples);
}

TEST(Program, RefusesWhatItCannotShowAndSaysWhy) {
  v1::LoadProgramRequest request = good_request();
  for (const int hold : {1, 0, -2, 601}) {
    request.set_hold_refreshes(hold);
    expect_refused(request, "hold_refreshes is " + std::to_string(hold) + "; it must be 2 to 600");
  }
  request = good_request();
  request.clear_program();
  expect_refused(request, "program");
  request = good_request();
  request.clear_steps();
  expect_refused(request, "1 to 20000");
  for (int i = 0; i <= 20000; ++i) request.add_steps();
  expect_refused(request, "20001 steps");
  request = good_request();
  request.mutable_steps(0)->mutable_stimuli(0)->set_panel("bakc");
  expect_refused(request, "step 17: there is no monitor \"bakc\"; there are: back, left");
  request = good_request();
  request.mutable_steps(0)->mutable_stimuli(0)->set_sigma_px(-1.0);
  expect_refused(request, "step 17: stimulus sigma_px is -1");
  request = good_request();
  *request.mutable_steps(0)->add_stimuli() = request.steps(0).stimuli(0);
  expect_refused(request, "step 17: monitor \"left\" is lit twice");
}

TEST(Program, ShowsPicturesThatWereSentAndFit) {
  ImageStore images;
  const std::string name = images.add(png_of(16, 8, 13107)).value();
  v1::LoadProgramRequest request = good_request();
  v1::Stimulus& photo = *request.mutable_steps(0)->mutable_stimuli(0);
  photo.set_kind("photo");
  photo.set_panel("back");
  photo.set_image(name);
  const Program program = Program::create(request, screens(), images).value();
  EXPECT_EQ(program.pictures(0)[0]->samples, std::vector<std::uint16_t>(16 * 8 * 3, 13107));

  photo.set_panel("left");
  const absl::Status misfit = Program::create(request, screens(), images).status();
  EXPECT_TRUE(absl::IsInvalidArgument(misfit)) << misfit;
  EXPECT_TRUE(absl::StrContains(misfit.message(), "is 16x8; monitor \"left\" is 6x4")) << misfit;

  photo.set_image("nowhere");
  const absl::Status missing = Program::create(request, screens(), images).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(missing)) << missing;
  EXPECT_TRUE(absl::StrContains(missing.message(), "image \"nowhere\" is not here")) << missing;
}

TEST(Program, DrawsThePatchBelowThePattern) {
  ImageStore images;
  const std::string photo = images.add(png_of(64, 32, 13107)).value();
  const std::vector<ScreenInfo> patched{{.name = "back", .width_px = 64, .height_px = 40, .patch_rows = 8},
                                        {.name = "left", .width_px = 32, .height_px = 40, .patch_rows = 8}};
  v1::LoadProgramRequest request = good_request();
  v1::ProgramStep& step = *request.mutable_steps(0);
  step.set_patch_id(0x1234);
  for (const std::string kind : {"gauss_stripe", "photo", "patch"}) {
    v1::Stimulus& stimulus = *step.mutable_stimuli(0);
    stimulus.set_panel("back");
    stimulus.set_kind(kind);
    stimulus.set_image(photo);
    stimulus.set_patch_id(0x4321);
    const Program program = Program::create(request, patched, images).value();
    const std::vector<Picture> pictures = program.pictures(0);
    RadianceImage back(64, 40), left(32, 40);
    if (kind == "gauss_stripe") {
      const RadianceImage pattern =
          Pattern::create(stimulus, {.width_px = 64, .height_px = 32}).value().rasterised();
      std::copy(pattern.samples.begin(), pattern.samples.end(), back.samples.begin());
    } else if (kind == "photo") {
      std::fill_n(back.samples.begin(), 64 * 32 * 3, 13107.0f / 65535.0f);
    }
    IdPatch{.width_px = 64, .first_row = 32, .rows = 8}.draw(kind == "patch" ? 0x4321 : 0x1234, back);
    IdPatch{.width_px = 32, .first_row = 32, .rows = 8}.draw(0x1234, left);
    EXPECT_EQ(pictures[0]->samples, codes_of(back)) << kind;
    EXPECT_EQ(pictures[1]->samples, codes_of(left)) << kind;
  }
  step.clear_patch_id();
  EXPECT_EQ(Program::create(request, patched, images)->pictures(0)[1], nullptr) << "dark is black";
  step.mutable_stimuli(0)->set_patch_id(65536);
  EXPECT_TRUE(absl::StrContains(Program::create(request, patched, images).status().message(),
                                "patch_id is 65536; it must be 0 to 65535"));
  step.mutable_stimuli(0)->set_patch_id(1);
  expect_refused(request, "monitor \"back\" shows no id patch; start its display with --patch-rows");
}

TEST(Program, APictureThatIsShownAgainHasEachTimeItsOwnPatch) {
  std::vector<ScreenInfo> list{{.name = "back", .width_px = 64, .height_px = 24}};
  list[0].patch_rows = 8;
  v1::LoadProgramRequest again;
  again.set_program("video");
  again.set_hold_refreshes(2);
  for (int i = 0; i < 3; ++i) {
    v1::ProgramStep& step = *again.add_steps();
    step.set_step(i);
    step.set_patch_id(static_cast<std::uint32_t>(1000 * i));
    step.add_stimuli()->set_kind("ramp");
    step.mutable_stimuli(0)->set_panel("back");
  }
  const Program video = Program::create(again, list, ImageStore()).value();
  for (int i = 0; i < 3; ++i) {
    v1::LoadProgramRequest once = again;
    once.clear_steps();
    *once.add_steps() = again.steps(i);
    const Program alone = Program::create(once, list, ImageStore()).value();
    EXPECT_EQ(video.pictures(static_cast<size_t>(i))[0]->samples, alone.pictures(0)[0]->samples) << i;
  }
}

TEST(Program, WithoutACalibrationRoundsRadianceToCodes) {
  for (const int bits : {8, 10, 12, 16}) {
    const std::vector<ScreenInfo> screen{{.name = "left", .width_px = 33, .height_px = 7, .bits = bits}};
    v1::LoadProgramRequest request = good_request();
    const Program program = Program::create(request, screen, ImageStore()).value();
    const Pattern pattern =
        Pattern::create(request.steps(0).stimuli(0), {.width_px = 33, .height_px = 7}).value();
    EXPECT_EQ(program.pictures(0)[0]->samples, codes_of(pattern.rasterised(), bits)) << bits;
  }
}

v1::DisplayCalibration power_law(const std::string& monitor, int width_px, int height_px, int bits,
                                 const std::array<double, 3>& gammas) {
  v1::DisplayCalibration calibration;
  calibration.set_format_version(1);
  calibration.set_monitor(monitor);
  calibration.set_width_px(width_px);
  calibration.set_height_px(height_px);
  calibration.set_bits(bits);
  for (const double gamma : gammas) {
    v1::ToneCurve& curve = *calibration.add_primaries();
    for (int code = 0; code < 1 << bits; ++code)
      curve.add_radiance(static_cast<float>(std::pow(code / ((1 << bits) - 1.0), gamma)));
  }
  return calibration;
}

// The largest difference between the light, averaged over 4 x 4 px at every position, and peak exp(-z^2 / 2),
// relative to the peak. The panel's black is subtracted.
double worst_mean(const Image16& light, double black, const v1::Stimulus& stripe, int height_px) {
  const double phi_rad = stripe.phi_deg() * std::numbers::pi / 180.0;
  const auto off = [&](int x, int y) {
    const double along = (x + 0.5) * std::cos(phi_rad) + (y + 0.5) * std::sin(phi_rad) - stripe.r_px();
    const double z = along / stripe.sigma_px();
    const double above_black = (light.at(x, y, 1) / 65535.0 - black) / (1.0 - black);
    return above_black / stripe.peak() - std::exp(-0.5 * z * z);
  };
  double worst = 0.0;
  for (int y = 0; y + 4 <= height_px; ++y) {
    for (int x = 0; x + 4 <= light.width_px; ++x) {
      double sum = 0.0;
      for (int i = 0; i < 16; ++i) sum += off(x + i % 4, y + i / 4);
      worst = std::max(worst, std::abs(sum) / 16.0);
    }
  }
  return worst;
}

// Through a panel of gamma 2.2 and its calibration a Gaussian is a Gaussian in light, within 0.5 % of the
// peak. The id patch below keeps the panel's full contrast.
TEST(Program, WithACalibrationAStripeIsGaussianInTheLightOfThePanel) {
  constexpr double kBlack = 0.003;
  constexpr int kWidth = 192, kHeight = 160, kPatchRows = 8;
  for (const int bits : {8, 10}) {
    const std::vector<ScreenInfo> screen{{.name = "left",
                                          .width_px = kWidth,
                                          .height_px = kHeight + kPatchRows,
                                          .patch_rows = kPatchRows,
                                          .bits = bits}};
    const Panel panel({.bits = bits, .gamma = 2.2, .black = kBlack});
    v1::LoadProgramRequest request = good_request();
    *request.add_calibrations() = power_law("left", kWidth, kHeight, bits, {2.2, 2.2, 2.2});
    v1::ProgramStep& step = *request.mutable_steps(0);
    step.set_patch_id(0x1234);
    v1::Stimulus& stripe = *step.mutable_stimuli(0);
    double worst = 0.0;
    for (const double peak : {1.0, 0.25, 0.1}) {
      for (const double sigma_px : {3.0, 20.0}) {
        for (const double phi_deg : {0.0, 17.0, 90.0}) {
          stripe.set_peak(peak);
          stripe.set_sigma_px(sigma_px);
          stripe.set_phi_deg(phi_deg);
          stripe.set_r_px(80.3);
          const Program program = Program::create(request, screen, ImageStore()).value();
          const Picture codes = program.pictures(0)[0];
          const Image16 light = panel.emitted(*codes, nanoseconds(0));
          worst = std::max(worst, worst_mean(light, kBlack, stripe, kHeight));
          RadianceImage patch(kWidth, kPatchRows);
          IdPatch{.width_px = kWidth, .first_row = 0, .rows = kPatchRows}.draw(0x1234, patch);
          const std::vector<std::uint16_t> below(codes->samples.end() - kPatchRows * kWidth * 3,
                                                 codes->samples.end());
          EXPECT_EQ(below, codes_of(patch, bits));
        }
      }
    }
    std::printf("%d bits: worst mean over 4x4 pixels off by %.2f %% of the peak\n", bits, 100.0 * worst);
    EXPECT_LE(worst, 0.005) << bits;

    request.clear_calibrations();
    const Program uncalibrated = Program::create(request, screen, ImageStore()).value();
    EXPECT_GT(
        worst_mean(panel.emitted(*uncalibrated.pictures(0)[0], nanoseconds(0)), kBlack, stripe, kHeight),
        0.05);
  }
}

// A photo is radiance too, and each primary has its own curve: the light averaged over the picture is the
// requested one, within half a step for each pixel of its border (core/radiometry/dither).
TEST(Program, PhotosGoThroughTheCalibrationOfTheirMonitorAlone) {
  constexpr std::array<double, 3> kGammas{1.8, 2.2, 2.4};
  constexpr int kSize = 64;
  const std::vector<ScreenInfo> both{{.name = "back", .width_px = kSize, .height_px = kSize, .bits = 8},
                                     {.name = "left", .width_px = kSize, .height_px = kSize, .bits = 8}};
  ImageStore images;
  const double radiance = 0.2;
  const std::string name = images.add(png_of(kSize, kSize, 13107)).value();
  v1::LoadProgramRequest request = good_request();
  *request.add_calibrations() = power_law("back", kSize, kSize, 8, kGammas);
  request.mutable_steps(0)->clear_stimuli();
  for (const ScreenInfo& screen : both) {
    v1::Stimulus& photo = *request.mutable_steps(0)->add_stimuli();
    photo.set_kind("photo");
    photo.set_panel(screen.name);
    photo.set_image(name);
  }
  const std::vector<Picture> pictures = Program::create(request, both, images)->pictures(0);
  for (size_t c = 0; c < 3; ++c) {
    double mean = 0.0;
    for (size_t i = c; i < pictures[0]->samples.size(); i += 3)
      mean += std::pow(pictures[0]->samples[i] / 255.0, kGammas[c]) / (kSize * kSize);
    const double step = kGammas[c] / 255.0 * std::pow(radiance, 1.0 - 1.0 / kGammas[c]);
    EXPECT_NEAR(mean, radiance, 3.0 / kSize * 0.6 * step);  // a step's length changes by a fifth within it
  }
  EXPECT_EQ(pictures[1]->samples, std::vector<std::uint16_t>(kSize * kSize * 3, 51));  // 0.2 of 255
}

TEST(Program, CodesAreShownAsTheyAre) {
  const std::vector<ScreenInfo> screen{{.name = "left", .width_px = 32, .height_px = 8, .bits = 8}};
  v1::LoadProgramRequest request = good_request();
  *request.add_calibrations() = power_law("left", 32, 8, 8, {2.2, 2.2, 2.2});
  v1::Stimulus& stripe = *request.mutable_steps(0)->mutable_stimuli(0);
  stripe.set_r_px(12.0);
  stripe.set_codes(true);
  const Program program = Program::create(request, screen, ImageStore()).value();
  EXPECT_EQ(program.pictures(0)[0]->samples,
            codes_of(Pattern::create(stripe, {.width_px = 32, .height_px = 8})->rasterised(), 8));
}

TEST(Program, RefusesCalibrationsThatAreNotOfItsMonitors) {
  const std::vector<ScreenInfo> own{
      {.name = "back", .width_px = 16, .height_px = 12, .patch_rows = 4, .bits = 10},
      {.name = "left", .width_px = 6, .height_px = 4}};
  const v1::DisplayCalibration good = power_law("back", 16, 8, 10, {2.2, 2.2, 2.2});
  const auto refused = [&](const std::vector<v1::DisplayCalibration>& calibrations,
                           const std::string& message) {
    v1::LoadProgramRequest request = good_request();
    for (const v1::DisplayCalibration& each : calibrations) *request.add_calibrations() = each;
    const absl::Status status = Program::create(request, own, ImageStore()).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
    EXPECT_TRUE(absl::StrContains(status.message(), message)) << status;
  };
  v1::LoadProgramRequest request = good_request();
  *request.add_calibrations() = good;
  EXPECT_OK(Program::create(request, own, ImageStore()));

  refused({good, good}, "monitor \"back\" has two calibrations");
  refused({power_law("front", 16, 8, 10, {2.2, 2.2, 2.2})}, "of monitor \"front\"; there are: back, left");
  refused({power_law("back", 16, 8, 8, {2.2, 2.2, 2.2})},
          "the calibration of monitor \"back\" is of 16 x 8 px and 8 bits; the monitor has 16 x 8 px and 10 "
          "bits");
  refused({power_law("back", 16, 12, 10, {2.2, 2.2, 2.2})},
          "is of 16 x 12 px and 10 bits; the monitor has 16 x 8 px and 10 bits");
  refused({power_law("left", 6, 4, 8, {2.2, 2.2, 2.2})},
          "\"left\" cannot be used: the monitor's codes have 16 bits; they must have 8 to 12");
  v1::DisplayCalibration calibration = good;
  calibration.set_format_version(2);
  refused({calibration}, "has format_version 2; it must be 1");
  calibration = good;
  calibration.mutable_primaries()->RemoveLast();
  refused({calibration}, "has 2 primaries; it must have 3");
  calibration = good;
  calibration.mutable_primaries(1)->add_radiance(1.0f);
  refused({calibration}, "has 1025 codes of green; it must have 1024");
  calibration = good;
  calibration.mutable_primaries(2)->set_radiance(500, 0.0f);
  refused({calibration}, "has for blue a response falls from");
  calibration = good;
  calibration.mutable_primaries(0)->set_radiance(500, std::nanf(""));
  refused({calibration}, "has for red a response falls");
  calibration = good;
  calibration.mutable_primaries(0)->set_radiance(1023, 2.0f);
  refused({calibration}, "it must go from 0 to 1");
}

TEST(ImageStore, NamesPicturesByContent) {
  ImageStore images;
  const std::string a = images.add(png_of(4, 4, 1)).value();
  EXPECT_EQ(images.add(png_of(4, 4, 1)).value(), a);
  EXPECT_NE(images.add(png_of(4, 4, 2)).value(), a);
  EXPECT_NE(images.find(a), nullptr);
  EXPECT_EQ(images.find("other"), nullptr);
}

TEST(ImageStore, RefusesWhatIsNoPicture) {
  ImageStore images;
  const std::string png = png_of(16, 16, 500);
  std::string flipped = png;
  flipped[png.size() / 2] = static_cast<char>(flipped[png.size() / 2] ^ 0x10);
  for (const std::string& bytes : {std::string(), std::string("hello"), png.substr(0, 20), flipped}) {
    EXPECT_TRUE(absl::IsInvalidArgument(images.add(bytes).status())) << bytes.size();
  }
}

TEST(ImageStore, ThoseThatWereSentLongestAgoMakeRoom) {
  ImageStore store(200);  // a picture of 4 x 4 px takes 96
  const std::string a = store.add(png_of(4, 4, 1)).value(), b = store.add(png_of(4, 4, 2)).value();
  const std::shared_ptr<const Image16> shown = store.find(b);
  EXPECT_EQ(store.add(png_of(4, 4, 1)).value(), a);  // sent again: the latest
  const std::string c = store.add(png_of(4, 4, 3)).value();
  EXPECT_NE(store.find(a), nullptr);
  EXPECT_EQ(store.find(b), nullptr);
  EXPECT_NE(store.find(c), nullptr);
  EXPECT_EQ(shown->width_px, 4) << "who shows a picture keeps it";
  EXPECT_TRUE(absl::IsResourceExhausted(store.add(png_of(6, 6, 1)).status()));
  EXPECT_NE(store.find(c), nullptr) << "what does not fit at all takes no room";
}

TEST(ImageStore, TakesAnyNumberOfPhotosOneAfterAnother) {
  ImageStore store;
  for (std::uint16_t code = 0; code < 5000; ++code)
    ASSERT_NE(store.find(store.add(png_of(2, 2, code)).value()), nullptr) << code;
  EXPECT_EQ(store.find(store.add(png_of(2, 2, 0)).value())->width_px, 2);
}

}  // namespace
}  // namespace glasswing
