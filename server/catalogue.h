// The durable list of sessions. What a session holds in frames is known by the node with its archive; here
// stands what was asked for and how far it came.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "glasswing/v1/session_service.pb.h"
#include "server/database.h"

namespace glasswing {

// Thread-safe.
class Catalogue {
 public:
  static absl::StatusOr<std::unique_ptr<Catalogue>> open(const std::filesystem::path& path);

  // ALREADY_EXISTS: the name is taken.
  absl::Status insert(const v1::Session& session, const std::string& request_id);
  // Durable when it returns.
  absl::Status update(const v1::Session& session);
  absl::Status remove(const std::string& name);
  // NOT_FOUND: "there is no session ...".
  absl::StatusOr<v1::Session> find(const std::string& name);
  // NOT_FOUND: no session was made by this request.
  absl::StatusOr<v1::Session> find_request(const std::string& request_id);
  absl::StatusOr<std::vector<v1::Session>> list();  // newest first

 private:
  explicit Catalogue(Database database) : database_(std::move(database)) {}
  absl::StatusOr<v1::Session> first(Database::Query query, const std::string& missing);

  std::mutex mutex_;
  Database database_;  // guarded by mutex_
};

}  // namespace glasswing
