#include "tests/server/jobs/contract.h"

#include <unistd.h>

#include "tests/server/jobs/postgres_fixture.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class SqliteBackend : public JobBackend {
 public:
  SqliteBackend() {
    static int count = 0;
    directory_ = fs::path(testing::TempDir()) / name(++count);
    fs::remove_all(directory_);
    fs::create_directories(directory_);
  }
  ~SqliteBackend() override { fs::remove_all(directory_); }
  std::unique_ptr<JobStore> open(const JobStoreOptions& options) override {
    return open_job_store("", directory_, options, problems_).value();
  }

 private:
  static std::string name(int count) {
    return "jobs." + std::to_string(::getpid()) + "." + std::to_string(count);
  }
  fs::path directory_;
};

class PostgresBackend : public JobBackend {
 public:
  explicit PostgresBackend(const PostgresFixture& postgres) : postgres_(postgres) { postgres.clear(); }
  std::unique_ptr<JobStore> open(const JobStoreOptions& options) override {
    return open_job_store(postgres_.connection(), "", options, problems_).value();
  }

 private:
  const PostgresFixture& postgres_;
};

}  // namespace

void JobContract::SetUp() {
  if (GetParam() == "SQLite") {
    backend_ = std::make_unique<SqliteBackend>();
  } else if (const PostgresFixture* postgres = PostgresFixture::shared()) {
    backend_ = std::make_unique<PostgresBackend>(*postgres);
  } else {
    GTEST_SKIP() << PostgresFixture::kMissing;
  }
  open(options());
}

JobStoreOptions JobContract::options(std::chrono::milliseconds lease,
                                     std::chrono::milliseconds least_before_twice) {
  return {.server_id = "server-a",
          .server_address = "a.lab:7000",
          .lease = lease,
          .least_before_twice = least_before_twice};
}

void JobContract::open(const JobStoreOptions& options) {
  store_ = nullptr;
  store_ = backend_->open(options);
}

std::int64_t JobContract::create(int tiles, const std::string& session) {
  return store_->create({.session = session, .computes = "gaussian/1", .work = "work"}, ranges(tiles))
      .value();
}

std::optional<Lease> JobContract::claim(const std::string& solver, bool ahead) {
  const std::vector<std::string> computes{"ramp/2", "gaussian/1"};
  return store_->claim(solver, computes, ahead).value();
}

Lease JobContract::claimed(const std::string& solver) {
  return claim(solver).value();
}

Lease JobContract::claim_at_last(const std::string& solver) {
  std::optional<Lease> lease;
  if (!comes_true([&] { return (lease = claim(solver)).has_value(); })) ADD_FAILURE() << "nothing to claim";
  return lease.value();
}

INSTANTIATE_TEST_SUITE_P(Stores, JobContract, testing::Values("SQLite", "PostgreSQL"),
                         [](const auto& parameter) { return parameter.param; });

}  // namespace glasswing
