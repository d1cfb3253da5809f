#include "camera-node/services/form_choice.h"

#include <gtest/gtest.h>

namespace glasswing {
namespace {

using std::chrono::milliseconds;
constexpr nanoseconds kSoon = milliseconds(50), kLate = FormChoice::kMaxWait + milliseconds(1);
constexpr size_t kBytes = 10'000'000;

TEST(FormChoice, CompressesWhatDoesNotWait) {
  FormChoice choice;
  EXPECT_EQ(choice.choose(kSoon), FrameForm::kCompressed);
  choice.learn(FrameForm::kCompressed, kBytes, milliseconds(100));
  choice.learn(FrameForm::kPlain, kBytes, milliseconds(10));
  EXPECT_EQ(choice.choose(kSoon), FrameForm::kCompressed);
}

TEST(FormChoice, LateFramesAreStoredInTheFasterForm) {
  FormChoice choice;
  EXPECT_EQ(choice.choose(kLate), FrameForm::kPlain) << "nothing is known yet";
  choice.learn(FrameForm::kCompressed, kBytes, milliseconds(40));
  EXPECT_EQ(choice.choose(kLate), FrameForm::kPlain) << "plain is worth a try";
  choice.learn(FrameForm::kPlain, kBytes, milliseconds(30));
  EXPECT_EQ(choice.choose(kLate), FrameForm::kPlain);
  // The page cache is full, and the disk slow.
  for (int batch = 0; batch < 4; ++batch) choice.learn(FrameForm::kPlain, kBytes, milliseconds(80));
  EXPECT_EQ(choice.choose(kLate), FrameForm::kCompressed);
  for (int batch = 0; batch < 20; ++batch) choice.learn(FrameForm::kCompressed, kBytes, milliseconds(120));
  EXPECT_EQ(choice.choose(kLate), FrameForm::kPlain) << "the processor has other work now";
}

TEST(FormChoice, AnEmptyBatchTeachesNothing) {
  FormChoice choice;
  choice.learn(FrameForm::kCompressed, 0, milliseconds(5));
  choice.learn(FrameForm::kPlain, kBytes, milliseconds(80));
  EXPECT_EQ(choice.choose(kLate), FrameForm::kPlain);
}

}  // namespace
}  // namespace glasswing
