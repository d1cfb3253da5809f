#include "server/rig/rig_lock.h"

#include <gtest/gtest.h>

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
  ASSERT_TRUE(drive.ok()) << drive.status();
  const absl::Status refused = lock.drive(kBen, "doctor").status();
  EXPECT_TRUE(says(refused, "the rig is held by session vase, started by anna@lab3 at ")) << refused;
  EXPECT_TRUE(says(refused, "; wait for it, or cancel it: glasswing cancel vase")) << refused;
  EXPECT_FALSE(lock.hold(kBen, "a series").ok());
  EXPECT_EQ(lock.holder()->client(), "anna@lab3");
  EXPECT_EQ(lock.holder()->what(), "session vase");
  EXPECT_TRUE(lock.check(kBen).ok()) << "anybody may stop what runs";
  drive->reset();
  EXPECT_FALSE(lock.holder().has_value());
  EXPECT_TRUE(lock.drive(kBen, "doctor").ok());
}

TEST(RigLock, AHoldKeepsTheRigBetweenSessions) {
  RigLock lock;
  absl::StatusOr<RigLock::Hold> hold = lock.hold(kAnna, "turntable series");
  ASSERT_TRUE(hold.ok()) << hold.status();
  const Caller member{.client = "anna@lab3", .hold = lock.token()};
  for (int session = 0; session < 2; ++session) {
    const absl::Status refused = lock.drive(kBen, "doctor").status();
    EXPECT_TRUE(says(refused, "the rig is held for \"turntable series\", taken by anna@lab3 at ")) << refused;
    EXPECT_TRUE(says(lock.check(kBen), "turntable series"));
    EXPECT_FALSE(lock.drive(kAnna, "doctor").ok()) << "the token counts, not the name";
    const absl::StatusOr<RigLock::Drive> drive = lock.drive(member, "session a");
    EXPECT_TRUE(drive.ok()) << drive.status();
    EXPECT_TRUE(lock.check(member).ok());
    EXPECT_TRUE(says(lock.drive(member, "session b").status(), "session a"));
    EXPECT_EQ(lock.holder()->what(), "turntable series");
  }
  EXPECT_FALSE(lock.hold(member, "another").ok());
  hold->reset();
  EXPECT_TRUE(lock.drive(kBen, "doctor").ok());
  // A caller whose hold has ended is refused.
  EXPECT_TRUE(says(lock.drive(member, "session c").status(), "has ended"));
  absl::StatusOr<RigLock::Hold> next = lock.hold(kBen, "another series");
  ASSERT_TRUE(next.ok());
  EXPECT_TRUE(says(lock.check(member), "has ended"));
  EXPECT_NE(lock.token(), member.hold);
}

TEST(RigLock, WhatDrivesWhenAHoldEndsGoesOn) {
  RigLock lock;
  absl::StatusOr<RigLock::Hold> hold = lock.hold(kAnna, "series");
  absl::StatusOr<RigLock::Drive> drive =
      lock.drive({.client = "anna@lab3", .hold = lock.token()}, "session a");
  hold->reset();
  EXPECT_EQ(lock.holder()->what(), "session a");
  EXPECT_TRUE(says(lock.drive(kBen, "doctor").status(), "session a"));
  drive->reset();
  EXPECT_TRUE(lock.drive(kBen, "doctor").ok());
}

}  // namespace
}  // namespace glasswing
