#include "core/radiometry/primary_mix.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace glasswing {
namespace {

// Rows are camera channels, with sums 0.5, 1 and 0.6.
constexpr double kCrosstalk[3][3] = {{0.45, 0.04, 0.01}, {0.10, 0.80, 0.10}, {0.00, 0.09, 0.51}};

v1::CaptureManifest manifest_of(const std::vector<double>& more_green) {
  v1::CaptureManifest manifest;
  for (size_t t = 0; t < more_green.size(); ++t) {
    const std::string name = "monitor-" + std::to_string(t);
    manifest.add_monitors()->set_name(name);
    v1::DisplayCalibration& display = *manifest.add_display_calibrations();
    display.set_monitor(name);
    for (const auto& row : kCrosstalk) {
      for (int p = 0; p < 3; ++p) display.add_crosstalk(row[p] + (p == 1 ? more_green[t] : 0.0));
    }
  }
  return manifest;
}

TEST(PrimaryMix, IsTheCrosstalkOfRowsOfSumOneAndItsInverse) {
  const PrimaryMix mix = PrimaryMix::create(manifest_of({0.0})).value();
  const PrimaryMix::Light light = {0.6f, 0.1f, 0.3f};
  const PrimaryMix::Light seen = mix.seen(0, light);
  const double white[3] = {0.5, 1.0, 0.6};
  for (size_t c = 0; c < 3; ++c) {
    const double expected =
        (kCrosstalk[c][0] * 0.6 + kCrosstalk[c][1] * 0.1 + kCrosstalk[c][2] * 0.3) / white[c];
    EXPECT_NEAR(static_cast<double>(seen[c]), expected, 1e-7);
    EXPECT_NEAR(mix.seen(0, {0.7f, 0.7f, 0.7f})[c], 0.7f, 1e-7f);  // white keeps its brightness
    EXPECT_NEAR(mix.primaries(seen)[c], light[c], 1e-6f);
  }
}

TEST(PrimaryMix, AMatteCarriesIt) {
  v1::CaptureManifest manifest = manifest_of({0.0, 0.05});
  manifest.add_monitors()->set_name("not calibrated");
  const PrimaryMix mix = PrimaryMix::create(manifest).value();
  v1::MatteMetadata metadata;
  *metadata.mutable_monitors() = manifest.monitors();
  mix.describe(metadata);
  const PrimaryMix again = PrimaryMix::create(metadata).value();
  const PrimaryMix::Light light = {0.6f, 0.1f, 0.3f};
  for (int t = 0; t < 3; ++t) EXPECT_EQ(again.seen(t, light), mix.seen(t, light));
  EXPECT_EQ(again.primaries(light), mix.primaries(light));
  EXPECT_EQ(mix.seen(2, light), light);
  EXPECT_NE(mix.seen(1, light), mix.seen(0, light));
}

TEST(PrimaryMix, WithoutCalibrationChannelsArePrimaries) {
  v1::CaptureManifest manifest;
  manifest.add_monitors()->set_name("back");
  const PrimaryMix mix = PrimaryMix::create(manifest).value();
  EXPECT_TRUE(mix.is_unit());
  const PrimaryMix::Light light = {0.6f, -0.1f, 3.0f};
  EXPECT_EQ(mix.seen(0, light), light);
  EXPECT_EQ(mix.primaries(light), light);
}

TEST(PrimaryMix, TellsHowFarMonitorsDiffer) {
  EXPECT_EQ(PrimaryMix::create(manifest_of({0.0, 0.0}))->spread(), 0.0);
  // Green's share of the red channel is 0.04 / 0.5 and 0.14 / 0.6.
  const double green = 0.5 * (0.14 / 0.6 - 0.04 / 0.5);
  EXPECT_GE(PrimaryMix::create(manifest_of({0.0, 0.1}))->spread(), green - 1e-12);
}

TEST(PrimaryMix, RefusesWhatCannotBe) {
  const auto message = [](const v1::CaptureManifest& manifest) {
    const absl::Status status = PrimaryMix::create(manifest).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status));
    return std::string(status.message());
  };
  v1::CaptureManifest manifest = manifest_of({0.0});
  manifest.mutable_display_calibrations(0)->mutable_crosstalk()->RemoveLast();
  EXPECT_NE(message(manifest).find("8 long"), std::string::npos);
  manifest = manifest_of({0.0});
  for (int i = 0; i < 9; ++i) manifest.mutable_display_calibrations(0)->set_crosstalk(i, 0.3);
  EXPECT_NE(message(manifest).find("hardly tells primaries apart"), std::string::npos);
  manifest.mutable_display_calibrations(0)->set_crosstalk(4, std::numeric_limits<double>::quiet_NaN());
  EXPECT_NE(message(manifest).find("finite"), std::string::npos);
  for (int i = 0; i < 3; ++i) manifest.mutable_display_calibrations(0)->set_crosstalk(i, 0.0);
  EXPECT_NE(message(manifest).find("sum 0"), std::string::npos);
}

}  // namespace
}  // namespace glasswing
