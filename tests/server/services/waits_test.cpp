// What each kind of work waits for, and the words that say so.
#include "server/services/waits.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

using testing::HasSubstr;

constexpr char kSince[] = "2026-11-01T12:00:00Z";

v1::Session session(v1::SessionState state, const std::string& reason = "") {
  v1::Session session;
  session.set_name("vase");
  session.set_state(state);
  session.set_reason(reason);
  session.set_archive_address("lab:7443");
  return session;
}

v1::Node node(v1::NodeKind kind, const std::string& name, bool up) {
  v1::Node node;
  node.set_kind(kind);
  node.set_name(name);
  node.set_up(up);
  if (kind == v1::NODE_KIND_CAMERA) node.set_address("lab:7443");
  if (!up) node.set_away_since(kSince);
  return node;
}

v1::FleetSolver& add_solver(v1::GetFleetResponse& fleet, bool up, const std::string& refused = "") {
  v1::FleetSolver& solver = *fleet.add_solvers();
  solver.set_up(up);
  solver.set_refused(refused);
  return solver;
}

v1::FleetSolve& add_solve(v1::GetFleetResponse& fleet, const std::string& name, int leased) {
  v1::FleetSolve& solve = *fleet.add_solves();
  solve.set_session(name);
  solve.set_tiles_leased(leased);
  return solve;
}

// A rig where all is well: a solver is at work on the session.
Surroundings all_well() {
  Surroundings around;
  around.nodes = {node(v1::NODE_KIND_DISPLAY, "display-1", true),
                  node(v1::NODE_KIND_CAMERA, "camera-1", true)};
  v1::GetFleetResponse fleet;
  add_solver(fleet, true);
  add_solve(fleet, "vase", 1);
  around.fleet = fleet;
  return around;
}

// The same, but no solver has begun yet.
Surroundings not_begun() {
  Surroundings around = all_well();
  around.fleet->mutable_solves(0)->set_tiles_leased(0);
  return around;
}

TEST(Waits, NothingKeepsWorkThatGoesOnOrIsDone) {
  for (int state = v1::SESSION_STATE_CREATED; v1::SessionState_IsValid(state); ++state)
    EXPECT_FALSE(waiting_of(session(static_cast<v1::SessionState>(state)), all_well())) << state;
}

TEST(Waits, AStalledCaptureSaysWhyHowOftenAndWhatToDo) {
  v1::Session stalled = session(v1::SESSION_STATE_CAPTURING, "stalled: frame too late");
  stalled.mutable_waiting()->set_since(kSince);
  std::optional<v1::Waiting> waiting = waiting_of(stalled, all_well());
  ASSERT_TRUE(waiting);
  EXPECT_EQ(waiting->what(), "no step is being proven (frame too late)");
  EXPECT_EQ(waiting->since(), kSince);
  EXPECT_THAT(waiting->advice(),
              testing::StartsWith("frames arrive faster than the camera node stores them"));
  v1::RetakeCount& count = *stalled.add_retakes();
  count.set_cause(v1::RETAKE_CAUSE_TOO_LATE);
  count.set_count(2029);
  waiting = waiting_of(stalled, all_well());
  EXPECT_EQ(waiting->what(), "no step is being proven (frame too late)");  // the same words while it lasts
  EXPECT_THAT(waiting->advice(), testing::StartsWith("2029 steps were shown again for this; frames arrive"));
}

TEST(Waits, ASolveWithoutASolverSaysHowToStartOne) {
  Surroundings around = not_begun();
  around.fleet->clear_solvers();
  EXPECT_EQ(waiting_of(session(v1::SESSION_STATE_SOLVING), around)->since(), "");  // none was ever heard
  add_solver(*around.fleet, false);
  around.fleet->set_solver_heard(kSince);
  const auto waiting = waiting_of(session(v1::SESSION_STATE_SOLVING), around);
  EXPECT_EQ(waiting->what(), "no solver is running");
  EXPECT_EQ(waiting->since(), kSince);
  EXPECT_THAT(waiting->advice(), HasSubstr("glasswing-solver --server"));
  around.fleet->mutable_solves(0)->set_tiles_leased(1);  // it works, though the machine is too busy to say so
  EXPECT_FALSE(waiting_of(session(v1::SESSION_STATE_SOLVING), around));
}

TEST(Waits, SolversThatAreRefusedAreNoSolvers) {
  Surroundings around = not_begun();
  around.fleet->clear_solvers();
  add_solver(*around.fleet, true, "solver \"s1\" is Glasswing 0.0.9");
  EXPECT_THAT(waiting_of(session(v1::SESSION_STATE_SOLVING), around)->what(), HasSubstr("0.0.9"));
  add_solver(*around.fleet, true);
  EXPECT_FALSE(waiting_of(session(v1::SESSION_STATE_SOLVING), around));
}

TEST(Waits, ASolveInTheQueueNamesTheSessionThatSolversWorkOn) {
  Surroundings around = all_well();
  around.fleet->clear_solves();
  add_solve(*around.fleet, "paused", 1).set_held(true);
  add_solve(*around.fleet, "dish", 2);
  v1::FleetSolve& own = add_solve(*around.fleet, "vase", 0);
  EXPECT_EQ(waiting_of(session(v1::SESSION_STATE_SOLVING), around)->what(),
            "the solvers work on session \"dish\" first");
  own.set_tiles_leased(1);
  EXPECT_FALSE(waiting_of(session(v1::SESSION_STATE_SOLVING), around));
  own.set_tiles_leased(0);
  own.set_server("other:7440");  // another server's session of this name
  EXPECT_FALSE(waiting_of(session(v1::SESSION_STATE_SOLVING), around));
}

TEST(Waits, FramesOnANodeThatIsAwayKeepASolveUnlessThereIsACopy) {
  Surroundings around = all_well();
  around.nodes = {node(v1::NODE_KIND_CAMERA, "camera-1", false), node(v1::NODE_KIND_SOLVER, "keeper", true)};
  v1::Session solving = session(v1::SESSION_STATE_SOLVING);
  const auto waiting = waiting_of(solving, around);
  EXPECT_EQ(waiting->what(), "camera node \"camera-1\" at lab:7443 is away, and with it the frames");
  EXPECT_EQ(waiting->since(), kSince);
  v1::ArchiveCopy& copy = *solving.add_copies();
  copy.set_node("keeper");
  EXPECT_TRUE(waiting_of(solving, around));  // a part of a copy
  copy.set_address("keeper:7445");
  EXPECT_FALSE(waiting_of(solving, around));
}

TEST(Waits, AJobStoreThatIsAwayIsTold) {
  Surroundings around = all_well();
  around.fleet = absl::UnavailableError("PostgreSQL at db.lab: connection refused");
  around.store_away_since = kSince;
  const auto waiting = waiting_of(session(v1::SESSION_STATE_SOLVING), around);
  EXPECT_THAT(waiting->what(), HasSubstr("PostgreSQL at db.lab"));
  EXPECT_EQ(waiting->since(), kSince);
}

TEST(Waits, ATileThatCouldNotBeSolvedIsTold) {
  v1::Session solving = session(v1::SESSION_STATE_SOLVING);
  v1::QuarantinedTile& tile = *solving.add_quarantined();
  tile.set_tile(5);
  tile.set_error("frame 7 is damaged");
  const auto waiting = waiting_of(solving, all_well());
  EXPECT_EQ(waiting->what(), "tile 5 could not be solved: frame 7 is damaged");
  EXPECT_THAT(waiting->advice(), HasSubstr("glasswing retry vase"));
}

TEST(Waits, ACaptureTellsWhatItsCameraPrepares) {
  Surroundings around = all_well();
  v1::Preparation& preparation = *around.nodes[1].mutable_preparation();
  preparation.set_what("simulating the scene");
  preparation.set_done(0.379);
  const auto waiting = waiting_of(session(v1::SESSION_STATE_CAPTURING), around);
  EXPECT_EQ(waiting->what(), "camera node \"camera-1\" is not ready: simulating the scene, 37 %");
  EXPECT_THAT(waiting->advice(), HasSubstr("by itself"));
  EXPECT_FALSE(waiting_of(session(v1::SESSION_STATE_SOLVING), around));
  preparation.set_done(0.9999);
  EXPECT_THAT(waiting_of(session(v1::SESSION_STATE_CAPTURING), around)->what(), HasSubstr("99 %"));
  around.nodes[1].set_address("lab:7450");  // another camera
  EXPECT_FALSE(waiting_of(session(v1::SESSION_STATE_CAPTURING), around));
}

TEST(Waits, APausedCaptureTellsWhatWouldRefuseToResumeIt) {
  Surroundings around = all_well();
  around.holder.emplace();
  around.holder->set_what("session dish");
  around.holder->set_client("anna@lab3");
  around.holder->set_since(kSince);
  v1::Session paused = session(v1::SESSION_STATE_PAUSED, "paused on request");
  EXPECT_EQ(waiting_of(paused, around)->what(), "the rig is in use: session dish, by anna@lab3");
  EXPECT_EQ(waiting_of(paused, around)->since(), kSince);
  around.nodes[0] = node(v1::NODE_KIND_DISPLAY, "display-1", false);
  EXPECT_EQ(waiting_of(paused, around)->what(), "display node \"display-1\" is away");
  paused.set_job(7);  // its solve is paused: it needs no rig
  EXPECT_FALSE(waiting_of(paused, around));
}

TEST(Waits, WhatACaptureOrSolveSaysOfItselfIsTakenOver) {
  v1::Session capturing = session(v1::SESSION_STATE_CAPTURING, "waiting: camera-1 does not answer");
  capturing.mutable_waiting()->set_since(kSince);
  EXPECT_EQ(waiting_of(capturing, all_well())->what(), "camera-1 does not answer");
  EXPECT_EQ(waiting_of(capturing, all_well())->since(), kSince);
  EXPECT_EQ(waiting_of(capturing, all_well())->advice().substr(0, 14), "start it again");
  capturing.set_reason("waiting for an answer: the camera node takes long to start the camera");
  EXPECT_EQ(waiting_of(capturing, all_well())->what(), "the camera node takes long to start the camera");
  EXPECT_EQ(waiting_of(capturing, all_well())->advice(), "it is at work; the capture then goes on by itself");
  capturing.set_reason("waiting for room: camera-1 has 3 MB");
  EXPECT_EQ(waiting_of(capturing, all_well())->what(), "the camera node's disk is full: camera-1 has 3 MB");
  EXPECT_EQ(waiting_of(session(v1::SESSION_STATE_SOLVING, "waiting for the job store: refused"), all_well())
                ->what(),
            "the job store does not answer: refused");
}

TEST(Waits, AServerTellsWhatItsSessionsWaitFor) {
  const TemporaryDirectory data;
  {
    const std::unique_ptr<Server> server = Server::open({.data = data}).value();
    Waits waits(*server);
    EXPECT_EQ(waits.told(session(v1::SESSION_STATE_SOLVING)).waiting().what(), "no solver is running");
    v1::Session done = session(v1::SESSION_STATE_DONE);
    done.mutable_waiting()->set_since(kSince);  // as a live view may have it
    EXPECT_FALSE(waits.told(done).has_waiting());
    SessionStore::Edit edit = server->sessions().edit();
    ASSERT_OK(edit.insert(session(v1::SESSION_STATE_CAPTURING), ""));
    edit.show(session(v1::SESSION_STATE_CAPTURING, "waiting: camera-1 does not answer"));
    const std::string since = edit.find("vase")->waiting().since();
    EXPECT_FALSE(since.empty());
    edit.show(*edit.find("vase"));
    EXPECT_EQ(edit.find("vase")->waiting().since(), since);  // its reason is the same
    edit.show(session(v1::SESSION_STATE_CAPTURING));
    EXPECT_FALSE(edit.find("vase")->has_waiting());
  }
}

}  // namespace
}  // namespace glasswing
