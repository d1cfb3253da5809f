// What the server does without: each damage is made by hand, and the server starts all the same.
#include <gtest/gtest.h>

#include "core/file/file.h"
#include "server/services/server.h"
#include "server/storage/database.h"
#include "tests/core/file/flipped.h"
#include "tests/server/jobs/helpers.h"
#include "tests/server/jobs/postgres_fixture.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class DegradedStart : public testing::Test {
 protected:
  // A session that is being solved, in a job of the server's store. Returns the job.
  std::int64_t begin_solve(const std::string& jobs = {}) {
    const std::string id = "0123456789abcdef0123456789abcdef";
    EXPECT_OK(write_file_durably(data_ / "server-id", id));
    const auto store =
        open_job_store(jobs, data_, {.server_id = id, .server_address = ""}, problems_).value();
    v1::Session session;
    session.set_name("s");
    session.set_method("alpha");
    session.set_state(v1::SESSION_STATE_SOLVING);
    session.set_job(store->create({.session = "s", .computes = "alpha/1", .work = ""}, ranges(2)).value());
    EXPECT_OK(Catalogue::open(data_ / "catalogue.sqlite").value()->insert(session, ""));
    return session.job();
  }
  void damage_record() {
    Database catalogue = Database::open(data_ / "catalogue.sqlite").value();
    ASSERT_OK(catalogue.run("DROP TRIGGER sessions_updated; UPDATE sessions SET session = x'ff'"));
  }
  void expect_said(Server& server, const fs::path& file) {
    const std::vector<std::string> said = server.problems().all();
    EXPECT_TRUE(std::ranges::any_of(said, [&](const std::string& text) {
      return text.find(file.string()) != std::string::npos;
    })) << file;
    EXPECT_TRUE(fs::exists(data_ / "damaged" / file.filename()));
  }

  const TemporaryDirectory data_;
  Problems problems_;
};

TEST_F(DegradedStart, WhatIsWholeIsNoProblem) {
  begin_solve();
  EXPECT_TRUE(Server::open({.data = data_}).value()->problems().all().empty());
}

TEST_F(DegradedStart, SolvesOfADamagedJobStoreCanBeRequestedAgain) {
  begin_solve();
  for (const char* log : {"-wal", "-shm"}) fs::remove(data_ / (std::string("jobs.sqlite") + log));
  ASSERT_OK(write_file_durably(data_ / "jobs.sqlite", std::string(8192, 'x')));
  {
    const std::unique_ptr<Server> server = Server::open({.data = data_}).value();
    expect_said(*server, data_ / "jobs.sqlite");
    const v1::Session session = server->sessions().find("s").value();
    EXPECT_EQ(session.state(), v1::SESSION_STATE_CAPTURED);
    EXPECT_NE(session.reason().find("glasswing solve s"), std::string::npos) << session.reason();
  }
  EXPECT_EQ(read_file(data_ / "damaged/jobs.sqlite").value(), std::string(8192, 'x'));
  // From then on the server tells what lies there.
  const std::vector<std::string> said = Server::open({.data = data_}).value()->problems().all();
  ASSERT_EQ(said.size(), 1u);
  EXPECT_NE(said[0].find((data_ / "damaged").string()), std::string::npos) << said[0];
}

TEST_F(DegradedStart, NoAlteredByteOfTheJobStoreKeepsTheServerDown) {
  begin_solve();
  const std::string bytes = read_file(data_ / "jobs.sqlite").value();
  int set_aside = 0;
  const auto start = [&](const std::string& altered, size_t at) {
    fs::remove_all(data_ / "damaged");
    for (const char* log : {"-wal", "-shm"}) fs::remove(data_ / (std::string("jobs.sqlite") + log));
    ASSERT_OK(write_file_durably(data_ / "jobs.sqlite", altered));
    const absl::StatusOr<std::unique_ptr<Server>> server = Server::open({.data = data_});
    const bool is_version = at >= 60 && at < 64;  // a file of a newer server is refused
    EXPECT_TRUE(server.ok() || (is_version && absl::IsFailedPrecondition(server.status())))
        << "byte " << at << ": " << server.status();
    set_aside += fs::exists(data_ / "damaged/jobs.sqlite");
  };
  for_each_flip(bytes.substr(0, 100), 0, 2,
                [&](const std::string& header, size_t at) { start(header + bytes.substr(100), at); });
  for_each_flip(bytes, 100, 1009, start);
  EXPECT_GT(set_aside, 10);
}

TEST_F(DegradedStart, ADamagedRecordIsListedAndItsJobKept) {
  const std::int64_t job = begin_solve();
  damage_record();
  const std::unique_ptr<Server> server = Server::open({.data = data_}).value();
  const std::vector<v1::Session> listed = server->list({}).value();
  ASSERT_EQ(listed.size(), 1u);
  EXPECT_EQ(listed[0].name(), "s");
  EXPECT_EQ(listed[0].state(), v1::SESSION_STATE_DAMAGED);
  EXPECT_TRUE(listed[0].allowed_actions().empty());
  EXPECT_TRUE(absl::IsDataLoss(server->sessions().find("s").status()));
  EXPECT_EQ(server->fleet()->solves_size(), 1);
  EXPECT_GT(job, 0);
}

TEST_F(DegradedStart, ADamagedServerIdIsReplaced) {
  begin_solve();
  ASSERT_OK(write_file_durably(data_ / "server-id", "0123"));
  const std::unique_ptr<Server> server = Server::open({.data = data_}).value();
  expect_said(*server, data_ / "server-id");
  EXPECT_EQ(read_file(data_ / "server-id")->size(), 32u);
}

TEST_F(DegradedStart, WhileTheSharedJobStoreIsAwaySolvesWaitAndSayWhy) {
  const PostgresFixture* postgres = PostgresFixture::shared();
  if (postgres == nullptr) GTEST_SKIP() << PostgresFixture::kMissing;
  postgres->clear();
  begin_solve(postgres->connection());
  postgres->stop();
  const std::unique_ptr<Server> server =
      Server::open({.data = data_, .jobs = postgres->connection(), .address = "a.lab:7000"}).value();
  const v1::Session waiting = server->sessions().find("s").value();
  EXPECT_EQ(waiting.state(), v1::SESSION_STATE_SOLVING);
  EXPECT_NE(waiting.reason().find("PostgreSQL at 127.0.0.1"), std::string::npos) << waiting.reason();
  ASSERT_EQ(server->problems().all().size(), 1u);
  EXPECT_TRUE(absl::IsUnavailable(server->fleet().status()));
  v1::Session other;
  other.set_name("other");
  EXPECT_OK(server->sessions().edit().insert(other, ""));  // what needs no jobs works
  postgres->start();
  EXPECT_TRUE(comes_true([&] { return server->sessions().find("s")->reason().empty(); }));
  EXPECT_TRUE(server->problems().all().empty());
  EXPECT_EQ(server->fleet()->solves_size(), 1);
}

}  // namespace
}  // namespace glasswing
