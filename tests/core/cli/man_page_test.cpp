#include "core/cli/man_page.h"

#include <gtest/gtest.h>

#include "core/cli/help.h"
#include "core/file/file.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

class Pages : public testing::Test {
 protected:
  Pages() {
    app_.footer(
        "More of it,\nin two lines.\n\n  kept  as it is\n\nExample:\n  tool cut a.exr --to 'x\\y' -o b.exr");
    app_.add_option("input", input_, ".dots and 'quotes' may begin a line")->required();
    app_.add_option("--part", part_, "of the whole")->check(CLI::Range(0.0, 1.0))->capture_default_str();
    app_.add_option("-k,--kind", kind_, "what comes out")->check(CLI::IsMember({"exr", "png"}));
    app_.add_flag("--fast", fast_, "sooner");
    CLI::App& cut = *app_.add_subcommand("cut", "Cut it.");
    cut.group("Work");
    app_.add_subcommand("secret", "Not for people.")->group("");
    setenv("SOURCE_DATE_EPOCH", "86400", 1);
    EXPECT_OK(write_man_pages(app_, 1, scratch_));
  }
  ~Pages() override { unsetenv("SOURCE_DATE_EPOCH"); }
  std::string page(const std::string& name) const { return read_file(scratch_ / name).value_or(""); }

  const TemporaryDirectory scratch_;
  std::string input_, kind_;
  double part_ = 0.5;
  bool fast_ = false;
  CLI::App app_{"Does something.", "tool"};
};

TEST_F(Pages, HaveEverythingThatHelpHas) {
  const std::string text = page("tool.1");
  for (const char* words : {".TH \"TOOL\" \"1\" \"1970-01-02\"", "tool \\- Does something\n",
                            "\\fBtool\\fR [\\fIoptions\\fR] \\fIinput\\fR", "\\&.dots and 'quotes'",
                            "\\fB\\-\\-part\\fR \\fINUMBER\\fR\nof the whole (0 to 1; default: 0.5)",
                            "\\fB\\-k\\fR, \\fB\\-\\-kind\\fR \\fIexr|png\\fR", "\\fB\\-\\-fast\\fR\nsooner",
                            ".SS Work\n.TP\n\\fBtool\\-cut\\fR(1)\nCut it.", "More of it,\nin two lines.\n",
                            ".nf\n  kept  as it is\n.fi", "tool cut a.exr \\-\\-to 'x\\ey' \\-o b.exr"})
    EXPECT_NE(text.find(words), std::string::npos) << words << " is not in\n" << text;
  EXPECT_NE(page("tool-cut.1").find(".SH SEE ALSO\n\\fBtool\\fR(1)"), std::string::npos);
}

TEST_F(Pages, LeaveOutWhatIsHidden) {
  EXPECT_EQ(page("tool-secret.1"), "");
  EXPECT_EQ(page("tool.1").find("secret"), std::string::npos);
}

TEST_F(Pages, HelpSaysWhatAnOptionMayBe) {
  use_help_format(app_);
  const std::string help = app_.help();
  EXPECT_NE(help.find("--part NUMBER "), std::string::npos) << help;
  EXPECT_NE(help.find("of the whole (0 to 1; default: 0.5)"), std::string::npos) << help;
  EXPECT_NE(help.find("-k,--kind exr|png "), std::string::npos) << help;
}

}  // namespace
}  // namespace glasswing
