#include "server/rig/rig_lock.h"

#include <gtest/gtest.h>

#include <thread>

#include "tests/support/status.h"

namespace glasswing {
namespace {

const Caller kAnna{.client = "anna@lab3", .hold = ""}, kBen{.client = "ben@lab4", .hold = ""};

bool says(const absl::Status& status, const std::string& words) {
  return absl::IsFailedPrecondition(status) && std::string(status.message()).find(words) != std::string::npos;
}

TEST(RigLock, OneDrivesAndTheOthersAreToldWho) {
  RigLock lock;
  EXPECT_FALSE(lock.holder().has_value());
  absl::StatusOr<RigLock::Drive> drive = lock.drive(kAnna, "session vase", "glasswing cancel vase");
  ASSERT_OK(drive);
  const absl::Status refused = lock.drive(kBen, "doctor").status();
  EXPECT_TRUE(says(refused, "the rig is held by session vase, started by anna@lab3 at ")) << refused;
  EXPECT_TRUE(says(refused, "; wait for it, or cancel it: glasswing cancel vase")) << refused;
  EXPECT_FALSE(lock.hold(kBen, "a series").ok());
  EXPECT_EQ(lock.holder()->client(), "anna@lab3");
  EXPECT_EQ(lock.holder()->what(), "session vase");
  EXPECT_OK(lock.check(kBen)) << "anybody may stop what runs";
  drive->reset();
  EXPECT_FALSE(lock.holder().has_value());
  EXPECT_OK(lock.drive(kBen, "doctor"));
}

TEST(RigLock, AHoldKeepsTheRigBetweenSessions) {
  RigLock lock;
  absl::StatusOr<RigLock::Hold> hold = lock.hold(kAnna, "turntable series");
  ASSERT_OK(hold);
  const Caller member{.client = "anna@lab3", .hold = hold->get_deleter().token};
  for (int session = 0; session < 2; ++session) {
    const absl::Status refused = lock.drive(kBen, "doctor").status();
    EXPECT_TRUE(says(refused, "the rig is held for \"turntable series\", taken by anna@lab3 at ")) << refused;
    EXPECT_TRUE(says(lock.check(kBen), "turntable series"));
    EXPECT_FALSE(lock.drive(kAnna, "doctor").ok()) << "the token counts, not the name";
    const absl::StatusOr<RigLock::Drive> drive = lock.drive(member, "session a");
    EXPECT_OK(drive);
    EXPECT_OK(lock.check(member));
    EXPECT_TRUE(says(lock.drive(member, "session b").status(), "session a"));
    EXPECT_EQ(lock.holder()->what(), "turntable series (session a)");
  }
  hold->reset();
  EXPECT_OK(lock.drive(kBen, "doctor"));
  // A caller whose hold has ended is refused.
  EXPECT_TRUE(says(lock.drive(member, "session c").status(), "has ended"));
  absl::StatusOr<RigLock::Hold> next = lock.hold(kBen, "another series");
  ASSERT_OK(next);
  EXPECT_TRUE(says(lock.check(member), "has ended"));
  EXPECT_NE(next->get_deleter().token, member.hold);
}

TEST(RigLock, WhatDrivesWhenAHoldEndsGoesOn) {
  RigLock lock;
  absl::StatusOr<RigLock::Hold> hold = lock.hold(kAnna, "series");
  absl::StatusOr<RigLock::Drive> drive =
      lock.drive({.client = "anna@lab3", .hold = hold->get_deleter().token}, "session a");
  hold->reset();
  EXPECT_EQ(lock.holder()->what(), "session a");
  EXPECT_TRUE(says(lock.drive(kBen, "doctor").status(), "session a"));
  drive->reset();
  EXPECT_OK(lock.drive(kBen, "doctor"));
}

TEST(RigLock, AHoldLastsAsLongAsAnyOfItsCalls) {
  RigLock lock;
  absl::StatusOr<RigLock::Hold> first = lock.hold(kAnna, "series");
  const Caller member{.client = "anna@lab3", .hold = first->get_deleter().token};
  absl::StatusOr<RigLock::Hold> second = lock.hold(member, "ignored");
  ASSERT_OK(second);
  EXPECT_EQ(second->get_deleter().token, member.hold);
  first->reset();
  EXPECT_EQ(lock.holder()->what(), "series");
  second->reset();
  EXPECT_FALSE(lock.holder().has_value());
}

TEST(RigLock, AnAbandonedHoldLingersUntilItIsJoinedOrItsTimeIsOver) {
  RigLock lock;
  absl::StatusOr<RigLock::Hold> hold = lock.hold(kAnna, "series", std::chrono::hours(1));
  const Caller member{.client = "anna@lab3", .hold = hold->get_deleter().token};
  hold->reset();
  EXPECT_TRUE(says(lock.drive(kBen, "doctor").status(), "series"));
  EXPECT_OK(lock.drive(member, "session a"));
  hold = lock.hold(member, "series", std::chrono::milliseconds(1));
  ASSERT_OK(hold);
  hold->reset();
  while (lock.holder()) std::this_thread::yield();
  EXPECT_TRUE(says(lock.hold(member, "series").status(), "has ended"));
  EXPECT_OK(lock.drive(kBen, "doctor"));
}

TEST(RigLock, AReleasedHoldEndsForAllItsCalls) {
  RigLock lock;
  EXPECT_TRUE(says(lock.release(kAnna), "does not belong to a hold"));
  absl::StatusOr<RigLock::Hold> hold = lock.hold(kAnna, "series", std::chrono::hours(1));
  const Caller member{.client = "anna@lab3", .hold = hold->get_deleter().token};
  EXPECT_TRUE(says(lock.release({.client = "ben@lab4", .hold = "guessed"}), "has ended"));
  EXPECT_OK(lock.release(member));
  absl::StatusOr<RigLock::Hold> next = lock.hold(kBen, "another series");
  ASSERT_OK(next);
  hold->reset();  // does not end the next one
  EXPECT_EQ(lock.holder()->what(), "another series");
  EXPECT_TRUE(says(lock.release(member), "has ended"));
}

}  // namespace
}  // namespace glasswing
