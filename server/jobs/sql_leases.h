// The statements that hand out tiles and end leases.
#pragma once

#include <absl/functional/function_ref.h>

#include <optional>
#include <span>

#include "server/jobs/job_store.h"
#include "server/jobs/sql_connection.h"

namespace glasswing {

// As SqlJobStore::next_tile.
using NextTile = absl::FunctionRef<std::string(const std::string& open, const std::string& free)>;

// Like JobStore::claim; each statement may be durable by itself. `computes` is not empty.
absl::StatusOr<std::optional<Lease>> claim_tile(SqlConnection& connection, const std::string& solver,
                                                std::span<const std::string> computes, bool ahead,
                                                const JobStoreOptions& options, NextTile next_tile);

struct FailedAttempt {
  bool had_lease = false;  // otherwise nothing has changed
  bool quarantined = false;
};
// Like JobStore::fail; atomic only within a transaction.
absl::StatusOr<FailedAttempt> fail_attempt(SqlConnection& connection, const TileAttempt& lease,
                                           const std::string& error, bool permanent);

// Like JobStore::hand_back. False: the attempt no longer had a lease.
absl::StatusOr<bool> end_attempt(SqlConnection& connection, const TileAttempt& lease);

}  // namespace glasswing
