#include "server/catalogue.h"

#include <gtest/gtest.h>
#include <unistd.h>

namespace glasswing {
namespace {

namespace fs = std::filesystem;

TEST(Catalogue, SessionsOutliveTheProcess) {
  const fs::path path =
      fs::path(testing::TempDir()) / ("catalogue_test." + std::to_string(::getpid()) + ".sqlite");
  v1::Session session;
  session.set_name("a");
  session.mutable_plan()->set_method("gaussian");
  {
    const auto catalogue = Catalogue::open(path).value();
    ASSERT_TRUE(catalogue->insert(session, "request-1").ok());
    const absl::Status again = catalogue->insert(session, "request-2");
    EXPECT_TRUE(absl::IsAlreadyExists(again)) << again;
    session.set_state(v1::SESSION_STATE_CAPTURING);
    ASSERT_TRUE(catalogue->update(session).ok());
    v1::Session second;
    second.set_name("b");
    ASSERT_TRUE(catalogue->insert(second, "").ok());
  }
  const auto catalogue = Catalogue::open(path).value();
  EXPECT_EQ(catalogue->find("a").value().SerializeAsString(), session.SerializeAsString());
  EXPECT_EQ(catalogue->find_request("request-1").value().name(), "a");
  EXPECT_TRUE(absl::IsNotFound(catalogue->find_request("").status()));  // no id is nobody's
  EXPECT_TRUE(absl::IsNotFound(catalogue->find("c").status()));
  EXPECT_EQ(catalogue->list().value().front().name(), "b");  // newest first
  for (const char* suffix : {"", "-wal", "-shm"}) fs::remove(path.string() + suffix);
}

TEST(Catalogue, ADamagedFileIsNamedNotUsed) {
  const fs::path path =
      fs::path(testing::TempDir()) / ("catalogue_bad." + std::to_string(::getpid()) + ".sqlite");
  std::FILE* file = std::fopen(path.c_str(), "w");
  std::fputs(
      "this is no database, and long enough to be one with a header of a hundred bytes, which it has not",
      file);
  std::fclose(file);
  EXPECT_FALSE(Catalogue::open(path).ok());
  fs::remove(path);
}

}  // namespace
}  // namespace glasswing
