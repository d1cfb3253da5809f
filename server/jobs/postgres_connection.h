// One connection to PostgreSQL by libpq.
#pragma once

#include <map>

#include "server/jobs/sql_job_store.h"

struct pg_conn;
struct pg_result;

namespace glasswing {

// Where a database is, "postgresql://..." or "host=... dbname=...". Nothing here that is for people has a
// password in it.
class PostgresAddress {
 public:
  // INVALID_ARGUMENT: libpq cannot read it.
  static absl::StatusOr<PostgresAddress> parse(const std::string& connection);
  std::string title() const;  // "PostgreSQL at db.lab"

 private:
  friend class PostgresConnection;
  std::vector<std::pair<std::string, std::string>> settings_;
};

class PostgresConnection : public SqlConnection {
 public:
  // UNAVAILABLE: nobody answers there, or it lets us not in.
  static absl::StatusOr<std::unique_ptr<PostgresConnection>> open(const PostgresAddress& address);

  // UNAVAILABLE: the connection is lost, or there was no answer for ten seconds; it is of no use then.
  // `values` empty: there may be several statements. Others stay prepared.
  absl::StatusOr<SqlRows> run(const std::string& sql, const SqlValues& values) override;
  // Looks whether the server has closed it.
  bool is_lost();
  // The last statement was refused only because of another that ran at the same time.
  bool had_conflict() const { return had_conflict_; }
  void roll_back();

  int socket() const;
  // Takes in what came on the channel that it listens on: how many notifications. UNAVAILABLE: the connection
  // is lost.
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
  // The last result of what was sent.
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
