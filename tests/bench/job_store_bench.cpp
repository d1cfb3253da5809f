// tests/bench/jobs: the rate at which a job store claims and completes tiles, and the time of a claim.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <mutex>
#include <thread>

#include "server/jobs/job_store.h"

namespace glasswing {
namespace {

using Clock = std::chrono::steady_clock;

const std::vector<std::string> kComputes{"bench/1"};

// Exits if the store fails.
template <typename T>
T value(absl::StatusOr<T> result) {
  if (result.ok()) return *std::move(result);
  fmt::print(stderr, "{}\n", result.status().ToString());
  std::exit(1);
}
void check(const absl::Status& status) {
  if (!status.ok()) value<int>(status);
}

std::int64_t create(JobStore& store, int tiles) {
  std::vector<TileRange> ranges;
  for (int i = 0; i < tiles; ++i) ranges.push_back({.first = 4 * i, .count = 4});
  return value(
      store.create({.session = "bench", .computes = kComputes[0], .work = std::string(1000, 'w')}, ranges));
}

TileResult done(double seconds) {
  return {.result = "tile.exr", .object_pixels = 1000, .flagged_pixels = 1, .seconds = seconds};
}

void in_threads(int count, const std::function<void(const std::string& solver)>& run) {
  std::vector<std::jthread> threads;
  for (int i = 0; i < count; ++i) threads.emplace_back([&run, i] { run(fmt::format("solver{}", i)); });
}

// Tiles claimed and completed per second. `one_at_a_time`: no concurrent calls, so no shared commits.
double rate(JobStore& store, int threads, double seconds, bool one_at_a_time) {
  const std::int64_t job = create(store, static_cast<int>(20000 * seconds));
  std::atomic<int> tiles = 0;
  std::mutex turn;
  const auto start = Clock::now();
  const auto end =
      start + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  in_threads(threads, [&](const std::string& solver) {
    const auto in_turn = [&] {
      return one_at_a_time ? std::unique_lock(turn) : std::unique_lock<std::mutex>();
    };
    while (Clock::now() < end) {
      std::optional<Lease> lease;
      {
        const auto lock = in_turn();
        lease = value(store.claim(solver, kComputes, false));
      }
      if (!lease) continue;
      const auto lock = in_turn();
      check(store.complete(lease->id, done(1.0)));
      ++tiles;
    }
  });
  const double took = std::chrono::duration<double>(Clock::now() - start).count();
  check(store.remove(job));
  return tiles / took;
}

struct Latency {
  double median_ms = 0.0, p99_ms = 0.0;
};

Latency latency(int count, const std::function<void()>& call) {
  std::vector<double> times;
  for (int i = 0; i < count; ++i) {
    const auto start = Clock::now();
    call();
    times.push_back(std::chrono::duration<double, std::milli>(Clock::now() - start).count());
  }
  std::sort(times.begin(), times.end());
  return {.median_ms = times[times.size() / 2], .p99_ms = times[times.size() * 99 / 100]};
}

Latency claim_latency(JobStore& store, int tiles) {
  const std::int64_t job = create(store, tiles);
  const Latency claims = latency(100, [&] { value(store.claim("solver", kComputes, false)).value(); });
  check(store.remove(job));
  return claims;
}

// The time of a claim without result: all tiles are done except 64, which are not slow yet.
Latency idle_latency(JobStore& store, int tiles) {
  const std::int64_t job = create(store, tiles);
  for (int i = 0; i < 64; ++i) value(store.claim(fmt::format("holder{}", i), kComputes, false)).value();
  std::atomic<int> left = tiles - 64;
  in_threads(64, [&](const std::string& solver) {
    while (left > 0) {
      const auto lease = value(store.claim(solver, kComputes, false));
      if (!lease) continue;
      check(store.complete(lease->id, done(3600.0)));
      --left;
    }
  });
  const Latency claims = latency(100, [&] {
    if (value(store.claim("idle", kComputes, false)))
      check(absl::InternalError("a tile that is not slow was handed out twice"));
  });
  check(store.remove(job));
  return claims;
}

int run(int argc, char** argv) {
  CLI::App app{"Claims and completes tiles of a job store.\n\nExample:  tests/bench/jobs"};
  std::string connection, data;
  double seconds = 5.0;
  app.add_option("--jobs", connection, "PostgreSQL's connection string; empty: SQLite");
  app.add_option("--data", data, "Directory of SQLite's file")->required();
  app.add_option("--seconds", seconds, "Duration of each measurement")->check(CLI::Range(0.5, 60.0));
  CLI11_PARSE(app, argc, argv);
  Problems problems;
  const auto store = value(open_job_store(connection, data,
                                          {.server_id = "bench",
                                           .server_address = "bench.lab:7000",
                                           .lease = std::chrono::hours(1),
                                           .least_before_twice = std::chrono::milliseconds(0)},
                                          problems));
  const std::string name = store->title();
  for (const int threads : {1, 4, 16, 64}) {
    fmt::print("{:<26} {:>3} threads            {:>8.0f} tiles/s\n", name, threads,
               rate(*store, threads, seconds, false));
    std::fflush(stdout);
  }
  fmt::print("{:<26} {:>3} threads, in turn   {:>8.0f} tiles/s\n", name, 16, rate(*store, 16, seconds, true));
  for (const int tiles : {100, 10000}) {
    const Latency claims = claim_latency(*store, tiles);
    fmt::print("{:<26} claim, {:>6} tiles      {:>8.2f} ms median {:>8.2f} ms p99\n", name, tiles,
               claims.median_ms, claims.p99_ms);
    std::fflush(stdout);
  }
  const Latency idle = idle_latency(*store, 10000);
  fmt::print("{:<26} claim, nothing free      {:>8.2f} ms median {:>8.2f} ms p99\n", name, idle.median_ms,
             idle.p99_ms);
  return 0;
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  return glasswing::run(argc, argv);
}
