// One connection to PostgreSQL by libpq.
#pragma once

#include <map>

#include "server/jobs/sql_job_store.h"

struct pg_conn;
struct pg_result;

namespace glasswing {

// The address of a database, "postgresql://..." or "host=... dbname=...". Displayed texts never contain the
// password.
class PostgresAddress {
 public:
  // INVALID_ARGUMENT: libpq cannot parse it.
  static absl::StatusOr<PostgresAddress> parse(const std::string& connection);
  std::string title() const;  // "PostgreSQL at db.lab"

 private:
  friend class PostgresConnection;
  std::vector<std::pair<std::string, std::string>> settings_;
};

class PostgresConnection : public SqlConnection {
 public:
  // UNAVAILABLE: nothing answers there, or it rejects the login.
  static absl::StatusOr<std::unique_ptr<PostgresConnection>> open(const PostgresAddress& address);

  // With `values` empty, `sql` may be several statements; otherwise it is one, and stays prepared.
  // UNAVAILABLE: the connection is lost, or there was no answer for ten seconds; it must not be used any
  // more.
  absl::StatusOr<SqlRows> run(const std::string& sql, const SqlValues& values) override;
  // Asks the socket whether the server has closed the connection.
  bool is_lost();
  // The last statement failed only because of a concurrent one.
  bool had_conflict() const { return had_conflict_; }
  void roll_back();

  int socket() const;
  // Reads the notifications that have arrived; returns how many. UNAVAILABLE: the connection is lost.
  absl::StatusOr<int> take_notifications();

 private:
  struct Finish {
    void operator()(pg_conn* connection) const;
  };
  struct Clear {
    void operator()(pg_result* result) const;
  };
  using Result = std::unique_ptr<pg_result, Clear>;

  absl::StatusOr<std::string> prepared(const std::string& sql);
  // The last result of the statements that were sent.
  absl::StatusOr<Result> receive();
  absl::Status error_of(const pg_result* result);
  absl::Status lost(const std::string& why);

  std::string title_;
  std::unique_ptr<pg_conn, Finish> connection_;
  std::map<std::string, std::string> prepared_;  // statements' names
  bool is_lost_ = false;
  bool had_conflict_ = false;
};

}  // namespace glasswing
