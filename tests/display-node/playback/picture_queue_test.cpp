#include "display-node/playback/picture_queue.h"

#include <gtest/gtest.h>

namespace glasswing {
namespace {

constexpr int kSteps = 200;

// Step i is gray i; every tenth is black.
Program program(const std::vector<ScreenInfo>& screens) {
  v1::LoadProgramRequest request;
  request.set_program("p");
  request.set_hold_refreshes(2);
  for (int i = 0; i < kSteps; ++i) {
    v1::ProgramStep& step = *request.add_steps();
    step.set_step(i);
    if (i % 10 == 0) continue;
    v1::Stimulus& stimulus = *step.add_stimuli();
    stimulus.set_kind("solid");
    stimulus.set_panel("back");
    for (int c = 0; c < 3; ++c) stimulus.add_colour(i / 255.0);
  }
  return Program::create(request, screens, ImageStore()).value();
}

TEST(PictureQueue, GivesEachStepOnceInOrder) {
  const Program shown = program({{.name = "back", .width_px = 16, .height_px = 8, .bits = 8}});
  for (const unsigned threads : {0u, 1u, 2u, 7u}) {
    PictureQueue queue(shown, threads);
    for (int i = 0; i < kSteps; ++i) {
      const std::vector<Picture> pictures = queue.next();
      ASSERT_EQ(pictures.size(), 1u);
      if (i % 10 == 0)
        EXPECT_EQ(pictures[0], nullptr);
      else
        EXPECT_EQ(pictures[0]->samples,
                  std::vector<std::uint16_t>(16 * 8 * 3, static_cast<std::uint16_t>(i)));
    }
  }
}

TEST(PictureQueue, EndsInMidProgram) {
  const Program shown = program({{.name = "back", .width_px = 256, .height_px = 256}});
  for (int taken = 0; taken < 5; ++taken) {
    PictureQueue queue(shown, 3);
    for (int i = 0; i < taken; ++i) queue.next();
  }
}

}  // namespace
}  // namespace glasswing
