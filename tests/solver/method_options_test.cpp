// The names that servers know are those that solvers take.
#include "core/pattern/method_options.h"

#include <gtest/gtest.h>

#include "core/pattern/plan.h"
#include "solver/method/method.h"
#include "solver/method/video_method.h"
#include "solver/methods.h"

namespace glasswing {
namespace {

absl::Status made(const std::string& method, const std::string& option) {
  const MethodOptions options = {{option, "no value of any"}};
  return method == kRampMethod ? make_video_method(method, options).status()
                               : make_method(method, options).status();
}

TEST(MethodOptionNames, EveryMethodTakesItsOwnAndNoOther) {
  for (const std::string_view method : kMethods) {
    ASSERT_FALSE(option_names(method).empty()) << method;
    for (const std::string_view of : kMethods) {
      for (const std::string_view option : option_names(of)) {
        const absl::Status status = made(std::string(method), std::string(option));
        const bool unknown = status == unknown_option(method, option);
        EXPECT_EQ(unknown, !check_option(method, option).ok()) << method << " " << option << ": " << status;
        EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;  // the value is none either
      }
    }
  }
  EXPECT_TRUE(option_names("magic").empty());
}

}  // namespace
}  // namespace glasswing
