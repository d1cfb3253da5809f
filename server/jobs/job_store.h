// The tiles that solvers work on. A job is one solve of a session, cut into tiles. A claim is a lease: it
// ends unless it is kept, and its attempt number fences, so that a late result of an attempt that was
// replaced is refused. Time is the store's own, and so are the numbers of jobs, which are never used again.
//
// Two kinds: SQLite inside one server (the default), and PostgreSQL, which several servers may share: then
// each solver works for all of them, whichever it asks, and the results go to the server whose session it is.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace glasswing {

inline constexpr int kMaxAttempts = 3;  // that fail
inline constexpr int kMaxLost = 10;     // whose lease ends without a word

// Rows of the camera's picture; of a video frames. The tiles of a job may overlap: frames that are made anew.
struct TileRange {
  int first = 0;
  int count = 0;
};

struct JobSpec {
  std::string session;
  std::string
      computes;      // the method and its version, "gaussian/1": only solvers that compute this get its tiles
  std::string work;  // what a solver must know; bytes that only servers and solvers understand
};

// Names an attempt. The attempts of a tile count from 1 and are never used again, not even by a tile that
// replaces it.
struct TileAttempt {
  std::int64_t job = 0;
  int tile = 0;
  int attempt = 0;
};

struct Lease {
  TileAttempt id;
  std::string session, work;
  TileRange range;
  std::string server_address;  // whose job it is
  bool own = true;             // ... is this store's own server
};

struct TileResult {
  std::string result;  // not empty; of rows their file's name
  std::int64_t object_pixels = 0, flagged_pixels = 0;
  double seconds = 0.0;
};

struct TileState {
  int number = 0;
  TileRange range;
  int failures = 0;
  bool quarantined = false;
  std::string error;  // of the last attempt that failed
  TileResult done;    // result empty: not yet

  bool is_done() const { return !done.result.empty(); }
};

struct JobCounts {
  int tiles = 0, done = 0, quarantined = 0, leased = 0, failures = 0;
  std::int64_t object_pixels = 0, flagged_pixels = 0;  // of those done

  bool rests() const { return done + quarantined == tiles; }  // nothing is left to be handed out or awaited
};

// Of every server that shares the store.
struct JobState {
  std::int64_t id = 0;
  std::string session, computes, server_address;
  bool own = true, suspended = false;
  JobCounts counts;
  double tiles_per_second = 0.0;  // done in the last minute, or since the job was created if that is less
};

struct LeaseState {
  TileAttempt id;
  std::string session, solver;
  bool own = true;
  double seconds = 0.0;  // since it was claimed
  bool twice = false;    // another solver has the tile too
};

struct JobStoreOptions {
  std::string server_id;       // stays when the address changes: whose jobs these are
  std::string server_address;  // where results of this server's jobs are sent
  std::chrono::milliseconds lease{10000};
  std::chrono::milliseconds least_before_twice{2000};  // a lease younger than this is not handed out twice
};

// Thread-safe. UNAVAILABLE: the database does not answer now (PostgreSQL: it reconnects by itself with the
// next call); nothing was changed, or it is not known whether it was: every call may be repeated. create()
// and add() so repeated may leave a job or tiles that nobody asked for.
class JobStore {
 public:
  virtual ~JobStore() = default;
  virtual std::string title() const = 0;  // for people: "SQLite", "PostgreSQL at db.lab"

  // A new job, its tiles numbered from 0 in this order. Returns its number.
  virtual absl::StatusOr<std::int64_t> create(const JobSpec& spec, std::span<const TileRange> tiles) = 0;
  // The attempt, a survey, is done: the job's tiles are replaced by these, numbered from 0, and its work too.
  // ABORTED as complete(). Repeated by the same attempt (its answer was lost): does nothing and is OK.
  virtual absl::Status recut(const TileAttempt& survey, const std::string& work,
                             std::span<const TileRange> tiles) = 0;

  // These four are NOT_FOUND if there is no such job.
  virtual absl::Status add(std::int64_t job, std::span<const TileRange> tiles) = 0;  // more tiles
  // Quarantined tiles are free again, failures count from 0.
  virtual absl::Status retry(std::int64_t job) = 0;
  // Nothing of a held job is handed out; what was may be kept and completed. Until it is released, or its
  // server opens the store again.
  virtual absl::Status suspend(std::int64_t job) = 0;
  virtual absl::Status resume(std::int64_t job) = 0;

  virtual absl::Status remove(
      std::int64_t job) = 0;  // with its tiles; whoever works on them is fenced. Of none: OK
  virtual absl::StatusOr<std::vector<std::int64_t>> own_jobs() = 0;  // of this server; rising

  // A free tile, of the oldest job first, its failed ones last, of a job that is not held and computes one of
  // these. Where none is free: a tile that another solver has held for longer than least_before_twice and
  // than the job's last hundred tiles took on average, and that only one has: the first result counts.
  // `ahead`: only if at least as many tiles are free as solvers hold leases, and never one that somebody else
  // holds. None: nothing to do.
  // A tile that kMaxLost attempts took and never spoke of again is quarantined instead.
  virtual absl::StatusOr<std::optional<Lease>> claim(const std::string& solver,
                                                     std::span<const std::string> computes, bool ahead) = 0;
  // ABORTED: the tile is done or gone, or the lease has ended and the tile was handed out again since. (A
  // lease that has ended but was not handed out again goes on.)
  virtual absl::Status renew(const TileAttempt& lease) = 0;
  // ABORTED as keep(), but for the attempt that did it, which may say so again. Ends the leases of others on
  // that tile.
  virtual absl::Status complete(const TileAttempt& lease, const TileResult& result) = 0;
  // Ends the lease. `permanent`, or after kMaxAttempts: the tile is quarantined (unless another still works
  // on it), and true is returned. Of an attempt that is void: false.
  virtual absl::StatusOr<bool> fail(const TileAttempt& lease, const std::string& error, bool permanent) = 0;
  // Ends the lease as if it had never been claimed: no failure. Of an attempt that is void: OK.
  virtual absl::Status hand_back(const TileAttempt& lease) = 0;

  virtual absl::StatusOr<std::vector<TileState>> tiles(std::int64_t job) = 0;  // by number; none: no such job
  virtual absl::StatusOr<TileState> tile(const TileAttempt& id) = 0;           // ABORTED: no such job or tile
  virtual absl::StatusOr<JobCounts> counts(std::int64_t job) = 0;              // all 0: no such job
  virtual absl::StatusOr<std::vector<JobState>>
  jobs() = 0;  // unfinished ones, in the order they are worked on
  virtual absl::StatusOr<std::vector<LeaseState>> leases() = 0;  // those that have not ended

  // A hint that tiles may have become free, from whichever server; returns at once if one came since the last
  // call, at the latest after `timeout`. Hints may be lost.
  virtual void wait_for_tiles(std::chrono::milliseconds timeout) = 0;
};

// `connection` empty: SQLite at DATA/jobs.sqlite. "postgresql://..." or "host=... dbname=...": PostgreSQL.
// INVALID_ARGUMENT: it is none of these. FAILED_PRECONDITION: the tables are of a newer version.
absl::StatusOr<std::unique_ptr<JobStore>> open_job_store(const std::string& connection,
                                                         const std::filesystem::path& data,
                                                         JobStoreOptions options);

}  // namespace glasswing
