#include "solver/method/exposure_changes.h"

#include <absl/status/status.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace glasswing {
namespace {

constexpr int kWidth = 60, kHeight = 64, kFrames = 12;

// The left third is a surround of constant light; the rest shows a random half of a pattern in each frame.
struct Photographs {
  explicit Photographs(const std::array<double, 3>& gains, bool timed = false) {
    manifest.mutable_camera()->set_width_px(kWidth);
    manifest.mutable_camera()->set_height_px(kHeight);
    std::mt19937 random(3);
    std::normal_distribution<double> noise(0.0, 0.002);
    for (int f = 0; f < kFrames; ++f) {
      v1::Frame& frame = *manifest.add_frames();
      frame.set_file("photograph" + std::to_string(f) + ".tif");
      frame.mutable_stimulus()->set_kind("square");
      if (timed) frame.set_exposure_start_ns(1000 * (f + 1));
      std::vector<std::uint16_t>& own = samples.emplace_back();
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          const double light = x < kWidth / 3 ? 0.2 + 0.01 * x : random() % 2 == 0 ? 0.1 : 0.6;
          for (const double gain : gains)
            own.push_back(
                static_cast<std::uint16_t>(65535.0 * ((f == 4 ? gain : 1.0) * light + noise(random))));
        }
      }
    }
  }

  absl::StatusOr<std::vector<std::array<float, 3>>> measured() const {
    return measure_exposure_changes(manifest, [this](int row, const std::vector<int>& frames) {
      std::vector<std::uint16_t> read;
      for (const int frame : frames) {
        const auto first = samples[frame].begin() + row * kWidth * 3;
        read.insert(read.end(), first, first + kWidth * 3);
      }
      return absl::StatusOr<std::vector<std::uint16_t>>(std::move(read));
    });
  }

  v1::CaptureManifest manifest;
  std::vector<std::vector<std::uint16_t>> samples;
};

TEST(ExposureChanges, AreFoundByChannelFromASurround) {
  const std::array<double, 3> gains{0.83, 0.88, 0.86};
  const auto measured = Photographs(gains).measured().value();
  ASSERT_EQ(measured.size(), static_cast<size_t>(kFrames));
  for (size_t f = 0; f < measured.size(); ++f) {
    // The median of some hundred ratios, each within 1 %.
    for (size_t c = 0; c < 3; ++c)
      EXPECT_NEAR(static_cast<double>(measured[f][c]), f == 4 ? gains[c] : 1.0, 0.003) << f << " " << c;
  }
}

TEST(ExposureChanges, AreNoneWhereNothingChangedOrTimesAreKnown) {
  EXPECT_TRUE(Photographs({1.0, 1.0, 1.0}).measured().value().empty());
  EXPECT_TRUE(Photographs({0.8, 0.8, 0.8}, true).measured().value().empty());
}

TEST(ExposureChanges, OneTooLargeIsNamed) {
  const absl::Status status = Photographs({0.5, 0.5, 0.5}).measured().status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status));
  EXPECT_NE(std::string(status.message()).find("photograph4.tif is 0.50 times as bright"), std::string::npos)
      << status;
}

}  // namespace
}  // namespace glasswing
