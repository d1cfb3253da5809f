#include "solver/gaussian/stack_layout.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "solver/method/method.h"
#include "solver/methods.h"

namespace glasswing {
namespace {

v1::CaptureManifest good_manifest() {
  v1::CaptureManifest manifest;
  v1::Monitor& monitor = *manifest.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(16);
  monitor.set_height_px(16);
  v1::Frame& black = *manifest.add_frames();
  black.set_object(true);
  black.mutable_stimulus()->set_kind("solid");
  for (int i = 0; i < 3; ++i) black.mutable_stimulus()->add_colour(0.0);
  for (const double phi : {0.0, 90.0, 45.0}) {
    for (int k = 4; k >= 0; --k) {
      v1::Frame& frame = *manifest.add_frames();
      frame.set_object(true);
      v1::Stimulus& stripe = *frame.mutable_stimulus();
      stripe.set_kind("gauss_stripe");
      stripe.set_panel("back");
      stripe.set_phi_deg(phi);
      stripe.set_sigma_px(4.0);
      stripe.set_peak(1.0);
      stripe.set_r_px(4.0 * k);
    }
  }
  return manifest;
}

TEST(LayOut, SortsSweepsAndNeverReadsAReference) {
  v1::CaptureManifest manifest = good_manifest();
  v1::Frame& reference = *manifest.add_frames();
  reference.set_object(true);
  reference.mutable_stimulus()->set_kind("photo");
  reference.mutable_stimulus()->set_reference(true);
  const StackLayout layout = lay_out(manifest).value();
  ASSERT_EQ(layout.sweeps.size(), 3u);
  for (const SweepLayout& sweep : layout.sweeps)
    EXPECT_TRUE(std::is_sorted(sweep.r_px.begin(), sweep.r_px.end()));
  const std::vector<int> needed =
      make_method("gaussian", {}).value()->prepare(manifest).value()->frames_needed();
  EXPECT_EQ(std::count(needed.begin(), needed.end(), manifest.frames_size() - 1), 0);
}

TEST(LayOut, SaysWhatIsMissing) {
  const auto refused = [](const v1::CaptureManifest& manifest, const std::string& words) {
    const absl::Status status = lay_out(manifest).status();
    EXPECT_TRUE(absl::IsFailedPrecondition(status));
    EXPECT_NE(std::string(status.message()).find(words), std::string::npos) << status;
  };
  v1::CaptureManifest manifest = good_manifest();
  manifest.mutable_frames()->DeleteSubrange(0, 1);
  refused(manifest, "before black");
  manifest = good_manifest();
  manifest.mutable_frames()->DeleteSubrange(1, 15);
  refused(manifest, "no stripe sweeps");
  manifest = good_manifest();
  manifest.mutable_frames()->DeleteSubrange(11, 5);
  refused(manifest, "2 orientations");
  manifest = good_manifest();
  manifest.mutable_frames()->DeleteSubrange(15, 1);
  refused(manifest, "4 steps");
  manifest = good_manifest();
  manifest.mutable_frames(3)->set_exposure_ms(8.0);
  refused(manifest, "each must be known");
  for (const double bad : std::initializer_list<double>{NAN, INFINITY, -1.0}) {
    manifest = good_manifest();
    manifest.mutable_frames(3)->set_exposure_ms(bad);
    refused(manifest, "it must be 0 or more");
    manifest = good_manifest();
    manifest.mutable_frames(3)->mutable_stimulus()->set_sigma_px(bad);
    refused(manifest, "shows a stripe of sigma");
  }
  manifest = good_manifest();
  manifest.mutable_frames(3)->mutable_stimulus()->set_r_px(NAN);
  refused(manifest, "shows a stripe of sigma");
  manifest = good_manifest();
  manifest.mutable_frames(4)->mutable_stimulus()->set_r_px(manifest.frames(3).stimulus().r_px());
  manifest.mutable_frames(4)->mutable_stimulus()->set_peak(0.5);
  refused(manifest, "brighter or darker");
  manifest = good_manifest();
  manifest.mutable_frames(2)->mutable_stimulus()->set_panel("left");
  refused(manifest, "\"left\"");
}

TEST(LayOut, PutsExposuresOfOneStripeTogether) {
  v1::CaptureManifest manifest = good_manifest();
  for (v1::Frame& frame : *manifest.mutable_frames()) frame.set_exposure_ms(4.0);
  const int count = manifest.frames_size();
  for (int i = 0; i < count; ++i) {
    v1::Frame longer = manifest.frames(i);
    longer.set_exposure_ms(16.0);
    *manifest.add_frames() = longer;
  }
  const StackLayout layout = lay_out(manifest).value();
  EXPECT_EQ(Exposures::of(manifest).value().times_ms().size(), 2u);
  EXPECT_EQ(layout.stage.black.size(), 2u);
  for (const SweepLayout& sweep : layout.sweeps) {
    ASSERT_EQ(sweep.shots.size(), 5u);
    for (const Shot& shot : sweep.shots) {
      ASSERT_EQ(shot.size(), 2u);
      EXPECT_EQ(shot[0].scale + shot[1].scale, 1.25);
    }
  }
}

TEST(MakeMethod, ListsWhatThereIs) {
  EXPECT_NE(std::string(make_method("magic", {}).status().message()).find("gaussian"), std::string::npos);
  EXPECT_NE(std::string(make_method("gaussian", {{"mods", "2"}}).status().message()).find("modes"),
            std::string::npos);
  for (const char* value : {"0", "9", "two", "", "nan"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(make_method("gaussian", {{"modes", value}}).status())) << value;
  }
  EXPECT_TRUE(absl::IsInvalidArgument(make_method("gaussian", {{"oriented", "0.5"}}).status()));
}

}  // namespace
}  // namespace glasswing
