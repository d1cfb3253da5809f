#include "server/jobs/postgres_connection.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_replace.h>
#include <fmt/format.h>
#include <libpq-fe.h>
#include <poll.h>

#include <algorithm>

#include "core/base/status.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr milliseconds kAnswer(10000);

// Defaults that a connection string may override.
constexpr std::pair<const char*, const char*> kDefaults[] = {
    {"connect_timeout", "5"},       // seconds
    {"tcp_user_timeout", "10000"},  // milliseconds
    {"application_name", "glasswing-server"},
    {"client_encoding", "UTF8"},
};

// Overrides the database's defaults. Every statement has a suitable index, even if it was prepared while the
// tables were small. JIT compilation, which a full scan's estimated cost would trigger, does not pay.
constexpr char kSession[] =
    "SET search_path = glasswing; SET default_transaction_isolation = 'read committed'; "
    "SET synchronous_commit = on; SET enable_seqscan = off; SET enable_bitmapscan = off; SET "
    "jit = off; SET client_min_messages = warning";

std::string in_dialect(const std::string& sql) {
  return absl::StrReplaceAll(sql, {{"?", "$"},
                                   {":now", "(extract(epoch FROM clock_timestamp()) * 1000000)::bigint"},
                                   {":locking", "FOR UPDATE OF t SKIP LOCKED"}});
}

absl::StatusCode code_of(std::string_view state) {
  const std::string_view kind = state.substr(0, 2);
  if (kind == "08" || kind == "57" || kind == "40" || state == "53300") return absl::StatusCode::kUnavailable;
  if (kind == "53" || kind == "54") return absl::StatusCode::kResourceExhausted;
  if (state == "42501") return absl::StatusCode::kPermissionDenied;
  return absl::StatusCode::kInternal;
}

SqlRows rows_of(const PGresult* result) {
  SqlRows rows;
  for (int i = 0; i < PQntuples(result); ++i) {
    std::vector<std::string> row;
    for (int column = 0; column < PQnfields(result); ++column) {
      constexpr Oid kBytea = 17;
      const char* value = PQgetvalue(result, i, column);
      if (PQftype(result, column) == kBytea) {
        size_t size = 0;
        const std::unique_ptr<unsigned char, decltype(&PQfreemem)> bytes(
            PQunescapeBytea(reinterpret_cast<const unsigned char*>(value), &size), PQfreemem);
        row.emplace_back(reinterpret_cast<const char*>(bytes.get()), size);
      } else {
        row.emplace_back(value, static_cast<size_t>(PQgetlength(result, i, column)));
      }
    }
    rows.add(std::move(row));
  }
  return rows;
}

}  // namespace

absl::StatusOr<PostgresAddress> PostgresAddress::parse(const std::string& connection) {
  char* error = nullptr;
  const std::unique_ptr<PQconninfoOption, decltype(&PQconninfoFree)> options(
      PQconninfoParse(connection.c_str(), &error), PQconninfoFree);
  // libpq's message would repeat the connection string, perhaps with a password.
  PQfreemem(error);
  if (options == nullptr) {
    return absl::InvalidArgumentError(
        "the connection string of the job store cannot be read; it must be of the form "
        "postgresql://USER@HOST/DATABASE or \"host=HOST dbname=DATABASE user=USER\"");
  }
  PostgresAddress address;
  for (const PQconninfoOption* option = options.get(); option->keyword != nullptr; ++option) {
    if (option->val != nullptr) address.settings_.emplace_back(option->keyword, option->val);
  }
  return address;
}

std::string PostgresAddress::title() const {
  for (const char* wanted : {"host", "hostaddr", "service"}) {
    for (const auto& [keyword, value] : settings_) {
      if (keyword == wanted && !value.empty()) return fmt::format("PostgreSQL at {}", value);
    }
  }
  return "PostgreSQL";
}

void PostgresConnection::Finish::operator()(pg_conn* connection) const {
  PQfinish(connection);
}
void PostgresConnection::Clear::operator()(pg_result* result) const {
  PQclear(result);
}

absl::StatusOr<std::unique_ptr<PostgresConnection>> PostgresConnection::open(const PostgresAddress& address) {
  std::vector<const char*> keywords, values;
  for (const auto& [keyword, value] : kDefaults) {
    keywords.push_back(keyword);
    values.push_back(value);
  }
  for (const auto& [keyword, value] : address.settings_) {  // the last value counts
    keywords.push_back(keyword.c_str());
    values.push_back(value.c_str());
  }
  keywords.push_back(nullptr);
  values.push_back(nullptr);
  auto connection = std::make_unique<PostgresConnection>();
  connection->title_ = address.title();
  connection->connection_.reset(PQconnectdbParams(keywords.data(), values.data(), 0));
  if (PQstatus(connection->connection_.get()) != CONNECTION_OK) {
    return connection->lost(PQerrorMessage(connection->connection_.get()));
  }
  PQsetNoticeProcessor(
      connection->connection_.get(), [](void*, const char*) {}, nullptr);
  GW_RETURN_IF_ERROR(connection->run(kSession, {}).status());
  return connection;
}

absl::StatusOr<SqlRows> PostgresConnection::run(const std::string& sql, const SqlValues& values) {
  had_conflict_ = false;
  if (values.empty()) {
    if (PQsendQuery(connection_.get(), in_dialect(sql).c_str()) == 0) {
      return lost(PQerrorMessage(connection_.get()));
    }
  } else {
    GW_ASSIGN_OR_RETURN(const std::string name, prepared(sql));
    std::vector<std::string> texts;
    std::vector<int> lengths, formats;
    for (const SqlValue& value : values) {
      const auto* bytes = std::get_if<SqlBytes>(&value);
      if (const auto* integer = std::get_if<std::int64_t>(&value)) texts.push_back(std::to_string(*integer));
      if (const auto* real = std::get_if<double>(&value)) texts.push_back(fmt::format("{}", *real));
      if (const auto* text = std::get_if<std::string>(&value)) texts.push_back(*text);
      if (bytes != nullptr) texts.push_back(bytes->bytes);
      lengths.push_back(static_cast<int>(texts.back().size()));
      formats.push_back(bytes != nullptr);  // binary
    }
    std::vector<const char*> pointers;
    for (const std::string& text : texts) pointers.push_back(text.c_str());
    if (PQsendQueryPrepared(connection_.get(), name.c_str(), static_cast<int>(pointers.size()),
                            pointers.data(), lengths.data(), formats.data(), 0) == 0) {
      return lost(PQerrorMessage(connection_.get()));
    }
  }
  GW_ASSIGN_OR_RETURN(const Result result, receive());
  return rows_of(result.get());
}

absl::StatusOr<std::string> PostgresConnection::prepared(const std::string& sql) {
  const auto known = prepared_.find(sql);
  if (known != prepared_.end()) return known->second;
  const std::string name = fmt::format("s{}", prepared_.size());
  if (PQsendPrepare(connection_.get(), name.c_str(), in_dialect(sql).c_str(), 0, nullptr) == 0) {
    return lost(PQerrorMessage(connection_.get()));
  }
  GW_RETURN_IF_ERROR(receive().status());
  prepared_[sql] = name;
  return name;
}

absl::StatusOr<PostgresConnection::Result> PostgresConnection::receive() {
  const auto deadline = steady_clock::now() + kAnswer;
  Result last;
  absl::Status failed;
  for (;;) {
    while (PQisBusy(connection_.get()) != 0) {
      const auto left = std::chrono::duration_cast<milliseconds>(deadline - steady_clock::now());
      pollfd wait{.fd = PQsocket(connection_.get()), .events = POLLIN, .revents = 0};
      const int ready = ::poll(&wait, 1, static_cast<int>(std::max(left, milliseconds(0)).count()));
      if (ready < 0 && errno == EINTR) continue;
      if (ready == 0) return lost(fmt::format("no answer for {} s", kAnswer.count() / 1000));
      if (ready < 0 || PQconsumeInput(connection_.get()) == 0) return lost(PQerrorMessage(connection_.get()));
    }
    Result next(PQgetResult(connection_.get()));
    if (next == nullptr) break;
    const ExecStatusType status = PQresultStatus(next.get());
    if (failed.ok() && status != PGRES_COMMAND_OK && status != PGRES_TUPLES_OK) failed = error_of(next.get());
    last = std::move(next);
  }
  GW_RETURN_IF_ERROR(failed);
  if (last == nullptr) return lost(PQerrorMessage(connection_.get()));
  return last;
}

absl::Status PostgresConnection::error_of(const pg_result* result) {
  const char* state = PQresultErrorField(result, PG_DIAG_SQLSTATE);
  if (PQstatus(connection_.get()) != CONNECTION_OK || state == nullptr) {
    return lost(PQresultErrorMessage(result));
  }
  const char* message = PQresultErrorField(result, PG_DIAG_MESSAGE_PRIMARY);
  had_conflict_ = std::string_view(state) == "40001" || std::string_view(state) == "40P01";
  return absl::Status(code_of(state), fmt::format("{}: {}", title_, message != nullptr ? message : state));
}

absl::Status PostgresConnection::lost(const std::string& why) {
  is_lost_ = true;
  // libpq's message has several lines, the first with the host's name.
  return absl::UnavailableError(fmt::format(
      "{}: {}", title_, absl::StrReplaceAll(absl::StripAsciiWhitespace(why), {{"\n\t", " "}, {"\n", " "}})));
}

bool PostgresConnection::is_lost() {
  pollfd look{.fd = socket(), .events = POLLIN, .revents = 0};
  // The server may send a last message before it closes the connection.
  while (!is_lost_ && ::poll(&look, 1, 0) > 0) {
    is_lost_ = PQconsumeInput(connection_.get()) == 0 || PQstatus(connection_.get()) != CONNECTION_OK;
  }
  return is_lost_;
}

void PostgresConnection::roll_back() {
  const bool had_conflict = had_conflict_;
  if (!is_lost()) (void)run("ROLLBACK", {});
  had_conflict_ = had_conflict;
}

int PostgresConnection::socket() const {
  return PQsocket(connection_.get());
}

absl::StatusOr<int> PostgresConnection::take_notifications() {
  if (PQconsumeInput(connection_.get()) == 0) return lost(PQerrorMessage(connection_.get()));
  int count = 0;
  while (PGnotify* notification = PQnotifies(connection_.get())) {
    PQfreemem(notification);
    ++count;
  }
  return count;
}

}  // namespace glasswing
