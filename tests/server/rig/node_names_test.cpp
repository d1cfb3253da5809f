#include "server/rig/node_names.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "core/base/file.h"

namespace glasswing {
namespace {

class NodeNamesTest : public testing::Test {
 protected:
  NodeNamesTest() { std::filesystem::create_directories(data_); }
  ~NodeNamesTest() override { std::filesystem::remove_all(data_); }

  Problems problems_;
  const std::filesystem::path data_ =
      std::filesystem::temp_directory_path() / ("glasswing-names-" + std::to_string(::getpid()));
};

TEST_F(NodeNamesTest, AreOwnedBeyondARestartUntilTheyAreReleased) {
  NodeNames names = NodeNames::open(data_, problems_).value();
  EXPECT_EQ(names.owner("eye"), "");
  ASSERT_TRUE(names.give("eye", "rig").ok());
  ASSERT_TRUE(names.give("desk", "\"odd\nname\"").ok());
  NodeNames again = NodeNames::open(data_, problems_).value();
  EXPECT_EQ(again.owner("eye"), "rig");
  EXPECT_EQ(again.owner("desk"), "\"odd\nname\"");
  ASSERT_TRUE(again.release("eye").ok());
  EXPECT_EQ(again.release("eye").code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(NodeNames::open(data_, problems_)->owner("eye"), "");
}

TEST_F(NodeNamesTest, ADamagedFileIsSetAside) {
  int count = 0;
  for (const char* text : {"{\"eye\": \"rig\"", "[]", "{\"eye\": 5}", ""}) {
    ASSERT_TRUE(write_file_durably(data_ / "node-names.json", text).ok());
    NodeNames names = NodeNames::open(data_, problems_).value();
    EXPECT_EQ(names.owner("eye"), "") << text;
    EXPECT_EQ(read_file(data_ / "damaged" /
                        (++count == 1 ? "node-names.json" : fmt::format("node-names.json.{}", count)))
                  .value(),
              text);
    EXPECT_EQ(problems_.all().size(), 1);
    EXPECT_TRUE(names.give("eye", "other").ok());
  }
}

TEST_F(NodeNamesTest, TheirNumberIsLimited) {
  NodeNames names;
  for (size_t i = 0; i < NodeNames::kMaxNames; ++i)
    ASSERT_TRUE(names.give(fmt::format("camera-{}", i), "rig").ok());
  EXPECT_EQ(names.give("one-more", "rig").code(), absl::StatusCode::kResourceExhausted);
  EXPECT_TRUE(names.give("camera-7", "rig").ok());
  EXPECT_TRUE(names.release("camera-7").ok());
  EXPECT_TRUE(names.give("one-more", "rig").ok());
}

}  // namespace
}  // namespace glasswing
