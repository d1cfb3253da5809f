#include "solver/worker/tile_solver.h"

#include <gtest/gtest.h>

#include "tests/support/status.h"

namespace glasswing {
namespace {

v1::CaptureManifest manifest_of(std::initializer_list<int> steps) {
  v1::CaptureManifest manifest;
  manifest.set_session("s");
  for (const int step : steps) manifest.add_frames()->set_step(step);
  return manifest;
}

TEST(KeepSteps, LeavesTheFramesOfADraftInTheirOrder) {
  v1::CaptureManifest manifest = manifest_of({4, 0, 7, 2, 9});
  v1::ClaimTileResponse tile;
  for (const int step : {2, 4, 9}) tile.add_draft_steps(step);
  ASSERT_OK(keep_steps(tile.draft_steps(), manifest));
  ASSERT_EQ(manifest.frames_size(), 3);
  EXPECT_EQ(manifest.frames(0).step(), 4);
  EXPECT_EQ(manifest.frames(1).step(), 2);
  EXPECT_EQ(manifest.frames(2).step(), 9);
  EXPECT_EQ(manifest.session(), "s");
}

TEST(KeepSteps, RefusesAnArchiveThatLacksOne) {
  v1::CaptureManifest manifest = manifest_of({0, 1});
  v1::ClaimTileResponse tile;
  for (const int step : {0, 1, 2}) tile.add_draft_steps(step);
  EXPECT_EQ(keep_steps(tile.draft_steps(), manifest).message(),
            "the archive has frames of 2 of the 3 steps of the draft");
}

}  // namespace
}  // namespace glasswing
