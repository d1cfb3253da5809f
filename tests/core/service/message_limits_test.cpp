#include "core/service/message_limits.h"

#include <gtest/gtest.h>

#include "core/base/utf8.h"
#include "glasswing/v1/node_service.pb.h"
#include "glasswing/v1/session_service.pb.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

TEST(MessageLimits, AreThoseOfTheFieldsOptionsOrTheUsualOnes) {
  v1::RegisterRequest node;
  node.set_name(std::string(64, 'n'));
  node.set_detail(std::string(kMaxStringBytes, 'd'));
  EXPECT_OK(check_limits(node));
  node.mutable_name()->push_back('n');
  EXPECT_EQ(check_limits(node), absl::InvalidArgumentError("name has 65 bytes; it must have at most 64"));
  node.clear_name();
  node.mutable_detail()->push_back('d');
  EXPECT_EQ(check_limits(node),
            absl::InvalidArgumentError("detail has 1025 bytes; it must have at most 1024"));

  v1::AnnotateSessionRequest notes;
  notes.set_note(std::string(4096, 'x'));
  for (int i = 0; i < 100; ++i) notes.add_add_tags(std::string("tag"));
  EXPECT_OK(check_limits(notes));
  notes.add_add_tags(std::string("tag"));
  EXPECT_EQ(check_limits(notes),
            absl::InvalidArgumentError("add_tags has 101 items; it must have at most 100"));
}

TEST(MessageLimits, HoldAtAnyDepthAndNameThePlace) {
  v1::CreateSessionRequest session;
  session.mutable_plan()->add_monitors()->set_name("a");
  session.mutable_plan()->add_monitors()->set_name(std::string(2000, 'b'));
  EXPECT_EQ(check_limits(session),
            absl::InvalidArgumentError("plan.monitors[1].name has 2000 bytes; it must have at most 1024"));
  session.mutable_plan()->mutable_monitors()->RemoveLast();
  for (int i = 0; i < 1001; ++i) session.mutable_plan()->add_exposure_ms(1.0);
  EXPECT_EQ(check_limits(session),
            absl::InvalidArgumentError("plan.exposure_ms has 1001 items; it must have at most 1000"));

  v1::SolveSessionRequest solve;
  (*solve.mutable_options())["key"] = std::string(2000, 'v');
  EXPECT_EQ(check_limits(solve).message(), "options[0].value has 2000 bytes; it must have at most 1024");
  for (int i = 0; i < 101; ++i) (*solve.mutable_options())[std::to_string(i)] = "";
  EXPECT_EQ(check_limits(solve).message(), "options has 102 items; it must have at most 100");

  v1::ListSessionsRequest list;
  list.add_tags(std::string("tag"));
  list.add_tags(std::string(2000, 't'));
  EXPECT_EQ(check_limits(list).message(), "tags[1] has 2000 bytes; it must have at most 1024");
}

TEST(MessageLimits, ChunksAreNotLimited) {
  v1::UploadImageRequest image;
  image.set_chunk(std::string(1 << 20, 'x'));
  EXPECT_OK(check_limits(image));
}

TEST(MessageLimits, SendersCutTextBetweenCharacters) {
  EXPECT_EQ(fitted("short"), "short");
  EXPECT_EQ(fitted(std::string(2000, 'x')).size(), 1024u);
  const std::string word = "\xc3\xa4\xe2\x82\xac\xf0\x9f\x99\x82";  // characters of 2, 3 and 4 bytes
  for (int size = 0; size <= 9; ++size) {
    const std::string cut = fitted(word, size);
    EXPECT_TRUE(is_utf8(cut)) << size;
    EXPECT_TRUE(word.starts_with(cut));
    EXPECT_EQ(cut.size(), size < 2 ? 0u : size < 5 ? 2u : size < 9 ? 5u : 9u);
  }
}

}  // namespace
}  // namespace glasswing
