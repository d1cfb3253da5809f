// SQLite alone: the files of earlier and of later versions.
#include "server/jobs/sqlite_job_store.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/server/jobs/helpers.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class JobsFile : public testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(path_.parent_path());
    fs::create_directories(path_.parent_path());
  }
  void TearDown() override { fs::remove_all(path_.parent_path()); }
  absl::StatusOr<std::unique_ptr<SqliteJobStore>> open() {
    return SqliteJobStore::open(
        path_, {.server_id = "a", .server_address = "a.lab:7000", .lease = std::chrono::hours(1)});
  }
  void run(const std::string& sql) { ASSERT_OK(Database::open(path_)->run(sql)); }

  const fs::path path_ =
      fs::path(testing::TempDir()) / ("sqlite_job_store." + std::to_string(::getpid())) / "jobs.sqlite";
};

TEST_F(JobsFile, TilesOfAnEarlierVersionAreDropped) {
  run("CREATE TABLE tiles (id INTEGER PRIMARY KEY AUTOINCREMENT, session TEXT NOT NULL, number INTEGER NOT "
      "NULL, "
      "first INTEGER NOT NULL, count INTEGER NOT NULL, attempt INTEGER NOT NULL DEFAULT 0, "
      "failures INTEGER NOT NULL DEFAULT 0, lease_until INTEGER NOT NULL DEFAULT 0, "
      "solver TEXT NOT NULL DEFAULT '', result TEXT NOT NULL DEFAULT '', UNIQUE (session, number)); "
      "INSERT INTO tiles (session, number, first, count) VALUES ('s', 0, 0, 4)");
  const auto store = open().value();
  EXPECT_TRUE(store->own_jobs()->empty());
  EXPECT_OK(store->create({.session = "s", .computes = "c", .work = ""}, ranges(2)));
}

TEST_F(JobsFile, AnotherBootEndsLeases) {
  const auto before = open().value();
  const std::int64_t job = before->create({.session = "s", .computes = "c", .work = ""}, ranges(1)).value();
  const std::vector<std::string> computes{"c"};
  const Lease lease = before->claim("a", computes, false)->value();
  run("UPDATE boot SET id = 'another'");
  const auto after = open().value();
  EXPECT_TRUE(after->leases()->empty());
  EXPECT_OK(after->renew(lease.id));  // goes on, as any expired lease
  EXPECT_EQ(after->leases()->size(), 1u);
  run("UPDATE boot SET id = 'a third'");
  EXPECT_EQ(open().value()->claim("b", computes, false)->value().id.job, job);
}

TEST_F(JobsFile, JobsOfTheVersionsBeforeGoOn) {
  const std::string kUndo =
      "ALTER TABLE jobs DROP COLUMN priority; ALTER TABLE jobs DROP COLUMN owner; "
      "ALTER TABLE jobs DROP COLUMN deadline; "
      "ALTER TABLE tiles DROP COLUMN unsolved_pixels; ";
  const std::int64_t job =
      open().value()->create({.session = "s", .computes = "c", .work = ""}, ranges(1)).value();
  run(kUndo + "PRAGMA user_version = 1");
  EXPECT_EQ(SqliteJobStore::open_unclaimed(path_).value()->counts(job)->tiles, 1);
  run(kUndo + "PRAGMA user_version = 1");
  const auto after = open().value();
  const std::vector<std::string> computes{"c"};
  ASSERT_OK(after->complete(after->claim("a", computes, false)->value().id, result("tile")));
  EXPECT_EQ(after->counts(job)->unsolved_pixels, 2);
}

TEST_F(JobsFile, ANewerVersionIsRefused) {
  ASSERT_OK(open());
  run("PRAGMA user_version = 5");
  const absl::Status refused = open().status();
  EXPECT_TRUE(absl::IsFailedPrecondition(refused)) << refused;
  EXPECT_NE(refused.message().find("version 5"), std::string::npos) << refused;
}

TEST(JobsInMemory, AreHandedOutAndCountedAsThoseOfAFile) {
  const JobStoreOptions options{.server_id = "a", .server_address = "", .lease = std::chrono::hours(1)};
  const std::unique_ptr<JobStore> store = open_job_store_in_memory(options).value();
  const std::int64_t job = store->create({.session = "s", .computes = "c", .work = ""}, ranges(2)).value();
  const std::vector<std::string> computes{"c"};
  const Lease first = store->claim("a", computes, false)->value();
  const Lease second = store->claim("b", computes, false)->value();
  EXPECT_FALSE(store->claim("c", computes, false)->has_value());
  ASSERT_OK(store->complete(first.id, result("one")));
  EXPECT_TRUE(absl::IsAborted(store->renew(first.id)));
  EXPECT_TRUE(*store->fail(second.id, "no", true));
  EXPECT_EQ(store->counts(job)->done, 1);
  EXPECT_EQ(store->counts(job)->quarantined, 1);
  EXPECT_EQ(store->tiles(job)->at(0).done.result, "one");
  // Another store in memory is another store.
  EXPECT_TRUE(open_job_store_in_memory(options).value()->own_jobs()->empty());
}

}  // namespace
}  // namespace glasswing
