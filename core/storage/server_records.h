// The records of a server's databases, as a check reads and mends them while no server runs.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/archive/check.h"
#include "core/storage/database.h"
#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

// Of the catalogue's table `sessions`, whose rows are protected (core/storage/row_checksums.h).
inline constexpr char kCatalogueColumns[] = "id, name, request_id, session, note, tags, finished, copies";

// A session as the catalogue has it.
struct SessionRecord {
  v1::Session session;
  std::optional<v1::Session> finished;  // as it was when its last solve finished, while it is solved anew
};

struct TileRecord {
  std::string session;
  std::int64_t job = 0, number = 0;
  std::string result;  // its file
};

class ServerRecords {
 public:
  explicit ServerRecords(std::filesystem::path data) : data_(std::move(data)) {}

  // What cannot be read is found.
  void open(Check& check);
  const std::vector<SessionRecord>& sessions() const { return sessions_; }
  // Whether the catalogue has, or had, a session of the name; true of all where it cannot be read.
  bool knows(const std::string& session) const;
  // Those that are done, of solves under way.
  std::vector<TileRecord> tiles_of_solves();

  absl::Status update(const SessionRecord& record);
  // To be solved anew.
  absl::Status queue_again(const TileRecord& tile);
  absl::Status queue_again(std::int64_t job, int frame);  // the tile of a video's frame

 private:
  std::optional<Database> open_database(const char* name, Finding finding, Check& check);
  void read_sessions(Check& check);

  const std::filesystem::path data_;
  std::optional<Database> catalogue_, jobs_;
  std::vector<SessionRecord> sessions_;
  std::set<std::string> names_;
};

}  // namespace glasswing
