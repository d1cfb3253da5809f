#include "core/telemetry/logs.h"

#include <grpc/grpc.h>
#include <grpc/support/log.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <random>

namespace glasswing {
namespace {

using Fields = std::vector<std::pair<std::string, std::string>>;

const std::chrono::system_clock::time_point kTime{std::chrono::milliseconds(1234567890123)};

nlohmann::json line_of(const std::string& message) {
  const std::string line = json_line(kTime, "info", "glasswing-test", message);
  EXPECT_EQ(line.find('\n'), std::string::npos);
  return nlohmann::json::parse(line);
}

TEST(Logs, AMessageIsItsWordsAndTheFieldsAtItsEnd) {
  const LogMessage split = split_message("tile failed session=vase tile=3 error=\"no light\"");
  EXPECT_EQ(split.words, "tile failed");
  EXPECT_EQ(split.fields, (Fields{{"session", "vase"}, {"tile", "3"}, {"error", "no light"}}));
}

TEST(Logs, WordsMayHoldWhatLooksLikeAField) {
  const LogMessage split = split_message("the option --set n=3 is unknown session=vase");
  EXPECT_EQ(split.words, "the option --set n=3 is unknown");
  EXPECT_EQ(split.fields, (Fields{{"session", "vase"}}));
  EXPECT_EQ(split_message("n=3 is unknown").words, "n=3 is unknown");
  EXPECT_EQ(split_message("a quote that never ends error=\"no").words, "a quote that never ends error=\"no");
  EXPECT_EQ(split_message("").words, "");
  EXPECT_EQ(split_message("a=1").fields, (Fields{{"a", "1"}}));
  EXPECT_EQ(split_message("a=1").words, "");
  EXPECT_EQ(split_message("gone reason=").fields, (Fields{{"reason", ""}}));
  EXPECT_EQ(split_message("Capital Name=1").words, "Capital Name=1");
}

TEST(Logs, QuotesWithinAValueStayInIt) {
  const LogMessage split = split_message("failed reason=\"session \"vase\" is \"paused\"\" tile=3");
  EXPECT_EQ(split.words, "failed");
  EXPECT_EQ(split.fields, (Fields{{"reason", "session \"vase\" is \"paused\""}, {"tile", "3"}}));
}

TEST(Logs, AJsonLineHasTimeLevelProgramAndMessage) {
  const nlohmann::json line = line_of("tile done session=12 tile=3 seconds=1.50");
  EXPECT_EQ(line["time"], "2009-02-13T23:31:30.123Z");
  EXPECT_EQ(line["level"], "info");
  EXPECT_EQ(line["program"], "glasswing-test");
  EXPECT_EQ(line["message"], "tile done");
  // Strings, although they look like numbers: another session's name may not.
  EXPECT_EQ(line["session"], "12");
  EXPECT_EQ(line["seconds"], "1.50");
}

TEST(Logs, LinesOfGrpcAreLikeOurs) {
  const auto before = spdlog::default_logger();
  testing::internal::CaptureStderr();
  start_logging("glasswing-test", {.level = "info", .format = "json"});
  grpc_init();  // before it no line is let through
  gpr_log(__FILE__, __LINE__, GPR_LOG_SEVERITY_ERROR, "Handshake failed:\n\"%s\"", "no shared cipher");
  grpc_shutdown();
  spdlog::default_logger()->flush();
  spdlog::set_default_logger(before);
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_EQ(std::ranges::count(said, '\n'), 1) << said;
  const nlohmann::json line = nlohmann::json::parse(said);
  EXPECT_EQ(line["program"], "glasswing-test");
  EXPECT_EQ(line["level"], "warning");
  EXPECT_TRUE(line["message"].get<std::string>().starts_with("gRPC: Handshake failed:")) << said;
  EXPECT_TRUE(line["source"].get<std::string>().starts_with("logs_test.cpp:")) << said;
}

TEST(Logs, WordsOfOthersStayWithinTheirLine) {
  const auto before = spdlog::default_logger();
  testing::internal::CaptureStderr();
  start_logging("glasswing-lines", {});
  spdlog::info("held reason=\"lunch\n2009-02-13T23:31:30.123Z info glasswing-server: audit \x1b[2Jx\"");
  const std::string text = testing::internal::GetCapturedStderr();
  spdlog::set_default_logger(before);
  EXPECT_TRUE(text.ends_with(
      R"( info glasswing-lines: held reason="lunch\n2009-02-13T23:31:30.123Z info glasswing-server: audit \x1b[2Jx")"
      "\n"))
      << text;
  EXPECT_EQ(text.find('\n'), text.size() - 1);
  EXPECT_EQ(text.find('\x1b'), std::string::npos);
}

TEST(Logs, AFieldNeverReplacesAnother) {
  const nlohmann::json line = line_of("played program=p1 time=now a=1 a=2");
  EXPECT_EQ(line["program"], "glasswing-test");
  EXPECT_EQ(line["program_"], "p1");
  EXPECT_EQ(line["time_"], "now");
  EXPECT_EQ(line["a"], "1");
  EXPECT_EQ(line["a_"], "2");
}

// Random bytes, with a bias to those that have a meaning.
std::string any_text(std::mt19937& random, size_t most) {
  static const std::string kSpecial = "\"\\\n\r\t =ab_\x1b\x7f\xc3\xa4\xff\xe2\x82";
  std::string text(std::uniform_int_distribution<size_t>(0, most)(random), ' ');
  for (char& c : text) {
    const int byte = std::uniform_int_distribution<int>(0, 511)(random);
    c = byte < 256 ? static_cast<char>(byte) : kSpecial[static_cast<size_t>(byte) % kSpecial.size()];
  }
  return text;
}

TEST(Logs, AnyMessageGivesALineOfJson) {
  std::mt19937 random(1);
  for (int i = 0; i < 20000; ++i) {
    const nlohmann::json line = line_of(any_text(random, 60));
    for (const char* name : {"time", "level", "program", "message"}) EXPECT_TRUE(line.contains(name));
    for (const auto& [name, value] : line.items()) EXPECT_TRUE(value.is_string()) << name;
  }
}

TEST(Logs, QuotedValuesComeBackAsTheyWere) {
  // UTF-8, which JSON can hold; a quote, a space and then a name would end the value.
  const std::vector<std::string> pieces{"\"",     "\\",  "\n",   "\t",  " ",
                                        "=",      "a",   "\x1b", "\\n", "\\\"",
                                        "{}",     "%",   "ä",    "€",   "\xf0\x9f\xa6\x8b",
                                        "' or '", "\"}", ":",    "\\u", "\r",
                                        "\b",     "null"};
  std::mt19937 random(2);
  for (int i = 0; i < 20000; ++i) {
    Fields fields;
    std::string message = "words";
    for (int f = 0; f < 3; ++f) {
      std::string value;
      for (int n = std::uniform_int_distribution<int>(0, 12)(random); n > 0; --n)
        value += pieces[std::uniform_int_distribution<size_t>(0, pieces.size() - 1)(random)];
      if (value.find("\" a") != std::string::npos || value.find("\" null") != std::string::npos)
        value.clear();
      fields.emplace_back("field_" + std::to_string(f), value);
      message += " " + fields.back().first + "=\"" + value + "\"";
    }
    EXPECT_EQ(split_message(message).fields, fields) << message;
    const nlohmann::json line = line_of(message);
    for (const auto& [name, value] : fields) EXPECT_EQ(line[name], value);
  }
}

TEST(Logs, BytesThatAreNoTextAreReplaced) {
  EXPECT_EQ(line_of("name=\"a\xff\xfe\" z=\xc3")["name"], "a\xef\xbf\xbd\xef\xbf\xbd");
}

TEST(Logs, TheNewestWarningsAreKeptAsOneLineEachWhateverTheLevel) {
  const auto before = spdlog::default_logger();
  testing::internal::CaptureStderr();
  start_logging("glasswing-kept", {.level = "error"});
  for (int i = 0; i < 300; ++i) spdlog::warn("tile given up tile={}", i);
  spdlog::info("not kept");
  spdlog::error("two\nlines");
  std::string accents;
  for (int i = 0; i < 1500; ++i) accents += "\xc3\xa9";
  spdlog::critical("x{}", accents);
  EXPECT_EQ(testing::internal::GetCapturedStderr().find("tile"), std::string::npos);
  spdlog::set_default_logger(before);
  const std::vector<LoggedLine> lines = logged_warnings();
  ASSERT_EQ(lines.size(), kMaxLoggedLines);
  for (int i = 0; i < 198; ++i) EXPECT_EQ(lines[i].text, "tile given up tile=" + std::to_string(102 + i));
  EXPECT_EQ(lines[0].level, "warning");
  EXPECT_EQ(lines[198].level, "error");
  EXPECT_EQ(lines[198].text, "two\\nlines");
  EXPECT_EQ(lines[199].level, "critical");
  EXPECT_EQ(lines[199].text, "x" + accents.substr(0, 1998)) << "cut between two characters";
  EXPECT_TRUE(lines[199].time.starts_with("20") && lines[199].time.ends_with("Z")) << lines[199].time;
}

TEST(Logs, DaemonsWriteThemToStandardError) {
  testing::internal::CaptureStderr();
  start_logging("glasswing-json", {.level = "warn", .format = "json"});
  spdlog::info("not asked for");
  spdlog::warn("tile given up session={} error=\"{}\"", "vase", "two\nlines");
  start_logging("glasswing-text", LogOptions());
  spdlog::info("as before session={}", "vase");
  spdlog::default_logger()->flush();
  const std::string written = testing::internal::GetCapturedStderr();
  const size_t end = written.find('\n');
  const nlohmann::json line = nlohmann::json::parse(written.substr(0, end));
  EXPECT_EQ(line["level"], "warning");
  EXPECT_EQ(line["program"], "glasswing-json");
  EXPECT_EQ(line["message"], "tile given up");
  EXPECT_EQ(line["error"], "two\nlines");
  EXPECT_NE(written.find("Z info glasswing-text: as before session=vase\n", end), std::string::npos)
      << written;
}

}  // namespace
}  // namespace glasswing
