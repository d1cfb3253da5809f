#include "core/cli/config.h"

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/client/run_glasswing.h"

namespace glasswing {
namespace {

using nlohmann::json;

// A home directory with a configuration file.
class Configuration : public ScratchTest {
 protected:
  Configuration() {
    std::filesystem::create_directories(file_.parent_path());
    ::setenv("XDG_CONFIG_HOME", scratch_.c_str(), 1);
  }
  ~Configuration() override {
    for (const char* name : {"XDG_CONFIG_HOME", "GLASSWING_CONFIG", "GLASSWING_SERVER"}) ::unsetenv(name);
  }
  void write(const std::string& text) const { std::ofstream(file_) << text; }
  json settings(std::vector<std::string> arguments = {}) const {
    arguments.insert(arguments.end(), {"config", "--json"});
    const Outcome outcome = run_glasswing(arguments);
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return json::parse(outcome.out)["settings"];
  }
  static json setting(const std::string& value, const std::string& from) {
    return {{"value", value}, {"from", from}};
  }

  const std::filesystem::path file_ = scratch_ / "glasswing" / "config.toml";
};

TEST_F(Configuration, OptionBeforeEnvironmentBeforeFileBeforeDefault) {
  EXPECT_EQ(settings()["server"], setting("127.0.0.1:7440", "default"));
  write("server = \"127.0.0.1:1\"\n");
  EXPECT_EQ(settings()["server"], setting("127.0.0.1:1", file_.string()));
  ::setenv("GLASSWING_SERVER", "127.0.0.1:2", 1);
  EXPECT_EQ(settings()["server"], setting("127.0.0.1:2", "GLASSWING_SERVER"));
  EXPECT_EQ(settings({"--server", "127.0.0.1:3"})["server"], setting("127.0.0.1:3", "option"));
  // The setting in force is the server that is called.
  expect_one_line_error(run_glasswing({"nodes"}), "server at 127.0.0.1:2 does not answer");
}

TEST_F(Configuration, AnotherFileIsReadInsteadAndMustBeThere) {
  write("server = '127.0.0.1:1'\n");
  const std::string other = (scratch_ / "other.toml").string();
  expect_one_line_error(run_glasswing({"config", "--config", other}), other);
  ::setenv("GLASSWING_CONFIG", other.c_str(), 1);
  expect_one_line_error(run_glasswing({"config"}), other);
  std::ofstream(other) << "server = '127.0.0.1:4'\n";
  EXPECT_EQ(settings()["server"], setting("127.0.0.1:4", other));
  EXPECT_EQ(settings({"--config", file_.string()})["server"], setting("127.0.0.1:1", file_.string()));
}

TEST_F(Configuration, ValuesAreWhatStandsBetweenTheQuotes) {
  write(
      "# the rig\n\n"
      "  server = \"127.0.0.1:1\"   # not \"127.0.0.1:2\"\n"
      "color='never'\n");
  EXPECT_EQ(settings()["server"]["value"], "127.0.0.1:1");
  EXPECT_EQ(settings()["color"]["value"], "never");
  // Paths are relative to the configuration file, which may have any name.
  write("ca = 'a, b #1.pem'\n");
  const std::filesystem::path ca = file_.parent_path() / "a, b #1.pem";
  expect_one_line_error(run_glasswing({"nodes"}), ca.string());
  write("ca = \"/\\\"quoted\\\" \\\\.pem\"\n");
  expect_one_line_error(run_glasswing({"nodes"}), "/\"quoted\" \\.pem");
}

TEST_F(Configuration, NamesTheLineThatIsWrong) {
  const std::pair<const char*, const char*> kCases[] = {
      {"\nsever = \"a:1\"\n", ":2: there is no key sever; the keys are server, ca, certificate, key, color"},
      {"server = a:1\n", ":1: it is server = a:1; it must be KEY = \"VALUE\""},
      {"server\n", ":1: it is server; it must be"},
      {"server = \"a:1\n", "it must be KEY"},
      {"server = [\"a:1\"]\n", "it must be KEY"},
      {"[capture]\n", ":1: it is [capture]; it must be"},
      {"server = \"a\\tb\"\n", "it must be KEY"},
      {"key = \"a\"\nkey = \"b\"\n", ":2: key is repeated"},
      {"color = \"pink\"\n", "color is pink; it must be auto, always or never"}};
  for (const auto& [text, words] : kCases) {
    write(text);
    const Outcome outcome = run_glasswing({"nodes"});
    expect_one_line_error(outcome, words);
    expect_one_line_error(outcome, file_.string());
    EXPECT_EQ(outcome.status, kUsageError);
  }
}

TEST_F(Configuration, LinesMayBeAsLongAsTheyLike) {
  const std::string name(1 << 20, 'x');
  write("server = \"" + name + ":1\"\n#" + name + "\n" + std::string(1 << 20, ' ') + "\n");
  EXPECT_EQ(settings()["server"]["value"], name + ":1");
}

TEST_F(Configuration, WrongCertificatesStopCallsButNoWorkOnThisMachine) {
  write("ca = \"nowhere.pem\"\n");
  const std::string words = "the CA cannot be read: ";
  expect_one_line_error(run_glasswing({"nodes"}), words);
  EXPECT_EQ(run_glasswing({"completion", "bash"}).status, 0);
  const Outcome shown = run_glasswing({"config"});
  EXPECT_EQ(shown.status, kFailure);
  EXPECT_NE(shown.out.find("nowhere.pem"), std::string::npos);
  EXPECT_NE(shown.err.find(words), std::string::npos);
}

TEST_F(Configuration, AServerElsewhereNeedsTls) {
  expect_one_line_error(run_glasswing({"nodes", "--server", "127.0.0.1:7440x"}),
                        "--server: the address is \"127.0.0.1:7440x\"; it must be HOST:PORT");
  expect_one_line_error(run_glasswing({"nodes", "--server", "192.0.2.1:7440"}),
                        "server at 192.0.2.1:7440 is beyond this machine, where calls need TLS; set --ca");
}

}  // namespace
}  // namespace glasswing
