#include "solver/gaussian/synthesized_capture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "core/pattern/pattern.h"
#include "solver/gaussian/fewer_images.h"
#include "solver/gaussian/stack_layout.h"
#include "solver/method/exposure_merge.h"
#include "solver/mixture/mixture_layout.h"
#include "tests/solver/gaussian/swept_manifest.h"

namespace glasswing {
namespace {

// The picture of a monitor that adds up the parts' pictures; black has no light of its own.
RadianceImage sum_of(const v1::CaptureManifest& recorded, const std::vector<Part>& parts) {
  RadianceImage sum(kSwept.width_px, kSwept.height_px);
  for (const Part& part : parts) {
    const RadianceImage own =
        Pattern::create(recorded.frames(part.frame).stimulus(), kSwept).value().rasterised();
    for (size_t i = 0; i < sum.samples.size(); ++i)
      sum.samples[i] += static_cast<float>(part.weight) * own.samples[i];
  }
  return sum;
}

double weight_of(const std::vector<Part>& parts) {
  double sum = 0.0;
  for (const Part& part : parts) sum += part.weight;
  return sum;
}

double farthest(const RadianceImage& a, const RadianceImage& b) {
  double most = 0.0;
  for (size_t i = 0; i < a.samples.size(); ++i)
    most = std::max(most, static_cast<double>(std::abs(a.samples[i] - b.samples[i])));
  return most;
}

TEST(StripeSums, ShowWhatWasAskedForOnEveryPixel) {
  const v1::CaptureManifest recorded = swept_manifest();
  StripeSums sums(recorded);
  for (const double phi_deg : {0.0, 90.0, 45.0, -45.0}) {
    for (const double r_px : {-6.0, 0.3, 17.0, 40.0}) {
      v1::Stimulus stripe = stripe_at(phi_deg, r_px, 7.0);
      const std::vector<Part> parts = sums.parts(stripe, phi_deg).value();
      EXPECT_LT(farthest(sum_of(recorded, parts), Pattern::create(stripe, kSwept).value().rasterised()),
                1.1e-3);
      EXPECT_NEAR(weight_of(parts), 1.0, 1e-9) << "light that is always there must count once";
    }
    v1::Stimulus wave;
    wave.set_kind("sinusoid");
    wave.set_panel("back");
    wave.set_phi_deg(phi_deg);
    wave.set_period_px(24.0);
    wave.set_phase_deg(70.0);
    wave.set_peak(1.0);
    const std::vector<Part> parts = sums.parts(wave, phi_deg).value();
    EXPECT_LT(farthest(sum_of(recorded, parts), Pattern::create(wave, kSwept).value().rasterised()), 1.1e-3);
  }
}

TEST(StripeSums, RefuseWhatStripesAreTooWideFor) {
  const v1::CaptureManifest recorded = swept_manifest();
  StripeSums sums(recorded);
  EXPECT_TRUE(absl::IsFailedPrecondition(sums.parts(stripe_at(0.0, 20.0, 2.0), 0.0).status()));
  EXPECT_TRUE(absl::IsFailedPrecondition(sums.parts(stripe_at(30.0, 20.0, 7.0), 30.0).status()));
}

TEST(SynthesizedStack, SumsRowsAndKeepsWhatIsSaturated) {
  v1::CaptureManifest recorded = swept_manifest();
  recorded.mutable_camera()->set_width_px(1);
  recorded.mutable_camera()->set_height_px(1);
  const std::vector<std::uint16_t> dim{1000, 2000, 3000}, bright{5000, 65535, 7000};
  FrameStack stack{.width_px = 1, .first_row = 0, .row_count = 1, .rows = {dim, bright}, .owner = nullptr};
  stack.zero = 500.0f;
  SynthesizedCapture capture{.manifest = recorded, .parts = {}};
  capture.manifest.clear_frames();
  capture.add(recorded.frames(0), {{.frame = 0, .weight = 0.5}, {.frame = 1, .weight = 2.0}});
  capture.add(recorded.frames(1), {{.frame = 1, .weight = 1.0}});
  const FrameStack made = synthesized_stack(stack, capture, {0, 1});
  EXPECT_EQ(made.rows[0][0], 500 + 250 + 9000);
  EXPECT_GE(made.rows[0][1], kSaturatedCode);
  EXPECT_EQ(made.rows[1].data(), bright.data()) << "what is recorded need not be copied";
  EXPECT_EQ(frames_of(capture, {1}), std::vector<int>{1});
}

int patterns_in(const v1::CaptureManifest& manifest) {
  return static_cast<int>(std::ranges::count_if(manifest.frames(), is_pattern));
}

TEST(FewerImages, NeverTakesMoreThanItMayAndCanBeLaidOut) {
  const v1::CaptureManifest recorded = swept_manifest();
  for (const FewerImages kind : {FewerImages::kStripes, FewerImages::kWaves}) {
    size_t before = 0;
    double before_px = INFINITY;
    for (int images = kMinImages; images < patterns_in(recorded); images += 7) {
      const SynthesizedCapture fewer = fewer_images(recorded, images, kind).value();
      EXPECT_LE(patterns_in(fewer.manifest), images);
      EXPECT_GT(patterns_in(fewer.manifest), images / 2);
      if (kind == FewerImages::kStripes) {
        const StackLayout stripes = lay_out(fewer.manifest).value();
        EXPECT_GE(stripes.sweeps.size(), 3u);
        EXPECT_FALSE(stripes.stage.pairs.empty());
        EXPECT_GE(stripes.sweeps.front().sigma_px, 4.0) << "narrower than any recorded one";
        EXPECT_LE(stripes.sweeps.front().sigma_px, before_px) << "more images are never worse spent";
        before_px = stripes.sweeps.front().sigma_px;
        continue;
      }
      const MixtureLayout layout = lay_out_mixture(fewer.manifest).value();
      EXPECT_FALSE(layout.stage.pairs.empty());
      std::set<std::pair<double, double>> waves;
      for (const ShownPattern& pattern : layout.monitors.front().patterns) {
        if (pattern.kind == ShownPattern::Kind::kWave) waves.emplace(pattern.fx, pattern.fy);
      }
      EXPECT_GE(waves.size(), before) << "more images show more waves";
      EXPECT_GE(waves.size(), 6u);
      before = waves.size();
    }
  }
  const SynthesizedCapture all = fewer_images(recorded, patterns_in(recorded)).value();
  EXPECT_EQ(all.parts.size(), static_cast<size_t>(recorded.frames_size()));
}

TEST(FewerImages, SaysWhenSoFewDoNotSuffice) {
  v1::CaptureManifest two = swept_manifest();
  v1::Monitor left = two.monitors(0);
  left.set_name("left");
  *two.add_monitors() = left;
  const int count = two.frames_size();
  for (int i = 0; i < count; ++i) {
    v1::Frame frame = two.frames(i);
    frame.mutable_stimulus()->set_panel("left");
    *two.add_frames() = frame;
  }
  const absl::Status status = fewer_images(two, kMinImages).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status));
  EXPECT_NE(std::string(status.message()).find("at least"), std::string::npos) << status;
}

// Sums are of frames that show the object for the same time.
TEST(StripeSums, LeaveOtherExposuresAndTheEmptyStageAlone) {
  v1::CaptureManifest recorded = swept_manifest();
  for (v1::Frame& frame : *recorded.mutable_frames()) frame.set_exposure_ms(4.0);
  const int count = recorded.frames_size();
  for (int i = 0; i < count; ++i) {
    v1::Frame longer = recorded.frames(i), empty = longer;
    longer.set_exposure_ms(16.0);
    empty.set_object(false);
    *recorded.add_frames() = longer;
    *recorded.add_frames() = empty;
  }
  StripeSums sums(recorded);
  for (const double phi_deg : {0.0, 45.0}) {
    const std::vector<Part> parts = sums.parts(stripe_at(phi_deg, 17.0, 7.0), phi_deg).value();
    for (const Part& part : parts) {
      EXPECT_TRUE(recorded.frames(part.frame).object()) << part.frame;
      EXPECT_EQ(recorded.frames(part.frame).exposure_ms(), 4.0) << part.frame;
    }
  }
}

}  // namespace
}  // namespace glasswing
