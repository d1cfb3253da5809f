// Servers and solvers know the same option names.
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
        EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;  // the value is invalid too
      }
    }
  }
  EXPECT_TRUE(option_names("magic").empty());
}

TEST(ParseSetting, TakesANameAndAnyValue) {
  using Setting = std::pair<std::string, std::string>;
  EXPECT_EQ(parse_setting("modes=2").value(), Setting("modes", "2"));
  EXPECT_EQ(parse_setting("images=").value(), Setting("images", ""));
  EXPECT_EQ(parse_setting("a=b=c").value(), Setting("a", "b=c"));
}

// The client and the solver used to disagree about an empty name.
TEST(ParseSetting, RefusesASettingWithoutAName) {
  for (const char* setting : {"=3", "=", "modes", ""}) {
    const absl::Status status = parse_setting(setting).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << setting;
    EXPECT_NE(std::string(status.message()).find("NAME=VALUE"), std::string::npos) << status;
  }
}

}  // namespace
}  // namespace glasswing
