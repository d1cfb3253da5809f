#include "server/rig/node_names.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "core/file/file.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

class NodeNamesTest : public testing::Test {
 protected:
  Problems problems_;
  const TemporaryDirectory data_;
};

TEST_F(NodeNamesTest, AreOwnedBeyondARestartUntilTheyAreReleased) {
  NodeNames names = NodeNames::open(data_, problems_).value();
  EXPECT_EQ(names.owner("eye"), "");
  ASSERT_OK(names.give("eye", "rig"));
  ASSERT_OK(names.give("desk", "\"odd\nname\""));
  NodeNames again = NodeNames::open(data_, problems_).value();
  EXPECT_EQ(again.owner("eye"), "rig");
  EXPECT_EQ(again.owner("desk"), "\"odd\nname\"");
  ASSERT_OK(again.release("eye"));
  EXPECT_EQ(again.release("eye").code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(NodeNames::open(data_, problems_)->owner("eye"), "");
}

TEST_F(NodeNamesTest, ADamagedFileIsSetAside) {
  int count = 0;
  for (const char* text : {"{\"eye\": \"rig\"", "[]", "{\"eye\": 5}", ""}) {
    ASSERT_OK(write_file_durably(data_ / "node-names.json", text));
    NodeNames names = NodeNames::open(data_, problems_).value();
    EXPECT_EQ(names.owner("eye"), "") << text;
    EXPECT_EQ(read_file(data_ / "damaged" /
                        (++count == 1 ? "node-names.json" : fmt::format("node-names.json.{}", count)))
                  .value(),
              text);
    EXPECT_EQ(problems_.all().size(), 1);
    EXPECT_OK(names.give("eye", "other"));
  }
}

TEST_F(NodeNamesTest, TheirNumberIsLimited) {
  NodeNames names;
  for (size_t i = 0; i < NodeNames::kMaxNames; ++i) ASSERT_OK(names.give(fmt::format("camera-{}", i), "rig"));
  EXPECT_EQ(names.give("one-more", "rig").code(), absl::StatusCode::kResourceExhausted);
  EXPECT_OK(names.give("camera-7", "rig"));
  EXPECT_OK(names.release("camera-7"));
  EXPECT_OK(names.give("one-more", "rig"));
}

}  // namespace
}  // namespace glasswing
