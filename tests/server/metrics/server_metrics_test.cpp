#include "server/metrics/server_metrics.h"

#include <gtest/gtest.h>

#include "server/jobs/timed_job_store.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

double value(const std::vector<prometheus::MetricFamily>& families, const std::string& name,
             const prometheus::Labels& labels = {}) {
  for (const prometheus::MetricFamily& family : families) {
    if (family.name != name) continue;
    for (const prometheus::ClientMetric& metric : family.metric) {
      prometheus::Labels its;
      for (const auto& label : metric.label) its[label.name] = label.value;
      if (its != labels) continue;
      if (family.type == prometheus::MetricType::Counter) return metric.counter.value;
      if (family.type == prometheus::MetricType::Histogram)
        return static_cast<double>(metric.histogram.sample_count);
      return metric.gauge.value;
    }
  }
  ADD_FAILURE() << "there is no " << name;
  return 0.0;
}

v1::FleetSolve solve(const std::string& server, int tiles, int done, int leased, int quarantined, bool held) {
  v1::FleetSolve solve;
  solve.set_server(server);
  solve.set_tile_count(tiles);
  solve.set_tiles_done(done);
  solve.set_tiles_leased(leased);
  solve.set_quarantined(quarantined);
  solve.set_held(held);
  return solve;
}

TEST(ServerGauges, CountTilesOfOwnSolvesAndSolversByState) {
  v1::GetFleetResponse fleet;
  *fleet.add_solves() = solve("", 100, 40, 7, 3, false);
  *fleet.add_solves() = solve("", 20, 5, 0, 1, true);
  *fleet.add_solves() = solve("lab2:7440", 1000, 0, 0, 0, false);
  *fleet.add_solves() = solve("", 0, 0, 1, 0, false);  // a survey
  for (int i = 0; i < 6; ++i) {
    v1::FleetSolver& solver = *fleet.add_solvers();
    solver.set_up(i < 5);
    if (i == 0) solver.set_refused("too old");
    if (i == 1 || i == 2) solver.add_leases()->set_twice(true);
  }
  const auto families = server_gauges(fleet, {}, {}, 0);
  EXPECT_EQ(value(families, "glasswing_job_store_up"), 1.0);
  EXPECT_EQ(value(families, "glasswing_tiles", {{"state", "waiting"}}), 50.0);
  EXPECT_EQ(value(families, "glasswing_tiles", {{"state", "held"}}), 14.0);
  EXPECT_EQ(value(families, "glasswing_tiles", {{"state", "leased"}}), 8.0);
  EXPECT_EQ(value(families, "glasswing_tiles", {{"state", "quarantined"}}), 4.0);
  EXPECT_EQ(value(families, "glasswing_solves_running"), 2.0);
  EXPECT_EQ(value(families, "glasswing_solvers", {{"state", "up"}}), 4.0);
  EXPECT_EQ(value(families, "glasswing_solvers", {{"state", "refused"}}), 1.0);
  EXPECT_EQ(value(families, "glasswing_solvers", {{"state", "away"}}), 1.0);
  EXPECT_EQ(value(families, "glasswing_leases_twice"), 2.0);
}

TEST(ServerGauges, TellAStoreThatDoesNotAnswerAndWhatThereIsBeside) {
  std::vector<v1::Session> sessions(3);
  sessions[0].set_state(v1::SESSION_STATE_DONE);
  sessions[1].set_state(v1::SESSION_STATE_DONE);
  sessions[2].set_state(v1::SESSION_STATE_SOLVING);
  std::vector<v1::Node> nodes(2);
  nodes[0].set_kind(v1::NODE_KIND_CAMERA);
  nodes[0].set_name("camera-1");
  nodes[0].set_up(true);
  nodes[1].set_kind(v1::NODE_KIND_DISPLAY);
  nodes[1].set_name("display-1");
  const auto families = server_gauges(absl::UnavailableError("no PostgreSQL"), sessions, nodes, 2);
  EXPECT_EQ(value(families, "glasswing_job_store_up"), 0.0);
  EXPECT_EQ(value(families, "glasswing_sessions", {{"state", "done"}}), 2.0);
  EXPECT_EQ(value(families, "glasswing_sessions", {{"state", "solving"}}), 1.0);
  EXPECT_EQ(value(families, "glasswing_sessions", {{"state", "failed"}}), 0.0);
  EXPECT_EQ(value(families, "glasswing_node_up", {{"kind", "camera"}, {"name", "camera-1"}}), 1.0);
  EXPECT_EQ(value(families, "glasswing_node_up", {{"kind", "display"}, {"name", "display-1"}}), 0.0);
}

// Answers each call with a status of its own.
class FakeStore final : public JobStore {
 public:
  std::string title() const override { return "a fake"; }
  absl::StatusOr<std::int64_t> create(const JobSpec&, std::span<const TileRange> tiles) override {
    return static_cast<std::int64_t>(tiles.size());
  }
  absl::Status recut(const TileAttempt&, const std::string&, std::span<const TileRange>) override {
    return absl::AbortedError("recut");
  }
  absl::Status add(std::int64_t, std::span<const TileRange>) override { return absl::NotFoundError("add"); }
  absl::Status set_class(std::int64_t, JobClass) override { return absl::NotFoundError("class"); }
  absl::Status set_deadline(std::int64_t, absl::Time) override { return absl::NotFoundError("deadline"); }
  absl::Status retry(std::int64_t) override { return absl::NotFoundError("retry"); }
  absl::Status suspend(std::int64_t) override { return absl::NotFoundError("hold"); }
  absl::Status resume(std::int64_t) override { return absl::NotFoundError("release"); }
  absl::Status requeue(std::int64_t, int) override { return absl::UnavailableError("requeue"); }
  absl::Status remove(std::int64_t) override { return absl::UnavailableError("remove"); }
  absl::StatusOr<std::vector<std::int64_t>> own_jobs() override { return std::vector<std::int64_t>{4, 5}; }
  absl::StatusOr<std::string> lease_key() override { return "key"; }
  absl::StatusOr<std::optional<Lease>> claim(const std::string& solver, std::span<const std::string>,
                                             bool ahead) override {
    if (ahead) return absl::UnavailableError("claim");
    Lease lease;
    lease.session = solver;
    return lease;
  }
  absl::Status renew(const TileAttempt&) override { return absl::AbortedError("keep"); }
  absl::Status complete(const TileAttempt&, const TileResult&) override { return absl::OkStatus(); }
  absl::StatusOr<bool> fail(const TileAttempt&, const std::string&, bool permanent) override {
    return permanent;
  }
  absl::Status hand_back(const TileAttempt&) override { return absl::OkStatus(); }
  absl::StatusOr<std::vector<TileState>> tiles(std::int64_t) override { return std::vector<TileState>(3); }
  absl::StatusOr<TileState> tile(const TileAttempt& id) override {
    TileState state;
    state.number = id.tile;
    return state;
  }
  absl::StatusOr<JobCounts> counts(std::int64_t) override {
    JobCounts counts;
    counts.tiles = 9;
    return counts;
  }
  absl::StatusOr<std::vector<JobState>> jobs() override { return std::vector<JobState>(2); }
  absl::StatusOr<std::vector<LeaseState>> leases() override { return std::vector<LeaseState>(1); }
  void wait_for_tiles(std::chrono::milliseconds timeout) override { waited = timeout; }

  std::chrono::milliseconds waited{};
};

TEST(TimedJobStore, PassesEveryCallOnAndCountsIt) {
  auto owned = std::make_unique<FakeStore>();
  FakeStore& fake = *owned;
  Problems problems;
  const std::unique_ptr<JobStore> store = timed(std::move(owned), problems);
  const auto calls = [](const std::string& operation) {
    return value(collect_metrics(), "glasswing_job_store_seconds", {{"operation", operation}});
  };
  const auto failures = [](const std::string& operation) {
    return value(collect_metrics(), "glasswing_job_store_failures_total", {{"operation", operation}});
  };
  const std::vector<TileRange> ranges(2);
  const std::vector<std::string> computes{"gaussian/1"};
  EXPECT_EQ(store->title(), "a fake");
  EXPECT_EQ(store->create({}, ranges).value(), 2);
  EXPECT_EQ(store->recut({}, "", ranges), absl::AbortedError("recut"));
  EXPECT_EQ(store->add(1, ranges), absl::NotFoundError("add"));
  EXPECT_EQ(store->retry(1), absl::NotFoundError("retry"));
  EXPECT_EQ(store->suspend(1), absl::NotFoundError("hold"));
  EXPECT_EQ(store->resume(1), absl::NotFoundError("release"));
  EXPECT_EQ(store->remove(1), absl::UnavailableError("remove"));
  EXPECT_EQ(store->own_jobs().value(), (std::vector<std::int64_t>{4, 5}));
  EXPECT_EQ(store->claim("a", computes, false).value()->session, "a");
  EXPECT_EQ(store->claim("a", computes, true).status(), absl::UnavailableError("claim"));
  EXPECT_EQ(store->renew({}), absl::AbortedError("keep"));
  EXPECT_OK(store->complete({}, {}));
  EXPECT_TRUE(store->fail({}, "", true).value());
  EXPECT_FALSE(store->fail({}, "", false).value());
  EXPECT_OK(store->hand_back({}));
  EXPECT_EQ(store->tiles(1).value().size(), 3u);
  EXPECT_EQ(store->tile({.job = 1, .tile = 7, .attempt = 1}).value().number, 7);
  EXPECT_EQ(store->counts(1).value().tiles, 9);
  EXPECT_EQ(store->jobs().value().size(), 2u);
  EXPECT_EQ(store->leases().value().size(), 1u);
  store->wait_for_tiles(std::chrono::milliseconds(5));
  EXPECT_EQ(fake.waited, std::chrono::milliseconds(5));
  const std::map<std::string, double> expected{{"create", 1},    {"recut", 1}, {"change", 4},   {"remove", 1},
                                               {"claim", 2},     {"keep", 1},  {"complete", 1}, {"fail", 2},
                                               {"hand_back", 1}, {"read", 6}};
  for (const auto& [operation, count] : expected) {
    EXPECT_EQ(calls(operation), count) << operation;
    // Only UNAVAILABLE is a failure of the store.
    EXPECT_EQ(failures(operation), operation == "remove" || operation == "claim" ? 1.0 : 0.0) << operation;
  }
}

}  // namespace
}  // namespace glasswing
