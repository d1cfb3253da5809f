// EXPECT_OK(x) and ASSERT_OK(x): x is an absl::Status, an absl::StatusOr or a grpc::Status that is OK. A
// failure prints its message.
#pragma once

#include <absl/status/statusor.h>
#include <gtest/gtest.h>

#include <string>

namespace glasswing::test {

inline std::string message_of(const absl::Status& status) {
  return status.ToString();
}
template <typename T>
std::string message_of(const absl::StatusOr<T>& result) {
  return result.status().ToString();
}
template <typename T>
requires requires(const T& status) {
  status.error_message();
}
std::string message_of(const T& status) {
  return std::to_string(static_cast<int>(status.error_code())) + ": " + status.error_message();
}

template <typename T>
testing::AssertionResult is_ok(const char* expression, const T& result) {
  if (result.ok()) return testing::AssertionSuccess();
  return testing::AssertionFailure() << expression << "\n  is " << message_of(result);
}

}  // namespace glasswing::test

#define EXPECT_OK(...) EXPECT_TRUE(::glasswing::test::is_ok(#__VA_ARGS__, (__VA_ARGS__)))
#define ASSERT_OK(...) ASSERT_TRUE(::glasswing::test::is_ok(#__VA_ARGS__, (__VA_ARGS__)))
