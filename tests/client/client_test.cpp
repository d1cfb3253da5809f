#include "client/cli/client.h"

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/client/run_glasswing.h"

namespace glasswing {
namespace {

using nlohmann::json;

TEST(Client, HelpSucceedsEverywhere) {
  EXPECT_EQ(run_glasswing({"--help"}).status, 0);
  for (const std::string command :
       {"nodes", "fleet", "sessions", "show", "watch", "pause", "resume", "cancel", "capture", "import",
        "export", "solve", "fetch", "composite", "compare", "convert", "doctor", "preview", "calibrate"}) {
    const Outcome outcome = run_glasswing({command, "--help"});
    EXPECT_EQ(outcome.status, 0) << command;
    EXPECT_NE(outcome.out.find("Example"), std::string::npos) << command;
  }
}

TEST(Client, HelpIsAlsoACommand) {
  EXPECT_EQ(run_glasswing({"help"}).out, run_glasswing({"--help"}).out);
  EXPECT_EQ(run_glasswing({"help", "plan", "check"}).out, run_glasswing({"plan", "check", "--help"}).out);
  const Outcome options = run_glasswing({"help", "solve", "fringe"});
  EXPECT_EQ(options.status, 0);
  EXPECT_NE(options.out.find("Options of method fringe"), std::string::npos) << options.out;
  EXPECT_NE(options.out.find("(a whole number, 1 to 4;"), std::string::npos) << options.out;
}

TEST(Client, UsageErrorsAreOneLine) {
  const auto expect_usage_error = [](const std::vector<std::string>& arguments, const std::string& words) {
    const Outcome outcome = run_glasswing(arguments);
    expect_one_line_error(outcome, words);
    EXPECT_EQ(outcome.status, kUsageError) << words;
  };
  EXPECT_EQ(run_glasswing({}).out, run_glasswing({"--help"}).out);
  expect_usage_error({"captrue", "plan.txtpb"},
                     "there is no command captrue; did you mean capture? (glasswing --help");
  expect_usage_error({"plan", "chek", "p"},
                     "there is no command plan chek; did you mean check? (glasswing plan --help");
  expect_usage_error({"frobnicate"}, "there is no command frobnicate (glasswing --help");
  expect_usage_error({"help", "slove"}, "there is no command slove; did you mean solve?");
  expect_usage_error({"plan"}, "subcommand is required");
  expect_usage_error({"show"}, "session is required");
  expect_usage_error({"solve", "s", "--method", "magic"}, "magic");
  expect_usage_error({"nodes", "--loud"}, "there is no option --loud (glasswing nodes --help");
  expect_usage_error({"solve", "s", "--methd=alpha"},
                     "there is no option --methd=alpha; did you mean --method?");
  expect_usage_error({"nodes", "twice"}, "twice");
  expect_usage_error({"nodes", "--json", "--tsv"}, "--tsv");
  expect_usage_error({"nodes", "--color", "pink"}, "pink");
  expect_usage_error({"calibrate"}, "subcommand is required");
  expect_usage_error({"preview", "--fps", "30"}, "30");
  expect_usage_error({"preview", "--width", "8"}, "8");
}

TEST(Client, OtherFailuresHaveAnotherExitStatus) {
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"solve", "s", "--set", "modes"}, {"doctor", "--plan", "nowhere.txtpb"}})
    EXPECT_EQ(run_glasswing(arguments).status, kFailure);
  expect_one_line_error(run_glasswing({"solve", "s", "--set", "modes"}), "it must be NAME=VALUE");
  expect_one_line_error(run_glasswing({"solve", "s", "--set", "=2"}), "it must be NAME=VALUE");
  expect_one_line_error(run_glasswing({"doctor", "--plan", "nowhere.txtpb"}), "nowhere.txtpb");
}

TEST(Client, ColoursOnlyWhereAskedFor) {
  const std::vector<std::string> failing = {"nodes", "--server", "127.0.0.1:1"};
  const auto with = [&](const char* when) {
    std::vector<std::string> arguments = failing;
    arguments.insert(arguments.end(), {"--color", when});
    return run_glasswing(arguments).err;
  };
  EXPECT_TRUE(with("always").starts_with("\x1b[31mglasswing:\x1b[m server at"));
  EXPECT_TRUE(with("never").starts_with("glasswing: server at"));
  EXPECT_TRUE(with("auto").starts_with("glasswing: server at"));  // no terminal
}

TEST(Client, NamesTheServerThatDoesNotAnswer) {
  // No service listens on port 1.
  const std::string words = "server at 127.0.0.1:1 does not answer";
  expect_one_line_error(run_glasswing({"--server", "127.0.0.1:1", "nodes"}), words);
  expect_one_line_error(run_glasswing({"nodes", "--server", "127.0.0.1:1"}), words);
  ::setenv("GLASSWING_SERVER", "127.0.0.1:1", 1);
  expect_one_line_error(run_glasswing({"sessions"}), words);
  expect_one_line_error(run_glasswing({"doctor"}), words);
  expect_one_line_error(run_glasswing({"preview"}), words);
  expect_one_line_error(run_glasswing({"calibrate", "sync"}), words);
  expect_one_line_error(run_glasswing({"watch", "vase"}), words);
  ::unsetenv("GLASSWING_SERVER");
}

class PlanCommands : public ScratchTest {
 protected:
  std::string write_plan(const std::string& text) const {
    const std::string path = (scratch_ / "vase.txtpb").string();
    std::ofstream(path) << text;
    return path;
  }
};

TEST_F(PlanCommands, CheckNamesFileLineAndValue) {
  const std::string bad = write_plan("method: \"gaussian\"\nsweeps { sigma_px: 0 }\n");
  expect_one_line_error(run_glasswing({"plan", "check", bad}), bad + ":2: sigma_px is 0");
  const std::string good = write_plan("method: \"gaussian\"\nsolids { colour: [1, 1, 1] }\n");
  const Outcome outcome = run_glasswing({"plan", "check", good, "--json"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(json::parse(outcome.out)["solids"], 1);
}

TEST_F(PlanCommands, CheckNamesAPhotoThatIsNotThere) {
  const std::string plan = write_plan("method: \"gaussian\"\nphotos { file: \"sea.png\" }\n");
  expect_one_line_error(run_glasswing({"plan", "check", plan}), (scratch_ / "sea.png").string());
}

TEST_F(PlanCommands, EstimateFollowsFromThePlanAlone) {
  const std::string plan = write_plan(
      "method: \"gaussian\"\nmonitors { name: \"back\" width_px: 40 height_px: 30 }\n"
      "solids { colour: [0, 0, 0] }\nsolids { colour: [1, 1, 1] }\nhold_refreshes: 3\nskip_empty_stage: "
      "true\n");
  const Outcome outcome = run_glasswing({"plan", "estimate", plan, "--json", "--server", "127.0.0.1:1"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json estimate = json::parse(outcome.out);
  EXPECT_EQ(estimate["steps"], 2);
  EXPECT_DOUBLE_EQ(estimate["seconds"].get<double>(), 2 * 3 / 60.0);
  EXPECT_EQ(estimate["bytes"], 2 * (256 + 40 * 30 * 6));
  EXPECT_FALSE(estimate["assumed"].empty());
}

TEST_F(PlanCommands, EstimateWithoutSizesNeedsARig) {
  const std::string plan = write_plan("method: \"gaussian\"\nsolids { colour: [1, 1, 1] }\n");
  expect_one_line_error(run_glasswing({"plan", "estimate", plan, "--server", "127.0.0.1:1"}), "width_px");
}

}  // namespace
}  // namespace glasswing
