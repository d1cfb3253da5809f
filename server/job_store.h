// The tiles that solvers work on. A claim is a lease: it ends unless it is kept, and its attempt number
// fences, so that a late result of an older attempt is refused. Time is the store's own.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/time.h"
#include "server/database.h"

namespace glasswing {

inline constexpr std::chrono::seconds kLease(10);
inline constexpr int kMaxAttempts = 3;

// Rows of the camera's picture; of a video frames.
struct Tile {
  std::string session;
  int number = 0;
  int first = 0;
  int count = 0;
  int attempt = 0;
  std::string result;  // once it is done; of rows their file's name

  bool is_done() const { return !result.empty(); }
  bool is_given_up() const { return result == "void"; }
};

struct FrameRange {
  int first = 0;
  int count = 0;
};

// Thread-safe. `now` is any monotonic time; leases do not outlive the process that granted them.
class JobStore {
 public:
  static absl::StatusOr<std::unique_ptr<JobStore>> open(const std::filesystem::path& path);

  // Replaces whatever tiles the session had, held or not, by tiles of so many rows or frames each, one after
  // another.
  absl::Status create(const std::string& session, std::span<const int> counts);
  // More tiles, of these frames: what was made of them before is made anew.
  absl::Status add(const std::string& session, std::span<const FrameRange> frames);
  // Tiles that failed or were given up may be tried again, as often as new ones.
  absl::Status retry(const std::string& session);
  // The session's tiles are not handed out until it is released, or this store is opened again. What was
  // handed out may be completed.
  absl::Status hold(const std::string& session);
  absl::Status release(const std::string& session);
  // Nobody works on the session's tiles any more.
  absl::Status give_up(const std::string& session);
  // As give_up(), and forgets them but for one: a later session of that name must not accept results of this
  // one.
  absl::Status remove(const std::string& session);

  // The oldest tile that is free or whose lease has ended; none if there is none.
  absl::StatusOr<std::optional<Tile>> claim(const std::string& solver, nanoseconds now);
  // ABORTED: the lease went to another attempt, or the tile is done or gone.
  absl::Status keep(const Tile& lease, nanoseconds now);
  absl::Status complete(const Tile& lease, const std::string& result);
  // Frees the tile for another attempt. True: it has had kMaxAttempts.
  absl::StatusOr<bool> fail(const Tile& lease);

  absl::StatusOr<std::vector<Tile>> tiles(const std::string& session);

 private:
  explicit JobStore(Database database) : database_(std::move(database)) {}
  absl::Status fenced(const Tile& lease);
  // With mutex_ held. `before`, if any, removes those there are, in the same transaction.
  absl::Status insert(const std::string& session, std::span<const FrameRange> ranges,
                      const std::string& before);

  std::mutex mutex_;
  Database database_;  // guarded by mutex_
};

}  // namespace glasswing
