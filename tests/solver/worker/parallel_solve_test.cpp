#include "solver/worker/parallel_solve.h"

#include <gtest/gtest.h>

#include <mutex>

namespace glasswing {
namespace {

constexpr int kWidth_px = 5;

// Writes a pixel's first sample as its foreground, and keeps how many rows it was given each time.
class Copying : public Method {
 public:
  class Prepared : public PreparedMethod {
   public:
    explicit Prepared(const Copying& method) : method_(method) {}
    const std::vector<int>& frames_needed() const override { return method_.needed_; }
    absl::StatusOr<Matte> solve(const FrameStack& rows) const override {
      {
        const std::lock_guard lock(method_.mutex_);
        method_.row_counts_.push_back(rows.row_count);
      }
      Matte matte = blank_matte(rows, {}, 1);
      for (int y = 0; y < rows.row_count; ++y) {
        for (int x = 0; x < rows.width_px; ++x) matte.foreground(x, y)[0] = rows.at(0, x, y, 0);
      }
      return matte;
    }

   private:
    const Copying& method_;
  };
  absl::StatusOr<std::unique_ptr<PreparedMethod>> prepare(const v1::CaptureManifest&) const override {
    return std::make_unique<Prepared>(*this);
  }
  const std::vector<int>& row_counts() const { return row_counts_; }

 private:
  const std::vector<int> needed_{0};
  mutable std::mutex mutex_;
  mutable std::vector<int> row_counts_;
};

TEST(ParallelSolve, EveryRowIsSolvedOnce) {
  v1::CaptureManifest manifest;
  manifest.mutable_camera()->set_width_px(kWidth_px);
  manifest.add_frames()->mutable_stimulus()->set_kind("solid");
  for (const int row_count : {1, 2, 16, 31, 32, 33, 64}) {
    std::vector<std::uint16_t> samples(3 * kWidth_px * row_count);
    for (size_t i = 0; i < samples.size(); ++i) samples[i] = static_cast<std::uint16_t>(40 * i);
    const FrameStack stack{
        .width_px = kWidth_px, .first_row = 7, .row_count = row_count, .rows = {samples}, .owner = nullptr};
    for (const int thread_count : {1, 3}) {
      const Copying method;
      double last = 0.0;
      std::mutex mutex;
      const Matte matte = solve_in_bands(method, manifest, stack, thread_count, {}, [&](double share) {
                            const std::lock_guard lock(mutex);
                            EXPECT_LE(share, 1.0);
                            last = std::max(last, share);
                          }).value();
      EXPECT_EQ(last, 1.0);
      int solved = 0;
      for (const int rows : method.row_counts()) {
        EXPECT_GT(rows, 0) << row_count << " rows, " << thread_count << " threads";
        solved += rows;
      }
      EXPECT_EQ(solved, row_count);
      for (int y = 0; y < row_count; ++y) {
        for (int x = 0; x < kWidth_px; ++x)
          EXPECT_EQ(matte.foreground(x, y)[0], stack.at(0, x, y, 0)) << x << " " << y;
      }
    }
  }
}

// A picture whose channels are linear in x and y comes back from its mosaic as it was, but for what lies at
// the picture's edge, whichever rows are solved by which thread and on whichever row the stack begins.
TEST(ParallelSolve, MethodsThatDoNotSolveMosaicsGetThemInterpolated) {
  constexpr int kHeight_px = 24, kWide_px = 9;
  v1::CaptureManifest manifest;
  manifest.mutable_camera()->set_width_px(kWide_px);
  manifest.mutable_camera()->set_height_px(kHeight_px);
  manifest.mutable_camera()->set_mosaic("GRBG");
  manifest.add_frames()->mutable_stimulus()->set_kind("solid");
  const Mosaic mosaic = Mosaic::parse("GRBG").value();
  const auto light = [](int x, int y, int c) {
    return static_cast<std::uint16_t>(2000 * c + 100 * x + (50 + 10 * c) * y);
  };
  std::vector<std::uint16_t> sites;
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWide_px; ++x) sites.push_back(light(x, y, mosaic.channel(x, y)));
  }
  for (const int first : {0, 1, 6}) {
    const int count = kHeight_px - 2 * first;
    const FrameStack stack{.width_px = kWide_px,
                           .first_row = first,
                           .row_count = count,
                           .rows = {std::span(sites).subspan(first * kWide_px, count * kWide_px)},
                           .owner = nullptr,
                           .mosaic = mosaic};
    const Matte matte = solve_in_bands(Copying(), manifest, stack, 2).value();
    for (int y = 1; y + 1 < count; ++y) {
      for (int x = 1; x + 1 < kWide_px; ++x)
        EXPECT_NEAR(matte.foreground(x, y)[0], static_cast<float>(light(x, first + y, 0)) / 65535.0f, 1e-6)
            << x << " " << y;
    }
    EXPECT_TRUE(matte.metadata.mosaic().empty());
    ASSERT_EQ(matte.metadata.warnings_size(), 1);
    EXPECT_NE(matte.metadata.warnings(0).find("interpolated"), std::string::npos);
  }
}

TEST(ParallelSolve, StopsWhenAsked) {
  v1::CaptureManifest manifest;
  manifest.mutable_camera()->set_width_px(kWidth_px);
  manifest.add_frames();
  const std::vector<std::uint16_t> samples(3 * kWidth_px * 64);
  const FrameStack stack{
      .width_px = kWidth_px, .first_row = 0, .row_count = 64, .rows = {samples}, .owner = nullptr};
  std::stop_source stop;
  const Copying method;
  const absl::Status status = solve_in_bands(method, manifest, stack, 1, stop.get_token(), [&](double) {
                                stop.request_stop();
                              }).status();
  EXPECT_TRUE(absl::IsCancelled(status)) << status;
  EXPECT_EQ(method.row_counts().size(), 1u);
}

}  // namespace
}  // namespace glasswing
