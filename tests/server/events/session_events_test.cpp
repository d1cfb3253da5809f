#include "server/events/session_events.h"

#include <gtest/gtest.h>

#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

class Events : public testing::Test {
 protected:
  // The events of the session in this state, as "what: text" each.
  std::vector<std::string> in(v1::SessionState state, const std::string& reason = "") {
    session_.set_state(state);
    session_.set_reason(reason);
    std::vector<std::string> told;
    for (const Event& event : events_.events_of(session_)) {
      EXPECT_EQ(event.session, "vase");
      told.push_back(std::string(event.what) + ": " + event.text);
    }
    return told;
  }
  Events() { session_.set_name("vase"); }

  using List = std::vector<std::string>;
  v1::Session session_;
  SessionEvents events_;
};

TEST_F(Events, EachIsToldOnceWhenItBegins) {
  EXPECT_EQ(in(v1::SESSION_STATE_CAPTURING), List{});
  EXPECT_EQ(in(v1::SESSION_STATE_PAUSED, "camera away"), List{"paused: session vase is paused: camera away"});
  EXPECT_EQ(in(v1::SESSION_STATE_PAUSED, "camera away"), List{});
  EXPECT_EQ(in(v1::SESSION_STATE_CAPTURING), List{});
  EXPECT_EQ(in(v1::SESSION_STATE_PAUSED, "again").size(), 1u);
  EXPECT_EQ(in(v1::SESSION_STATE_SOLVING), List{});
  EXPECT_EQ(in(v1::SESSION_STATE_FAILED, "bad"), List{"needs-operator: session vase failed: bad"});
  EXPECT_EQ(in(v1::SESSION_STATE_SOLVING), List{});
  EXPECT_EQ(in(v1::SESSION_STATE_DONE), List{"session-done: session vase is done"});
}

TEST_F(Events, CapturesThatStallOrLackRoomAreTold) {
  const std::string stalled = std::string(kStalled) + ": why", room = std::string(kWaitsForRoom) + ": 1 GB";
  EXPECT_EQ(in(v1::SESSION_STATE_CAPTURING, stalled), List{"needs-operator: session vase is " + stalled});
  EXPECT_EQ(in(v1::SESSION_STATE_CAPTURING, stalled), List{});
  EXPECT_EQ(in(v1::SESSION_STATE_CAPTURING, room), List{"disk-low: session vase is " + room});
  EXPECT_EQ(in(v1::SESSION_STATE_CAPTURING), List{});
  EXPECT_EQ(in(v1::SESSION_STATE_SOLVING, std::string(kWaitsForServerRoom) + ": 1 GB").size(), 1u);
}

TEST_F(Events, KnocksAndDriftAreToldApart) {
  session_.add_rig_changes()->set_what("everything moved: " + std::string(kTouched));
  EXPECT_EQ(in(v1::SESSION_STATE_CAPTURING),
            List{"knocked: session vase: everything moved: " + std::string(kTouched)});
  session_.add_rig_changes()->set_what("the picture creeps");
  EXPECT_EQ(in(v1::SESSION_STATE_CAPTURING), List{"drift: session vase: the picture creeps"});
  EXPECT_EQ(in(v1::SESSION_STATE_CAPTURING), List{});
}

TEST_F(Events, WhatWasSoBeforeIsNoNews) {
  session_.set_state(v1::SESSION_STATE_DONE);
  events_.know(session_);
  EXPECT_EQ(in(v1::SESSION_STATE_DONE), List{});
}

}  // namespace
}  // namespace glasswing
