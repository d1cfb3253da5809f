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
  EXPECT_TRUE(check_json_bounds(repeated("[", kMaxJsonDepth)).ok());
  EXPECT_TRUE(absl::IsInvalidArgument(check_json_bounds(repeated("[", kMaxJsonDepth + 1))));
  EXPECT_TRUE(check_json_bounds("[" + repeated("{},", kMaxJsonObjects - 1)).ok());
  EXPECT_TRUE(absl::IsInvalidArgument(check_json_bounds("[" + repeated("{},", kMaxJsonObjects))));
  EXPECT_TRUE(check_json_bounds(repeated("1,", kMaxJsonValues)).ok());
  EXPECT_TRUE(absl::IsInvalidArgument(check_json_bounds(repeated("1,", kMaxJsonValues + 1))));
}

TEST(JsonBounds, WhatStringsHoldIsNotCounted) {
  const std::string brackets = repeated("[", kMaxJsonDepth + 1);
  EXPECT_TRUE(check_json_bounds("{\"a\": \"" + brackets + "\"}").ok());
  EXPECT_TRUE(check_json_bounds("{\"a\": \"\\\"" + brackets + "\"}").ok())
      << "an escaped quote ends no string";
  EXPECT_FALSE(check_json_bounds("{\"a\": \"\\\\\"" + brackets).ok())
      << "an escaped backslash does not escape it";
  EXPECT_TRUE(check_json_bounds("{\"a").ok()) << "no JSON, which the parser says";
}

}  // namespace
}  // namespace glasswing
