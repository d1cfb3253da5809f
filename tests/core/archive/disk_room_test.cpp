#include "core/archive/disk_room.h"

#include <gtest/gtest.h>

#include "tests/support/status.h"

namespace glasswing {
namespace {

SpaceOf disk_of(std::uintmax_t total, std::uintmax_t available) {
  return [=](const std::filesystem::path&) -> absl::StatusOr<std::filesystem::space_info> {
    return std::filesystem::space_info{.capacity = total, .free = available, .available = available};
  };
}

TEST(DiskRoom, WhatIsReservedIsNotFree) {
  const DiskRoom room("/frames", 300, disk_of(1000, 1000));
  EXPECT_EQ(room.room()->free_bytes, 700);
  EXPECT_OK(room.check(700));
  const absl::Status full = room.check(701);
  EXPECT_TRUE(absl::IsResourceExhausted(full)) << full;
  EXPECT_NE(full.message().find("/frames"), std::string::npos) << full;
  EXPECT_EQ(DiskRoom("/frames", 300, disk_of(1000, 200)).room()->free_bytes, 0);
}

TEST(DiskRoom, TheUsualReserveFollowsTheDisk) {
  const auto reserve = [](std::uintmax_t total) {
    return DiskRoom("/", std::nullopt, disk_of(total, total)).room()->reserve_bytes;
  };
  EXPECT_EQ(reserve(1'000'000'000), 100'000'000) << "a tenth of a small one";
  EXPECT_EQ(reserve(20'000'000'000), 1'000'000'000) << "at least 1 GB";
  EXPECT_EQ(reserve(1'000'000'000'000), 20'000'000'000) << "2 %";
}

TEST(DiskRoom, WhereTheSystemDoesNotTellTheWriteDoes) {
  const DiskRoom room("/frames", 300, [](const auto&) { return absl::UnavailableError("away"); });
  EXPECT_OK(room.check(1));
  EXPECT_FALSE(room.room().ok());
}

}  // namespace
}  // namespace glasswing
