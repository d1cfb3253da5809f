// The tiles that solvers work on. A job is one solve of a session, cut into tiles. A claim is a lease: it
// expires unless it is renewed, and its attempt number is a fencing token, so that a late result of a
// replaced attempt is rejected. Times are in the store's own clock. Job numbers are also the store's own, and
// are never reused.
//
// There are two kinds: SQLite inside one server (the default), and PostgreSQL, which several servers may
// share. Then each solver works for all of them, whichever it asks, and sends a result to the server that
// owns the session.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/storage/problems.h"

namespace glasswing {

inline constexpr int kMaxAttempts = 3;  // failed attempts until a tile is quarantined
inline constexpr int kMaxLost = 10;     // expired leases until a tile is quarantined

// Rows of the camera's picture, or frames of a video. Tiles of a job overlap if frames are solved again.
struct TileRange {
  int first = 0;
  int count = 0;
};

// Tiles of jobs of a higher class go first. A job with a deadline goes before all classes while what is left
// of it takes all solvers longer than that leaves.
enum class JobClass { kBatch = -1, kNormal = 0, kInteractive = 1 };

struct JobSpec {
  std::string session;
  std::string owner = {};  // who shares solvers with others: "anna@lab3"
  std::string computes;    // the method and its version, "gaussian/1": only solvers that compute it get tiles
  std::string work;        // a serialised v1::TileWork; opaque to the store
};

// Names an attempt. A tile's attempts count from 1. Numbers are never reused, not even by a replacement tile.
struct TileAttempt {
  std::int64_t job = 0;
  int tile = 0;
  int attempt = 0;
};

struct Lease {
  TileAttempt id;
  std::string session, work;
  TileRange range;
  std::string server_address;  // of the server that owns the job
  bool own = true;             // the job is of this server
};

struct TileResult {
  std::string result;  // not empty; the file's name of a tile of rows
  std::int64_t object_pixels = 0, flagged_pixels = 0, unsolved_pixels = 0;
  double seconds = 0.0;
};

struct TileState {
  int number = 0;
  TileRange range;
  int failures = 0;
  bool quarantined = false;
  std::string error;  // of the last attempt that failed
  TileResult done;    // result is empty until the tile is done

  bool is_done() const { return !done.result.empty(); }
};

struct JobCounts {
  int tiles = 0, done = 0, quarantined = 0, leased = 0, failures = 0;
  std::int64_t object_pixels = 0, flagged_pixels = 0, unsolved_pixels = 0;  // of those done

  bool rests() const { return done + quarantined == tiles; }  // no tile can be claimed or is awaited
};

// A job of any server that shares the store.
struct JobState {
  std::int64_t id = 0;
  JobClass priority = JobClass::kNormal;
  absl::Time deadline = absl::InfiniteFuture();  // when it should be done; InfiniteFuture: whenever
  std::string owner = {};
  std::string session, computes, server_address;
  bool own = true, suspended = false;
  JobCounts counts;
  double tiles_per_second = 0.0;  // done in the last minute, or since the job was created if that is later
  double tile_seconds = 0.0;      // that a tile took its solver, on average; 0: none is done
};

struct LeaseState {
  TileAttempt id;
  std::string session, solver;
  bool own = true;
  double seconds = 0.0;  // since it was claimed
  bool twice = false;    // another solver has the tile too
};

struct JobStoreOptions {
  std::string server_id;       // identifies the owner of jobs; stays when the address changes
  std::string server_address;  // where solvers send results of this server's jobs
  std::chrono::milliseconds lease{10000};
  std::chrono::milliseconds least_before_twice{2000};  // a tile with a younger lease is not handed out twice
  // A class none of whose jobs had a tile handed out or done for so long has the next one all the same.
  std::chrono::milliseconds class_waits{20000};
};

// Thread-safe. UNAVAILABLE: the database does not answer (PostgreSQL: the next call reconnects). Whether the
// change was made is then unknown, and every call may be repeated. Repeated calls of create() and add() may
// leave an extra job or extra tiles.
class JobStore {
 public:
  virtual ~JobStore() = default;
  virtual std::string title() const = 0;  // human-readable: "SQLite", "PostgreSQL at db.lab"

  // Creates a job, its tiles numbered from 0 in this order. Returns the job's number.
  virtual absl::StatusOr<std::int64_t> create(const JobSpec& spec, std::span<const TileRange> tiles) = 0;
  // The attempt, a survey, is done: replaces the job's work, and its tiles with these, numbered from 0.
  // ABORTED as complete(). A repeated call by the same attempt (the answer was lost) changes nothing and is
  // OK.
  virtual absl::Status recut(const TileAttempt& survey, const std::string& work,
                             std::span<const TileRange> tiles) = 0;

  // NOT_FOUND of these six: there is no such job.
  virtual absl::Status set_class(std::int64_t job, JobClass priority) = 0;
  // InfiniteFuture: none. By the clock of this machine.
  virtual absl::Status set_deadline(std::int64_t job, absl::Time deadline) = 0;
  virtual absl::Status add(std::int64_t job, std::span<const TileRange> tiles) = 0;  // adds tiles
  // Frees quarantined tiles; failures count from 0 again.
  virtual absl::Status retry(std::int64_t job) = 0;
  // No tile of a suspended job is handed out; leased ones may be renewed and completed. Ends with resume(),
  // or when the job's server opens the store again.
  virtual absl::Status suspend(std::int64_t job) = 0;
  virtual absl::Status resume(std::int64_t job) = 0;

  // The tile's result is lost: it is free again, as if never solved. Of none: OK.
  virtual absl::Status requeue(std::int64_t job, int tile) = 0;
  // Removes the job and its tiles; attempts at them become void. Also OK if there is no such job.
  virtual absl::Status remove(std::int64_t job) = 0;
  virtual absl::StatusOr<std::vector<std::int64_t>> own_jobs() = 0;  // of this server; rising
  // 128 random bits in hex, the same for all servers that share the store, used to seal leases.
  virtual absl::StatusOr<std::string> lease_key() = 0;

  // Leases a free tile of a job that computes one of these and is not suspended: of the highest class
  // (JobClass, but see class_waits), of late ones the most urgent, there of the owner who was last served the
  // longest ago, there of the oldest job; tiles that failed come last. If no tile is free: one leased by only
  // one other solver, for longer than least_before_twice and than the average of the job's last hundred
  // tiles; the first result counts. `ahead`: only if at least as many tiles are free as solvers have leases,
  // and never a tile that is leased. Empty: nothing to do. After kMaxLost expired leases a tile is
  // quarantined.
  virtual absl::StatusOr<std::optional<Lease>> claim(const std::string& solver,
                                                     std::span<const std::string> computes, bool ahead) = 0;
  // Extends the lease. ABORTED: the tile is done or removed, or the lease expired and the tile was handed out
  // again. (An expired lease of a tile that was not handed out again is renewed.)
  virtual absl::Status renew(const TileAttempt& lease) = 0;
  // Makes the tile done, and ends other leases on it. ABORTED as in renew(); the attempt that completed the
  // tile may repeat the call.
  virtual absl::Status complete(const TileAttempt& lease, const TileResult& result) = 0;
  // Ends the lease. If `permanent`, or after kMaxAttempts failures, quarantines the tile unless another
  // solver is still working on it, and returns true. A void attempt: false.
  virtual absl::StatusOr<bool> fail(const TileAttempt& lease, const std::string& error, bool permanent) = 0;
  // Ends the lease without counting a failure. Also OK for a void attempt.
  virtual absl::Status hand_back(const TileAttempt& lease) = 0;

  virtual absl::StatusOr<std::vector<TileState>> tiles(std::int64_t job) = 0;  // by number; none: no such job
  virtual absl::StatusOr<TileState> tile(const TileAttempt& id) = 0;           // ABORTED: no such job or tile
  virtual absl::StatusOr<JobCounts> counts(std::int64_t job) = 0;              // all 0: no such job
  virtual absl::StatusOr<std::vector<JobState>> jobs() = 0;      // unfinished ones, in the order of work
  virtual absl::StatusOr<std::vector<LeaseState>> leases() = 0;  // that have not expired

  // Waits for a hint, from any server, that tiles may have become free: at most `timeout`, and not at all if
  // one came since the last call. Hints may be lost.
  virtual void wait_for_tiles(std::chrono::milliseconds timeout) = 0;
};

// `connection` empty: SQLite at DATA/jobs.sqlite; a damaged file is set aside, and a new one created.
// "postgresql://..." or "host=... dbname=...": PostgreSQL. If that does not answer yet, calls fail with
// UNAVAILABLE until it does. `problems` receives what is wrong. INVALID_ARGUMENT: `connection` is none of
// these. FAILED_PRECONDITION: the tables are from a newer version.
absl::StatusOr<std::unique_ptr<JobStore>> open_job_store(const std::string& connection,
                                                         const std::filesystem::path& data,
                                                         JobStoreOptions options, Problems& problems);

// A store of one server that ends with the object, for tiles that need not outlive it.
absl::StatusOr<std::unique_ptr<JobStore>> open_job_store_in_memory(JobStoreOptions options);

}  // namespace glasswing
