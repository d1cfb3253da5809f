// The states of a session and the calls that each allows.
//
//   created -> capturing <-> paused;  capturing -> captured -> solving -> done
//   solving <-> paused;  capturing, solving -> failed -> capturing, solving (retried)
//   done -> solving (solved again; cancelled: done as before);  a cancelled first solve: captured
//   created, capturing, paused -> cancelled
//
// After a restart a session that was capturing is paused (the camera node has its proven frames); one that
// was solving continues.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <string_view>
#include <vector>

#include "glasswing/v1/session.pb.h"

namespace glasswing {

// The beginning of a running capture's or solve's reason while it waits: "waiting for room: " and why.
inline constexpr std::string_view kWaitsForNode = "waiting", kWaitsForRoom = "waiting for room",
                                  kWaitsForServerRoom = "waiting for room on the server's disk",
                                  kWaitsForAnswer = "waiting for an answer",
                                  kWaitsForPicture = "waiting for a picture",
                                  kWaitsForStore = "waiting for the job store";
// The beginning of the reason of a capture that shows pictures but no longer proves anything; the cause
// follows.
inline constexpr std::string_view kStalled = "stalled";
// In RigChange.what after a knock.
inline constexpr std::string_view kTouched = "the camera, the monitor or the table was touched";
// How the reason of a capture begins that waits for a person, who paused it or must move the object.
inline constexpr std::string_view kPausedOnRequest = "paused on request", kPlaceObject = "place the object",
                                  kTakeObject = "take the object";
// The reason of a capture that is being stopped.
inline constexpr std::string_view kPausing = "being paused", kCancelling = "being cancelled";

// "paused"
std::string state_of(const v1::Session& session);

// True if it is the session's solve that is paused or failed, not its capture.
bool rests_in_solve(const v1::Session& session);

// True if the session is paused until a person lets it go on.
bool waits_for_person(const v1::Session& session);

// The actions that the session allows now, in the order of SessionAction. One may still be refused because of
// other activity: the rig is busy, the session is being replicated or deleted, a node does not answer.
std::vector<v1::SessionAction> allowed_actions(const v1::Session& session);
bool allows(const v1::Session& session, v1::SessionAction action);
// Every step of its capture has a proven frame.
bool is_wholly_proven(const v1::Session& session);
// True if the session is already in the requested state: a repeated call is not an error.
bool is_already(const v1::Session& session, v1::SessionAction action);
// FAILED_PRECONDITION: "session "vase" is paused; it cannot be ...". ResumeSession requests RESUME, which
// here includes RETRY.
absl::Status check_allows(const v1::Session& session, v1::SessionAction action);
// FAILED_PRECONDITION: "session "vase" is paused; it cannot be " and `verb`.
absl::Status not_now(const v1::Session& session, const std::string& verb);

// The session as clients see it: with its allowed actions.
v1::Session with_allowed_actions(v1::Session session);

}  // namespace glasswing
