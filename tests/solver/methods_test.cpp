// The one table of options: solvers take what it says, and the docs say what it says.
#include "core/method/methods.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/file/file.h"
#include "core/footprint/footprint.h"
#include "core/matte/matte.h"
#include "core/pattern/plan.h"
#include "solver/gaussian/fewer_images.h"
#include "solver/method/method.h"
#include "solver/method/video_method.h"
#include "solver/methods.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

absl::Status made(std::string_view method, const MethodOptions& options) {
  return method == kRampMethod ? make_video_method(std::string(method), options).status()
                               : make_method(std::string(method), options).status();
}

const MethodOption& option_of(std::string_view method, std::string_view name) {
  const std::span<const MethodOption> options = options_of(method);
  return *std::ranges::find(options, name, &MethodOption::name);
}

// `option` alone, with the setting that it needs.
MethodOptions setting(const MethodOption& option, const std::string& value) {
  MethodOptions options;
  if (!option.only_with.empty()) options.insert(parse_setting(std::string(option.only_with)).value());
  options.insert_or_assign(std::string(option.name), value);
  return options;
}

std::string text_of(double number) {
  return fmt::format("{}", number);
}

TEST(MethodOptions, EveryMethodTakesWhatItsTableSaysAndNothingBeyond) {
  for (const std::string& method : method_names()) {
    ASSERT_FALSE(options_of(method).empty()) << method;
    EXPECT_OK(made(method, {})) << method;
    for (const MethodOption& option : options_of(method)) {
      const auto takes = [&](const std::string& value) { return made(method, setting(option, value)).ok(); };
      SCOPED_TRACE(fmt::format("{} {}", method, option.name));
      EXPECT_FALSE(takes("no value of any"));
      EXPECT_FALSE(takes(""));
      EXPECT_FALSE(takes("nan"));
      for (const std::string_view choice : option.choices) EXPECT_TRUE(takes(std::string(choice)));
      if (!option.choices.empty()) continue;
      EXPECT_TRUE(takes(text_of(option.low)) && takes(text_of(option.high)));
      EXPECT_FALSE(takes(text_of(std::nextafter(option.low, -1.0))));
      EXPECT_FALSE(takes(text_of(std::nextafter(option.high, 1e9))));
      EXPECT_EQ(takes(text_of(0.5 * option.low + 0.5 * (option.low + 1.0))),
                !option.whole && option.low + 0.5 <= option.high);
    }
  }
  EXPECT_TRUE(options_of("magic").empty());
}

TEST(MethodOptions, UnknownOnesAreToldWhatThereIs) {
  const absl::Status status = made("fringe", {{"images", "100"}});
  EXPECT_EQ(status.message(),
            "option \"images\" is not known to fringe; it has: modes, silhouette_tolerance, tolerance");
  EXPECT_EQ(made("gaussian", {{"modes", "99"}}).message(),
            "modes is \"99\"; it must be a whole number, 1 to 8");
  EXPECT_EQ(made("ramp", {{"smoothing", "much"}}).message(),
            "smoothing is \"much\"; it must be adaptive, perona-malik or none");
  EXPECT_EQ(made("alpha", {{"a1", "1"}}).message(), "option \"a1\" of alpha needs backings=1 with it");
}

TEST(MethodOptions, RangesAreThoseOfMattesAndSolvers) {
  EXPECT_EQ(option_of("gaussian", "modes").high, kMaxModes);
  EXPECT_EQ(option_of("fringe", "modes").high, kMaxFootprints);
  EXPECT_EQ(option_of("gaussian", "images").low, kMinImages);
  EXPECT_EQ(option_of("gaussian", "images").high, kMaxImages);
}

TEST(MethodOptions, ValuesAreThoseGivenElseTheDefaults) {
  const OptionValues values = OptionValues::read("gaussian", {{"modes", "2"}}).value();
  EXPECT_EQ(values.whole("modes"), 2);
  EXPECT_TRUE(values.is_set("oriented"));
  EXPECT_EQ(values.number("silhouette_tolerance"), 0.003);
  EXPECT_FALSE(values.has("images"));
  EXPECT_EQ(OptionValues::read("ramp", {}).value().text("smoothing"), "adaptive");
}

// docs/method-options.md has a table of each method's options.
TEST(MethodOptions, TheDocsListThem) {
  const std::string docs =
      read_file(std::string(std::getenv("GLASSWING_DOCS")) + "/method-options.md").value();
  for (const std::string& method : method_names()) {
    std::string rows =
        fmt::format("## {}\n\n| option | takes | default | |\n| --- | --- | --- | --- |\n", method);
    for (const MethodOption& option : options_of(method)) {
      rows +=
          fmt::format("| `{}` | {} | {} | {}{} |\n", option.name, range_of(option), option.usual, option.help,
                      option.only_with.empty() ? "" : fmt::format("; only with `{}`", option.only_with));
    }
    EXPECT_NE(docs.find(rows), std::string::npos) << "docs/method-options.md must contain:\n" << rows;
  }
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
