#include "console/routes/json_bounds.h"

#include <gtest/gtest.h>

#include <string>

namespace glasswing {
namespace {

std::string repeated(const std::string& part, int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += part;
  return text;
}

TEST(JsonBounds, DepthObjectsAndValuesHaveALimit) {
  EXPECT_EQ(check_json_bounds(repeated("[", kMaxJsonDepth)), absl::OkStatus());
  EXPECT_TRUE(absl::IsInvalidArgument(check_json_bounds(repeated("[", kMaxJsonDepth + 1))));
  EXPECT_EQ(check_json_bounds("[" + repeated("{},", kMaxJsonObjects - 1)), absl::OkStatus());
  EXPECT_TRUE(absl::IsInvalidArgument(check_json_bounds("[" + repeated("{},", kMaxJsonObjects))));
  EXPECT_EQ(check_json_bounds(repeated("1,", kMaxJsonValues)), absl::OkStatus());
  EXPECT_TRUE(absl::IsInvalidArgument(check_json_bounds(repeated("1,", kMaxJsonValues + 1))));
}

TEST(JsonBounds, WhatStringsHoldIsNotCounted) {
  const std::string brackets = repeated("[", kMaxJsonDepth + 1);
  EXPECT_EQ(check_json_bounds("{\"a\": \"" + brackets + "\"}"), absl::OkStatus());
  EXPECT_EQ(check_json_bounds("{\"a\": \"\\\"" + brackets + "\"}"), absl::OkStatus())
      << "an escaped quote ends no string";
  EXPECT_FALSE(check_json_bounds("{\"a\": \"\\\\\"" + brackets).ok())
      << "an escaped backslash does not escape it";
  EXPECT_EQ(check_json_bounds("{\"a"), absl::OkStatus()) << "no JSON, which the parser says";
}

}  // namespace
}  // namespace glasswing
