#include "server/dispatch/fleet.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "server/jobs/job_store.h"

namespace glasswing {
namespace {

using std::chrono::minutes;
using std::chrono::seconds;
using testing::HasSubstr;

class FleetTest : public testing::Test {
 protected:
  v1::GetFleetResponse describe(const std::vector<RegisteredSolver>& solvers = {},
                                const std::vector<JobState>& jobs = {},
                                const std::vector<LeaseState>& leases = {}) const {
    return fleet_.describe(solvers, jobs, leases, "SQLite");
  }
  static RegisteredSolver registered(const std::string& name, bool up) {
    RegisteredSolver solver;
    solver.node.set_kind(v1::NODE_KIND_SOLVER);
    solver.node.set_name(name);
    solver.node.set_version("0.1.0");
    solver.node.set_build("1a2b3c4d");
    solver.node.set_up(up);
    solver.info.set_host("lab3");
    solver.info.set_threads(8);
    solver.info.set_vectors("AVX2");
    return solver;
  }

  nanoseconds now_ = seconds(1000);
  Fleet fleet_{[this] { return now_; }};
};

TEST_F(FleetTest, TellsWhatRegisteredSolversSaidOfThemselves) {
  const v1::GetFleetResponse fleet = describe({registered("b", false), registered("a", true)});
  ASSERT_EQ(fleet.solvers_size(), 2);
  const v1::FleetSolver& solver = fleet.solvers(0);
  EXPECT_EQ(solver.name(), "a");
  EXPECT_EQ(solver.host(), "lab3");
  EXPECT_EQ(solver.version(), "0.1.0");
  EXPECT_EQ(solver.build(), "1a2b3c4d");
  EXPECT_EQ(solver.threads(), 8);
  EXPECT_EQ(solver.vectors(), "AVX2");
  EXPECT_TRUE(solver.up());
  EXPECT_FALSE(fleet.solvers(1).up());
  EXPECT_EQ(fleet.store(), "SQLite");
}

TEST_F(FleetTest, CountsTilesAndTheRateOfTheLastMinute) {
  // Two a second for 100 s, so two a second in the last minute.
  for (int i = 0; i < 200; ++i) {
    fleet_.completed("a", 0.4);
    now_ += std::chrono::milliseconds(500);
  }
  v1::FleetSolver solver = describe().solvers(0);
  EXPECT_EQ(solver.tiles_done(), 200);
  EXPECT_NEAR(solver.tiles_per_second(), 2.0, 2.0 / 59.0);  // the window's edge is known to a second
  now_ += seconds(61);
  solver = describe().solvers(0);
  EXPECT_EQ(solver.tiles_done(), 200);
  EXPECT_EQ(solver.tiles_per_second(), 0.0);
}

TEST_F(FleetTest, ANewSolversRateIsOfTheTimeSinceItCame) {
  fleet_.claimed("a");
  for (int i = 0; i < 10; ++i) {
    now_ += seconds(1);
    fleet_.completed("a", 1.0);
  }
  EXPECT_DOUBLE_EQ(describe().solvers(0).tiles_per_second(), 1.0);
}

TEST_F(FleetTest, KeepsTheLastErrorAndNamesItsTile) {
  fleet_.failed("a", "vase", 3, "no light");
  fleet_.failed("a", "bowl", 7, std::string(5000, 'x'));
  const v1::FleetSolver solver = describe().solvers(0);
  EXPECT_EQ(solver.tiles_failed(), 2);
  EXPECT_THAT(solver.last_error(), HasSubstr("bowl tile 7: xxx"));
  EXPECT_LT(solver.last_error().size(), 1100u);
}

TEST_F(FleetTest, ARefusedSolverIsSoUntilItClaims) {
  fleet_.refused("a", "it computes gaussian/1, the server gaussian/2");
  EXPECT_EQ(describe().solvers(0).refused(), "it computes gaussian/1, the server gaussian/2");
  fleet_.claimed("a");
  EXPECT_EQ(describe().solvers(0).refused(), "");
}

TEST_F(FleetTest, LeasesAreListedWithTheirSolver) {
  const std::vector<LeaseState> leases{{.id = {.job = 5, .tile = 3, .attempt = 2},
                                        .session = "vase",
                                        .solver = "b",
                                        .own = true,
                                        .seconds = 1.5,
                                        .twice = true},
                                       {.id = {.job = 5, .tile = 4, .attempt = 1},
                                        .session = "vase",
                                        .solver = "b",
                                        .own = true,
                                        .seconds = 0.5,
                                        .twice = false},
                                       {.id = {.job = 6, .tile = 0, .attempt = 1},
                                        .session = "bowl",
                                        .solver = "c",
                                        .own = false,
                                        .seconds = 9.0,
                                        .twice = false}};
  const v1::GetFleetResponse fleet = describe({registered("b", false)}, {}, leases);
  ASSERT_EQ(fleet.solvers_size(), 2);
  const v1::FleetSolver &b = fleet.solvers(0), &c = fleet.solvers(1);
  EXPECT_FALSE(b.up());  // registration overrides a lease
  ASSERT_EQ(b.leases_size(), 2);
  EXPECT_EQ(b.leases(0).session(), "vase");
  EXPECT_EQ(b.leases(0).tile(), 3);
  EXPECT_EQ(b.leases(0).attempt(), 2);
  EXPECT_EQ(b.leases(0).seconds(), 1.5);
  EXPECT_TRUE(b.leases(0).twice());
  EXPECT_FALSE(b.leases(1).twice());
  // Registered with another server, and at work.
  EXPECT_EQ(c.name(), "c");
  EXPECT_TRUE(c.up());
}

TEST_F(FleetTest, SolvesAreInTheStoresOrderWithTheTimeLeft) {
  const std::vector<JobState> jobs{
      {.id = 9,
       .session = "vase",
       .computes = "gaussian/1",
       .server_address = "lab1:7440",
       .own = true,
       .suspended = false,
       .counts = {.tiles = 100, .done = 30, .quarantined = 10, .leased = 4, .failures = 33},
       .tiles_per_second = 1.5},
      {.id = 12,
       .session = "bowl",
       .computes = "ramp/2",
       .server_address = "lab2:7440",
       .own = false,
       .suspended = true,
       .counts = {.tiles = 10},
       .tiles_per_second = 1.0},
      {.id = 13,
       .session = "cup",
       .computes = "alpha/1",
       .server_address = "lab1:7440",
       .own = true,
       .suspended = false,
       .counts = {.tiles = 10},
       .tiles_per_second = 0.0}};
  const v1::GetFleetResponse fleet = describe({}, jobs);
  ASSERT_EQ(fleet.solves_size(), 3);
  const v1::FleetSolve& vase = fleet.solves(0);
  EXPECT_EQ(vase.session(), "vase");
  EXPECT_EQ(vase.server(), "");
  EXPECT_EQ(vase.method(), "gaussian");
  EXPECT_EQ(vase.tile_count(), 100);
  EXPECT_EQ(vase.tiles_done(), 30);
  EXPECT_EQ(vase.tiles_leased(), 4);
  EXPECT_EQ(vase.quarantined(), 10);
  EXPECT_EQ(vase.failures(), 33);
  EXPECT_DOUBLE_EQ(vase.seconds_left(), 40.0);  // (100 - 30 - 10) / 1.5
  EXPECT_EQ(fleet.solves(1).server(), "lab2:7440");
  EXPECT_TRUE(fleet.solves(1).held());
  EXPECT_EQ(fleet.solves(1).seconds_left(), 0.0);  // suspended
  EXPECT_EQ(fleet.solves(2).seconds_left(), 0.0);  // unknown rate
}

TEST_F(FleetTest, SaysWhetherDeadlinesAreMet) {
  fleet_.claimed("a");
  fleet_.claimed("b");  // two solvers
  const auto job = [](std::int64_t id, int left, double due_s) {
    JobState state;
    state.id = id;
    state.session = std::to_string(id);
    state.deadline = absl::Now() + absl::Seconds(due_s);
    state.counts.tiles = left;
    state.tile_seconds = 2.0;
    return state;
  };
  std::vector<JobState> jobs{job(1, 100, 1000.0), job(2, 300, 240.0), job(3, 100, 50.0), job(4, 10, 50.0)};
  jobs[3].deadline = absl::InfiniteFuture();
  jobs.push_back(job(5, 10, 2000.0));
  jobs.back().tile_seconds = 0.0;  // nothing is done yet
  const v1::GetFleetResponse fleet = describe({}, jobs);
  // The earliest first: 100 s, of which 50 are left; then 300 s more.
  EXPECT_NEAR(fleet.solves(2).late_s(), 50.0, 1.0);
  EXPECT_NEAR(fleet.solves(1).late_s(), 160.0, 1.0);
  EXPECT_EQ(fleet.solves(0).late_s(), 0.0);  // 500 s of 1000
  EXPECT_TRUE(fleet.solves(0).has_late_s());
  EXPECT_EQ(fleet.solves(3).deadline(), "");
  EXPECT_FALSE(fleet.solves(3).has_late_s());
  EXPECT_NE(fleet.solves(4).deadline(), "");
  EXPECT_FALSE(fleet.solves(4).has_late_s());
}

TEST_F(FleetTest, WhoHasLeftIsForgotten) {
  for (int i = 0; i < 1000; ++i) fleet_.claimed("job-" + std::to_string(i));
  fleet_.completed("stays", 1.0);
  EXPECT_EQ(describe().solvers_size(), 1001);
  now_ += minutes(9);
  fleet_.completed("stays", 1.0);
  now_ += minutes(1);
  const v1::GetFleetResponse fleet = describe();
  ASSERT_EQ(fleet.solvers_size(), 1);
  EXPECT_EQ(fleet.solvers(0).name(), "stays");
  EXPECT_EQ(fleet.solvers(0).tiles_done(), 2);
  EXPECT_FALSE(fleet.solvers(0).up());  // silent for ten seconds, and without a lease
}

TEST_F(FleetTest, NothingIsNotedUnderWhatIsNoName) {
  for (const std::string& name :
       {std::string(), std::string(100, 'x'), std::string("a b"), std::string("../x")}) {
    fleet_.claimed(name);
    fleet_.refused(name, "why");
    fleet_.completed(name, 1.0);
    fleet_.failed(name, "vase", 1, "why");
  }
  EXPECT_EQ(describe().solvers_size(), 0);
}

TEST_F(FleetTest, ManyThreadsMayTell) {
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 4; ++t) {
      threads.emplace_back([this, t] {
        for (int i = 0; i < 250; ++i) {
          fleet_.completed("solver-" + std::to_string(t % 2), 0.5);
          (void)describe();
        }
      });
    }
  }
  const v1::GetFleetResponse fleet = describe();
  ASSERT_EQ(fleet.solvers_size(), 2);
  EXPECT_EQ(fleet.solvers(0).tiles_done(), 500);
  EXPECT_EQ(fleet.solvers(1).tiles_done(), 500);
}

}  // namespace
}  // namespace glasswing
