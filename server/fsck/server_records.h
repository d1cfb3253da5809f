// Reads and repairs the records of a server's databases for a check, while no server is running.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/archive/check.h"
#include "glasswing/v1/session_service.pb.h"
#include "server/jobs/job_store.h"
#include "server/storage/database.h"

namespace glasswing {

// A session as recorded in the catalogue.
struct SessionRecord {
  v1::Session session;
  std::optional<v1::Session> finished;  // while it is solved again: its state when the last solve finished
};

struct TileRecord {
  std::string session;
  std::int64_t job = 0;
  int number = 0;
  std::string result;  // its file
};

class ServerRecords {
 public:
  explicit ServerRecords(std::filesystem::path data) : data_(std::move(data)) {}

  // Reads both databases; reports what cannot be read.
  void open(Check& check);
  const std::vector<SessionRecord>& sessions() const { return sessions_; }
  // True if the catalogue has, or had, a session with that name, or cannot be read.
  bool knows(const std::string& session) const;
  // The finished tiles of solves in progress.
  std::vector<TileRecord> tiles_of_solves();

  absl::Status update(const SessionRecord& record);
  // The tile will be solved again.
  absl::Status queue_again(const TileRecord& tile);
  absl::Status queue_again(std::int64_t job, int frame);  // the tile of a video's frame

 private:
  std::optional<Database> open_database(const char* name, Finding finding, Check& check);
  void open_jobs(Check& check);
  void read_sessions(Check& check);

  const std::filesystem::path data_;
  std::optional<Database> catalogue_;
  std::unique_ptr<JobStore> jobs_;  // null: there is none that can be read
  std::vector<SessionRecord> sessions_;
  std::set<std::string> names_;
};

}  // namespace glasswing
