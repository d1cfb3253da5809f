#include "core/footprint/matte_covariance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "tests/support/status.h"

namespace glasswing {
namespace {

v1::MatteMetadata metadata_of_waves() {
  v1::MatteMetadata metadata;
  v1::Monitor& monitor = *metadata.add_monitors();
  monitor.set_width_px(40);
  monitor.set_height_px(30);
  v1::WaveSet& set = *metadata.mutable_mixture()->add_wave_sets();
  for (const double phase_deg : {0.0, 90.0}) set.add_phase_deg(phase_deg);
  for (int i = 0; i < 12; ++i) {
    const double turn = 0.5 * i, frequency = 0.01 + 0.02 * i;
    set.add_x_per_px(static_cast<float>(frequency * std::cos(turn)));
    set.add_y_per_px(static_cast<float>(frequency * std::sin(turn)));
  }
  set.set_light(0.9);
  set.set_count(2);
  return metadata;
}

TEST(MatteCovariance, WhatNoOneShowedIsRefused) {
  ASSERT_OK(MatteCovariance::create(metadata_of_waves()));
  EXPECT_EQ(MatteCovariance::create(v1::MatteMetadata()).status().code(),
            absl::StatusCode::kFailedPrecondition);
  const std::function<void(v1::MatteMetadata&, v1::WaveSet&)> faults[] = {
      [](auto&, v1::WaveSet& set) { set.set_texture(1); },
      [](auto&, v1::WaveSet& set) { set.set_light(0.0); },
      [](auto&, v1::WaveSet& set) { set.set_light(1.1); },
      [](auto&, v1::WaveSet& set) { set.set_count(0); },
      [](auto&, v1::WaveSet& set) { set.clear_phase_deg(); },
      [](auto&, v1::WaveSet& set) { set.add_phase_deg(INFINITY); },
      [](auto&, v1::WaveSet& set) { set.add_x_per_px(0.1f); },
      [](auto&, v1::WaveSet& set) { set.set_x_per_px(0, 0.6f); },
      [](auto&, v1::WaveSet& set) { set.set_y_per_px(3, std::numeric_limits<float>::quiet_NaN()); },
      [](auto&, v1::WaveSet& set) {
        for (int i = 0; i < 2000; ++i) set.add_phase_deg(i);
      },
      [](v1::MatteMetadata& metadata, auto&) { metadata.mutable_mixture()->add_sweeps()->set_sigma_px(2.0); },
  };
  for (size_t i = 0; i < std::size(faults); ++i) {
    v1::MatteMetadata metadata = metadata_of_waves();
    faults[i](metadata, *metadata.mutable_mixture()->mutable_wave_sets(0));
    EXPECT_EQ(MatteCovariance::create(metadata).status().code(), absl::StatusCode::kDataLoss) << i;
  }
}

}  // namespace
}  // namespace glasswing
