// Each state and each action, against a truth table written by hand.
#include "server/sessions/session_state.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace glasswing {
namespace {

constexpr v1::SessionAction kActions[] = {
    v1::SESSION_ACTION_PAUSE,     v1::SESSION_ACTION_RESUME, v1::SESSION_ACTION_RETRY,
    v1::SESSION_ACTION_CANCEL,    v1::SESSION_ACTION_SOLVE,  v1::SESSION_ACTION_FETCH,
    v1::SESSION_ACTION_REPLICATE, v1::SESSION_ACTION_DELETE, v1::SESSION_ACTION_RETAKE,
};

v1::Session captured_by_plan(v1::SessionState state) {
  v1::Session session;
  session.set_name("vase");
  session.set_state(state);
  session.mutable_plan()->set_method("gaussian");
  return session;
}

v1::Session in_solve(v1::SessionState state) {
  v1::Session session = captured_by_plan(state);
  session.set_job(7);
  return session;
}

v1::Session with_matte(v1::Session session) {
  session.set_matte_ready(true);
  return session;
}

v1::Session with_frame(v1::Session session) {
  session.add_solved_frames(3);
  return session;
}

v1::Session imported(v1::Session session) {
  session.clear_plan();
  return session;
}

v1::Session calibration(v1::Session session) {
  session.mutable_plan()->mutable_calibration()->set_of("camera");
  return session;
}

v1::Session with_copy(v1::Session session) {
  session.add_copies()->set_node("store-1");
  return session;
}

v1::Session video(v1::Session session) {
  session.mutable_plan()->set_method("ramp");
  session.mutable_plan()->mutable_ramp()->set_frames(10);
  return session;
}

v1::Session because(std::string_view reason, v1::Session session) {
  session.set_reason(std::string(reason));
  return session;
}

struct Row {
  const char* name;
  v1::Session session;
  // A letter for each action that is allowed, in the order of kActions: pause, resume, retry, cancel, solve,
  // fetch, replicate, delete, retake; '.' where it is not.
  const char* allowed;
};

std::vector<Row> truth_table() {
  return {
      {"created", captured_by_plan(v1::SESSION_STATE_CREATED), "...C....."},
      {"being imported", imported(captured_by_plan(v1::SESSION_STATE_CREATED)), "...C...D."},
      {"capturing", captured_by_plan(v1::SESSION_STATE_CAPTURING), "P..C....A"},
      {"capturing a calibration", calibration(captured_by_plan(v1::SESSION_STATE_CAPTURING)), "P..C....A"},
      {"stalled", because("stalled: no frame", captured_by_plan(v1::SESSION_STATE_CAPTURING)), "P..C....A"},
      {"being paused", because(kPausing, captured_by_plan(v1::SESSION_STATE_CAPTURING)), "...C....A"},
      {"being cancelled", because(kCancelling, captured_by_plan(v1::SESSION_STATE_CAPTURING)), "........."},
      {"capture paused", captured_by_plan(v1::SESSION_STATE_PAUSED), ".R.C...DA"},
      {"paused without a plan", imported(captured_by_plan(v1::SESSION_STATE_PAUSED)), "...C...D."},
      {"solve paused", in_solve(v1::SESSION_STATE_PAUSED), ".R.CS.MD."},
      {"solve of an import paused", imported(in_solve(v1::SESSION_STATE_PAUSED)), ".R.CS.MD."},
      {"solve paused, with a matte", with_matte(in_solve(v1::SESSION_STATE_PAUSED)), ".R.CSFMD."},
      {"solve paused, with a frame", with_frame(in_solve(v1::SESSION_STATE_PAUSED)), ".R.CSFMD."},
      {"captured", captured_by_plan(v1::SESSION_STATE_CAPTURED), "....S.MDA"},
      {"imported", imported(captured_by_plan(v1::SESSION_STATE_CAPTURED)), "....S.MD."},
      {"calibration captured", calibration(captured_by_plan(v1::SESSION_STATE_CAPTURED)), "......MDA"},
      {"solving", in_solve(v1::SESSION_STATE_SOLVING), "P..C..M.."},
      {"solving again", with_matte(in_solve(v1::SESSION_STATE_SOLVING)), "P..C.FM.."},
      {"solving, with a frame", with_frame(in_solve(v1::SESSION_STATE_SOLVING)), "P..C.FM.."},
      {"done", with_matte(in_solve(v1::SESSION_STATE_DONE)), "....SFMD."},
      {"import done", imported(with_matte(in_solve(v1::SESSION_STATE_DONE))), "....SFMD."},
      {"capture failed", captured_by_plan(v1::SESSION_STATE_FAILED), "..T....DA"},
      {"failed without a plan", imported(captured_by_plan(v1::SESSION_STATE_FAILED)), ".......D."},
      {"solve failed", in_solve(v1::SESSION_STATE_FAILED), "..T.S.MD."},
      {"solve failed, with a frame", with_frame(in_solve(v1::SESSION_STATE_FAILED)), "..T.SFMD."},
      {"solve failed, with a matte", with_matte(in_solve(v1::SESSION_STATE_FAILED)), "..TCSFMD."},
      {"captured, copied", with_copy(captured_by_plan(v1::SESSION_STATE_CAPTURED)), "....S.MD."},
      {"video captured", video(captured_by_plan(v1::SESSION_STATE_CAPTURED)), "....S.MD."},
      {"cancelled", captured_by_plan(v1::SESSION_STATE_CANCELLED), ".......D."},
      {"damaged", captured_by_plan(v1::SESSION_STATE_DAMAGED), "........."},
      {"unknown", captured_by_plan(v1::SESSION_STATE_UNSPECIFIED), "........."},
  };
}

TEST(SessionState, AllowsWhatTheTruthTableSays) {
  for (const Row& row : truth_table()) {
    std::string allowed;
    for (size_t i = 0; i < std::size(kActions); ++i)
      allowed += allows(row.session, kActions[i]) ? "PRTCSFMDA"[i] : '.';
    EXPECT_EQ(allowed, row.allowed) << row.name;
  }
}

TEST(SessionState, TheTruthTableKnowsEveryStateAndAction) {
  for (int state = 0; v1::SessionState_IsValid(state); ++state) {
    EXPECT_TRUE(std::ranges::any_of(truth_table(), [&](const Row& row) {
      return row.session.state() == state;
    })) << v1::SessionState_Name(state);
  }
  for (int action = 1; v1::SessionAction_IsValid(action); ++action)
    EXPECT_EQ(std::ranges::count(kActions, action), 1) << v1::SessionAction_Name(action);
}

TEST(SessionState, ListsAllowedActionsInOrderOnceEach) {
  for (const Row& row : truth_table()) {
    const std::vector<v1::SessionAction> actions = allowed_actions(row.session);
    for (size_t i = 1; i < actions.size(); ++i) EXPECT_LT(actions[i - 1], actions[i]) << row.name;
    v1::Session stale = row.session;
    stale.add_allowed_actions(v1::SESSION_ACTION_FETCH);
    const v1::Session answered = with_allowed_actions(stale);
    EXPECT_TRUE(std::ranges::equal(answered.allowed_actions(), actions)) << row.name;
  }
}

TEST(SessionState, RefusesWhatIsNotAllowedWithTheState) {
  for (const Row& row : truth_table()) {
    if (row.session.state() == v1::SESSION_STATE_UNSPECIFIED) continue;
    for (const v1::SessionAction action : kActions) {
      const bool resumes =
          action == v1::SESSION_ACTION_RESUME && allows(row.session, v1::SESSION_ACTION_RETRY);
      const absl::Status status = check_allows(row.session, action);
      EXPECT_EQ(status.ok(), resumes || allows(row.session, action)) << row.name;
      if (status.ok()) continue;
      EXPECT_TRUE(absl::IsFailedPrecondition(status)) << row.name;
      EXPECT_NE(status.message().find("session \"vase\" is "), std::string::npos) << status.message();
    }
  }
  const absl::Status deleted =
      check_allows(captured_by_plan(v1::SESSION_STATE_CAPTURING), v1::SESSION_ACTION_DELETE);
  EXPECT_EQ(deleted.message(),
            "session \"vase\" is capturing; wait for it, or cancel it first: glasswing cancel vase");
  const absl::Status paused =
      check_allows(captured_by_plan(v1::SESSION_STATE_CAPTURED), v1::SESSION_ACTION_PAUSE);
  EXPECT_EQ(paused.message(), "session \"vase\" is captured; it cannot be paused");
}

TEST(SessionState, AskingForWhatAlreadyIsSoIsNoError) {
  const std::set<std::pair<int, int>> already = {
      {v1::SESSION_STATE_PAUSED, v1::SESSION_ACTION_PAUSE},
      {v1::SESSION_STATE_CAPTURING, v1::SESSION_ACTION_RESUME},
      {v1::SESSION_STATE_SOLVING, v1::SESSION_ACTION_RESUME},
      {v1::SESSION_STATE_CAPTURING, v1::SESSION_ACTION_RETRY},
      {v1::SESSION_STATE_SOLVING, v1::SESSION_ACTION_RETRY},
      {v1::SESSION_STATE_CANCELLED, v1::SESSION_ACTION_CANCEL},
  };
  for (int state = 0; v1::SessionState_IsValid(state); ++state) {
    for (const v1::SessionAction action : kActions) {
      EXPECT_EQ(is_already(captured_by_plan(static_cast<v1::SessionState>(state)), action),
                already.contains({state, action}))
          << v1::SessionState_Name(state) << ", " << v1::SessionAction_Name(action);
    }
  }
}

}  // namespace
}  // namespace glasswing
