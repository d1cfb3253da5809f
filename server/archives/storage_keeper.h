// Empties the trash, and ends sessions by the rules.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "glasswing/v1/storage_service.pb.h"
#include "server/archives/retention.h"
#include "server/archives/session_deleter.h"
#include "server/rig/node_registry.h"
#include "server/sessions/session_store.h"
#include "server/storage/matte_files.h"

namespace glasswing {

struct StorageOptions {
  RetentionRules rules;
  double trash_hours = 24.0;  // until the trash is emptied; 0: nothing goes there
};

// Thread-safe.
class StorageKeeper {
 public:
  StorageKeeper(SessionStore& sessions, const NodeRegistry& nodes, const MatteFiles& mattes,
                SessionDeleter& deleter, StorageOptions options)
      : sessions_(sessions),
        nodes_(nodes),
        mattes_(mattes),
        deleter_(deleter),
        options_(std::move(options)) {}

  // Begins to look after the trash every minute, and after the rules every hour.
  void start();

  // Newest first, then those in the trash.
  absl::StatusOr<std::vector<v1::SessionUsage>> usage();
  // For good, or into the trash, if there is one, until `ends`. Returns how many bytes that freed.
  absl::StatusOr<std::int64_t> remove(const std::string& session, bool trash, std::string& ends);
  absl::Status undelete(const std::string& session) { return deleter_.undelete(session); }
  // FAILED_PRECONDITION: there are no rules. A session that cannot be ended now is left for the next time.
  absl::StatusOr<std::vector<v1::SessionEnding>> apply_rules(bool dry_run, absl::Time now);
  // Removes for good what has been in the trash long enough; what a node is needed for that is away stays.
  void empty_trash(absl::Time now);

 private:
  void run(const std::stop_token& stop);
  absl::StatusOr<std::vector<StoredSession>> stored();
  v1::SessionUsage usage_of(const v1::Session& session, const std::vector<v1::Node>& nodes) const;
  // When something that went at that time (RFC 3339) is removed.
  absl::Time end_of(const std::string& since) const;

  SessionStore& sessions_;
  const NodeRegistry& nodes_;
  const MatteFiles& mattes_;
  SessionDeleter& deleter_;
  const StorageOptions options_;
  std::jthread thread_;
};

}  // namespace glasswing
