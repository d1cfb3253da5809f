// A real PostgreSQL for one test program; see the script `postgres` beside this.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <libpq-fe.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>

namespace glasswing {

class PostgresFixture {
 public:
  // The test program's database, started by the first call. Null where PostgreSQL is not installed: skip, and
  // say so.
  static PostgresFixture* shared() {
    static const std::unique_ptr<PostgresFixture> fixture = begin();
    return fixture.get();
  }
  static constexpr char kMissing[] = "PostgreSQL is not installed (Debian: postgresql)";

  ~PostgresFixture() { script("down"); }
  PostgresFixture(const PostgresFixture&) = delete;
  PostgresFixture& operator=(const PostgresFixture&) = delete;

  const std::string& connection() const { return connection_; }
  void stop() const { EXPECT_EQ(script("stop"), 0); }  // at once, as if it were killed
  void start() const { EXPECT_EQ(script("start"), 0); }
  void restart() const { EXPECT_EQ(script("restart"), 0); }
  // Runs statements at the database itself.
  void run(const std::string& sql) const {
    const std::unique_ptr<PGconn, decltype(&PQfinish)> to(PQconnectdb(connection_.c_str()), PQfinish);
    const std::unique_ptr<PGresult, decltype(&PQclear)> result(PQexec(to.get(), sql.c_str()), PQclear);
    const ExecStatusType status = PQresultStatus(result.get());
    EXPECT_TRUE(status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK) << PQerrorMessage(to.get());
  }
  // Removes all tables, as if no server had been here.
  void clear() const { run("SET client_min_messages = warning; DROP SCHEMA IF EXISTS glasswing CASCADE"); }

 private:
  PostgresFixture() = default;

  static std::unique_ptr<PostgresFixture> begin() {
    std::unique_ptr<PostgresFixture> fixture(new PostgresFixture);
    const std::string command = fixture->command("up") + " " + std::to_string(::getpid());
    FILE* output = ::popen(command.c_str(), "r");
    std::array<char, 256> line{};
    if (std::fgets(line.data(), line.size(), output) != nullptr) fixture->connection_ = line.data();
    const int status = ::pclose(output);
    if (WEXITSTATUS(status) == 77) return nullptr;
    EXPECT_EQ(status, 0) << command;
    while (!fixture->connection_.empty() && fixture->connection_.back() == '\n')
      fixture->connection_.pop_back();
    return fixture;
  }
  std::string command(const std::string& what) const {
    const auto path = std::filesystem::path(__FILE__).parent_path() / "postgres";
    return fmt::format("'{}' {} '{}'", path.string(), what, directory_.string());
  }
  int script(const std::string& what) const { return std::system(command(what).c_str()); }

  const std::filesystem::path directory_ =
      std::filesystem::path(testing::TempDir()) / ("postgres." + std::to_string(::getpid()));
  std::string connection_;
};

}  // namespace glasswing
