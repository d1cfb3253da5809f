// glasswing fleet against a fake server.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "core/service/service.h"
#include "glasswing/v1/fleet_service.grpc.pb.h"
#include "tests/client/run_glasswing.h"

namespace glasswing {
namespace {

using testing::HasSubstr;
using testing::Not;

class FleetCommand : public testing::Test {
 protected:
  struct Fleet : v1::FleetService::Service {
    v1::GetFleetResponse fleet;
    grpc::Status GetFleet(grpc::ServerContext*, const v1::GetFleetRequest*,
                          v1::GetFleetResponse* response) override {
      *response = fleet;
      return grpc::Status::OK;
    }
  };
  FleetCommand() : host_(ServiceHost::start({}, {&service_}).value()) { fleet().set_store("SQLite"); }

  v1::GetFleetResponse& fleet() { return service_.fleet; }
  Outcome run(std::vector<std::string> options = {}) const {
    options.insert(options.begin(), {"fleet", "--server", host_->address()});
    return run_glasswing(options);
  }
  void add_three_solvers() {
    v1::FleetSolver& busy = *fleet().add_solvers();
    busy.set_name("lab1-1");
    busy.set_host("lab1");
    busy.set_up(true);
    busy.set_tiles_done(41);
    busy.set_tiles_failed(2);
    busy.set_tiles_per_second(1.25);
    busy.set_last_error("vase tile 9: no light");
    for (const int tile : {12, 13}) {
      v1::FleetLease& lease = *busy.add_leases();
      lease.set_session("vase");
      lease.set_tile(tile);
      lease.set_seconds(tile == 12 ? 2.5 : 0.5);
      lease.set_twice(tile == 13);
    }
    v1::FleetSolver& away = *fleet().add_solvers();
    away.set_name("lab2-1");
    v1::FleetSolver& refused = *fleet().add_solvers();
    refused.set_name("lab3-1");
    refused.set_up(true);
    refused.set_refused("it computes gaussian/1, the server gaussian/2");
  }
  void add_two_solves() {
    v1::FleetSolve& vase = *fleet().add_solves();
    vase.set_session("vase");
    vase.set_method("gaussian");
    vase.set_tile_count(100);
    vase.set_tiles_done(40);
    vase.set_tiles_leased(2);
    vase.set_failures(3);
    vase.set_quarantined(1);
    vase.set_tiles_per_second(1.25);
    vase.set_seconds_left(47.2);
    vase.set_deadline("2026-11-01T20:00:00Z");
    vase.set_late_s(237.0);
    v1::FleetSolve& bowl = *fleet().add_solves();
    bowl.set_session("bowl");
    bowl.set_method("ramp");
    bowl.set_server("lab9:7440");
    bowl.set_held(true);
    bowl.set_tile_count(5);
    fleet().add_solves()->set_session("cup");
  }

  Fleet service_;
  const std::unique_ptr<ServiceHost> host_;
};

TEST_F(FleetCommand, SaysThatThereAreNoSolversAndNoWork) {
  const Outcome outcome = run();
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("0 of 0 solvers up, 0.00 tiles/s; jobs are in SQLite\n"));
  EXPECT_THAT(outcome.out,
              HasSubstr("no solvers; start some with: glasswing-solver --server " + host_->address()));
  EXPECT_THAT(outcome.out, HasSubstr("no work; start some with: glasswing solve SESSION\n"));
}

TEST_F(FleetCommand, ListsSolversAndSolves) {
  add_three_solvers();
  add_two_solves();
  const Outcome outcome = run();
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  for (const char* words :
       {"2 of 3 solvers up, 1.25 tiles/s", "vase tile 12, vase tile 13 (twice)", "2.5 s",
        "vase tile 9: no light", "away", "refused", "it computes gaussian/1, the server gaussian/2", "40/100",
        "50 s", "late by 4 min", "held", "surveying", "lab9:7440", "this one"}) {
    EXPECT_THAT(outcome.out, HasSubstr(words));
  }
  EXPECT_THAT(outcome.out, Not(HasSubstr("no work")));
  EXPECT_THAT(outcome.out, Not(HasSubstr("\x1b")));
}

TEST_F(FleetCommand, ColoursWhoIsAwayOrRefused) {
  add_three_solvers();
  const Outcome outcome = run({"--color", "always"});
  EXPECT_THAT(outcome.out, HasSubstr("\x1b[31maway\x1b[m"));
  EXPECT_THAT(outcome.out, HasSubstr("\x1b[31mrefused\x1b[m"));
  EXPECT_THAT(outcome.out, HasSubstr("\x1b[32mup\x1b[m"));
}

TEST_F(FleetCommand, GivesBothListsToScripts) {
  add_three_solvers();
  add_two_solves();
  const std::string tsv = run({"--tsv"}).out;
  const size_t gap = tsv.find("\n\n");
  ASSERT_NE(gap, std::string::npos) << tsv;
  EXPECT_TRUE(tsv.starts_with("SOLVER\tHOST\tSTATE\t")) << tsv;
  EXPECT_TRUE(tsv.substr(gap + 2).starts_with("SESSION\tSTATE\t")) << tsv;
  EXPECT_EQ(std::ranges::count(tsv, '\n'), 1 + 3 + 1 + 1 + 3);
  const nlohmann::json json = nlohmann::json::parse(run({"--json"}).out);
  EXPECT_EQ(json["store"], "SQLite");
  EXPECT_EQ(json["solvers"].size(), 3u);
  EXPECT_EQ(json["solvers"][0]["leases"][1]["twice"], true);
  EXPECT_EQ(json["solves"][0]["seconds_left"], 47.2);
  EXPECT_EQ(json["solves"][1]["held"], true);
}

TEST_F(FleetCommand, ListsNothingButTitlesToScriptsWhereThereIsNothing) {
  EXPECT_EQ(std::ranges::count(run({"--tsv"}).out, '\n'), 3);
}

TEST_F(FleetCommand, WatchesOnATerminalOnly) {
  expect_one_line_error(run({"--watch"}), "--watch draws on a terminal");
  expect_one_line_error(run({"--watch", "--json"}), "--json");
  expect_one_line_error(run_glasswing({"fleet", "--server", "127.0.0.1:1"}),
                        "server at 127.0.0.1:1 does not answer; start glasswing-server there");
}

}  // namespace
}  // namespace glasswing
