#include "server/jobs/postgres_job_store.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "core/base/status.h"
#include "server/jobs/sql_text.h"

namespace glasswing {
namespace {

constexpr int kMaxConnections = 8;
constexpr int kTries = 5;
constexpr std::int64_t kPostgresSchemaVersion = 4;
// An arbitrary number, the same for all servers: if several start at once, one creates the tables.
constexpr std::int64_t kSchemaLock = 0x676c617373;

absl::Status in_transaction(PostgresConnection& connection,
                            absl::FunctionRef<absl::Status(SqlConnection&)> change) {
  GW_RETURN_IF_ERROR(connection.run("BEGIN", {}).status());
  const absl::Status status = change(connection);
  if (status.ok()) return connection.run("COMMIT", {}).status();
  connection.roll_back();
  return status;
}

// Fillfactor leaves room for updating rows in place.
std::string postgres_schema() {
  return fmt::format(
      "CREATE TABLE version (number bigint NOT NULL); INSERT INTO version VALUES ({}); "
      "CREATE TABLE servers (id text PRIMARY KEY, address text NOT NULL); "
      "CREATE TABLE jobs (id bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY, "
      "server text NOT NULL REFERENCES servers, session text NOT NULL, computes text NOT NULL, "
      "work bytea NOT NULL, held int NOT NULL DEFAULT 0, created bigint NOT NULL, "
      "survey_tile int NOT NULL DEFAULT 0, survey_attempt int NOT NULL DEFAULT 0, "
      "priority int NOT NULL DEFAULT 0, owner text NOT NULL DEFAULT '', deadline bigint NOT NULL DEFAULT 0); "
      "CREATE TABLE tiles (job bigint NOT NULL REFERENCES jobs ON DELETE CASCADE, number int NOT NULL, "
      "first int NOT NULL, count int NOT NULL, attempts int NOT NULL, "
      "failures int NOT NULL DEFAULT 0, lost int NOT NULL DEFAULT 0, quarantined int NOT NULL DEFAULT 0, "
      "error bytea NOT NULL DEFAULT '', "
      "lease_attempt int NOT NULL DEFAULT 0, lease_solver text NOT NULL DEFAULT '', "
      "lease_since bigint NOT NULL DEFAULT 0, lease_until bigint NOT NULL DEFAULT 0, "
      "twin_attempt int NOT NULL DEFAULT 0, twin_solver text NOT NULL DEFAULT '', "
      "twin_since bigint NOT NULL DEFAULT 0, twin_until bigint NOT NULL DEFAULT 0, "
      "done_attempt int NOT NULL DEFAULT 0, done_at bigint NOT NULL DEFAULT 0, "
      "result bytea NOT NULL DEFAULT '', object_pixels bigint NOT NULL DEFAULT 0, "
      "flagged_pixels bigint NOT NULL DEFAULT 0, seconds double precision NOT NULL DEFAULT 0, "
      "unsolved_pixels bigint NOT NULL DEFAULT 0, "
      "PRIMARY KEY (job, number)) WITH (fillfactor = 70); "
      "CREATE INDEX tiles_open ON tiles (job, failures, number) WHERE {}; "
      "CREATE INDEX tiles_done ON tiles (job, done_at) WHERE {}; "
      "CREATE INDEX tiles_leased ON tiles (job, lease_since) WHERE {}",
      kPostgresSchemaVersion, kOpen, kDone, kLeased);
}

}  // namespace

absl::StatusOr<std::unique_ptr<PostgresJobStore>> PostgresJobStore::open(const std::string& connection,
                                                                         JobStoreOptions options) {
  GW_ASSIGN_OR_RETURN(PostgresAddress address, PostgresAddress::parse(connection));
  std::unique_ptr<PostgresJobStore> store(new PostgresJobStore(std::move(address), std::move(options)));
  if (const absl::Status ready = store->try_to_prepare(); !ready.ok() && !absl::IsUnavailable(ready))
    return ready;
  store->listener_ = std::jthread([&store = *store](std::stop_token stop) { store.listen(stop); });
  return store;
}

absl::Status PostgresJobStore::try_to_prepare() {
  const auto connection = PostgresConnection::open(address_);
  const absl::Status ready = connection.ok() ? prepare(**connection) : connection.status();
  const std::lock_guard lock(mutex_);
  ready_ = ready;
  return ready;
}

absl::Status PostgresJobStore::prepare(PostgresConnection& to) {
  return in_transaction(to, [&](SqlConnection& connection) -> absl::Status {
    GW_RETURN_IF_ERROR(connection.run("SELECT pg_advisory_xact_lock(?1)", {kSchemaLock}).status());
    GW_ASSIGN_OR_RETURN(const SqlRows made,
                        connection.run("SELECT 1 FROM pg_namespace WHERE nspname = 'glasswing'", {}));
    if (made.empty()) {
      GW_RETURN_IF_ERROR(connection.run("CREATE SCHEMA glasswing", {}).status());
      GW_RETURN_IF_ERROR(connection.run(postgres_schema(), {}).status());
    }
    GW_ASSIGN_OR_RETURN(
        const SqlRows earlier,
        connection.run("UPDATE version SET number = 2 WHERE number = 1 RETURNING number", {}));
    if (!earlier.empty()) {
      GW_RETURN_IF_ERROR(
          connection.run("ALTER TABLE tiles ADD COLUMN unsolved_pixels bigint NOT NULL DEFAULT 0", {})
              .status());
    }
    GW_ASSIGN_OR_RETURN(
        const SqlRows second,
        connection.run("UPDATE version SET number = 3 WHERE number = 2 RETURNING number", {}));
    if (!second.empty()) {
      GW_RETURN_IF_ERROR(connection
                             .run("ALTER TABLE jobs ADD COLUMN priority int NOT NULL DEFAULT 0, "
                                  "ADD COLUMN owner text NOT NULL DEFAULT ''",
                                  {})
                             .status());
      GW_RETURN_IF_ERROR(connection.run("DROP INDEX tiles_leased", {}).status());
      GW_RETURN_IF_ERROR(
          connection
              .run(fmt::format("CREATE INDEX tiles_leased ON tiles (job, lease_since) WHERE {}", kLeased), {})
              .status());
    }
    GW_ASSIGN_OR_RETURN(
        const SqlRows third,
        connection.run("UPDATE version SET number = 4 WHERE number = 3 RETURNING number", {}));
    if (!third.empty()) {
      GW_RETURN_IF_ERROR(
          connection.run("ALTER TABLE jobs ADD COLUMN deadline bigint NOT NULL DEFAULT 0", {}).status());
    }
    GW_ASSIGN_OR_RETURN(const SqlRows version, connection.run("SELECT max(number) FROM version", {}));
    if (version.integer(0, 0) != kPostgresSchemaVersion) {
      return absl::FailedPreconditionError(
          fmt::format("{} has tables of version {}; this server knows version {}: update it, or give it its "
                      "own database",
                      title(), version.integer(0, 0), kPostgresSchemaVersion));
    }
    GW_RETURN_IF_ERROR(connection
                           .run("INSERT INTO servers VALUES (?1, ?2) "
                                "ON CONFLICT (id) DO UPDATE SET address = excluded.address",
                                {options_.server_id, options_.server_address})
                           .status());
    return connection.run("UPDATE jobs SET held = 0 WHERE server = ?1 AND held <> 0", {options_.server_id})
        .status();
  });
}

absl::Status PostgresJobStore::ready() {
  const std::lock_guard lock(mutex_);
  return ready_;
}

absl::StatusOr<std::unique_ptr<PostgresConnection>> PostgresJobStore::borrow() {
  std::unique_lock lock(mutex_);
  given_back_.wait(lock, [&] { return borrowed_ < kMaxConnections; });
  ++borrowed_;
  while (!idle_.empty()) {
    std::unique_ptr<PostgresConnection> connection = std::move(idle_.back());
    idle_.pop_back();
    if (!connection->is_lost()) return connection;
  }
  lock.unlock();
  return PostgresConnection::open(address_);
}

void PostgresJobStore::give_back(std::unique_ptr<PostgresConnection> connection) {
  const std::lock_guard lock(mutex_);
  --borrowed_;
  if (connection != nullptr) idle_.push_back(std::move(connection));
  given_back_.notify_one();
}

absl::Status PostgresJobStore::with_connection(absl::FunctionRef<absl::Status(PostgresConnection&)> use) {
  GW_RETURN_IF_ERROR(ready());
  absl::StatusOr<std::unique_ptr<PostgresConnection>> connection = borrow();
  if (!connection.ok()) {
    give_back(nullptr);
    return connection.status();
  }
  absl::Status status;
  for (int i = 0; i < kTries; ++i) {
    status = use(**connection);
    if (status.ok() || !(*connection)->had_conflict()) break;
  }
  give_back((*connection)->is_lost() ? nullptr : *std::move(connection));
  return status;
}

absl::Status PostgresJobStore::transaction(Change change) {
  return with_connection([&](PostgresConnection& connection) { return in_transaction(connection, change); });
}

absl::Status PostgresJobStore::statements(Change change) {
  return with_connection([&](PostgresConnection& connection) { return change(connection); });
}

std::string PostgresJobStore::next_tile(const std::string& open, const std::string& free, bool rivals) const {
  return fmt::format(
      "{}SELECT f.job, f.number FROM (SELECT j.id FROM {} WHERE {} ORDER BY {}) j CROSS JOIN LATERAL "
      "(SELECT t.job, t.number FROM tiles t WHERE t.job = j.id AND {} ORDER BY t.failures, t.number "
      "LIMIT 1 :locking) f LIMIT 1",
      rivals ? served() : "", rivals ? kJobsServed : "jobs j", open, rivals ? job_order(options_) : "j.id",
      free);
}

absl::StatusOr<SqlRows> PostgresJobStore::read(const std::string& sql, const SqlValues& values) {
  SqlRows rows;
  const absl::Status status = with_connection([&](PostgresConnection& connection) -> absl::Status {
    GW_ASSIGN_OR_RETURN(rows, connection.run(sql, values));
    return absl::OkStatus();
  });
  GW_RETURN_IF_ERROR(status);
  return rows;
}

void PostgresJobStore::tell_others() {
  (void)with_connection(
      [](PostgresConnection& connection) { return connection.run("NOTIFY glasswing_tiles", {}).status(); });
}

void PostgresJobStore::listen(std::stop_token stop) {
  const int stopped = ::eventfd(0, EFD_CLOEXEC);
  const std::stop_callback wake(stop, [&] { (void)!::eventfd_write(stopped, 1); });
  while (!stop.stop_requested()) {
    const bool is_ready = ready().ok() || try_to_prepare().ok();
    const auto connection = PostgresConnection::open(address_);
    bool listens = is_ready && connection.ok() && (*connection)->run("LISTEN glasswing_tiles", {}).ok();
    // Hints may have been lost in between.
    if (listens) hinted();
    while (listens && !stop.stop_requested()) {
      pollfd wait[] = {{.fd = (*connection)->socket(), .events = POLLIN, .revents = 0},
                       {.fd = stopped, .events = POLLIN, .revents = 0}};
      ::poll(wait, 2, -1);
      const absl::StatusOr<int> notifications = (*connection)->take_notifications();
      listens = notifications.ok();
      if (listens && *notifications > 0) hinted();
    }
    pollfd pause{.fd = stopped, .events = POLLIN, .revents = 0};
    ::poll(&pause, 1, 1000);
  }
  ::close(stopped);
}

}  // namespace glasswing
