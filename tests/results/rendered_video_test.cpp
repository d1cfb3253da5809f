#include "tests/results/rendered_video.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>

namespace glasswing {
namespace {

// The results of a plain inversion, a bilinear picture and a highlight over the interpolated ramp.
double floor_db(const VideoScore& score) {
  if (score.sequence == "ramp_dark") return score.photograph == "stone_dark" ? 35.9 : 37.4;
  if (score.sequence == "ramp_light") return 27.0;
  return 0.0;
}

TEST(RenderedVideo, Scores) {
  const char* data = std::getenv("GLASSWING_DATA");
  const std::filesystem::path directory =
      std::filesystem::path(data == nullptr ? "." : data) / "rendered/dev/F_video";
  if (!std::filesystem::exists(directory)) GTEST_SKIP() << "no data at " << directory;
  const auto scores = score_video(directory, {});
  ASSERT_TRUE(scores.ok()) << scores.status();
  EXPECT_FALSE(scores->empty());
  for (const VideoScore& score : *scores) {
    std::printf("%-18s %-16s %6.2f dB\n", score.sequence.c_str(), score.photograph.c_str(), score.psnr_db);
    EXPECT_GE(score.psnr_db, floor_db(score)) << score.sequence << " over " << score.photograph;
  }
}

}  // namespace
}  // namespace glasswing
