// Sessions in words.
#pragma once

#include <cstdint>
#include <string>

#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

// "paused"
std::string state_name(v1::SessionState state);

// True if the server would accept this call now.
bool allows(const v1::Session& session, v1::SessionAction action);

// Progress of the solve: "3 of 40 tiles".
std::string tiles_text(const v1::Session& session);

// What the session is waiting for, in the server's words: "no solver is running, since 2026-01-31T12:00:00Z;
// start one: ...". Empty: for nothing.
std::string waiting_text(const v1::Session& session);

// One line: "session vase is captured: 311 steps (2 retaken) in 10.4 s, 1260 frames taken".
std::string summary_of(const v1::Session& session);

// Prints the session as JSON or as its summary.
void print_session(const v1::Session& session, bool json);

// True for sessions that are solved frame by frame.
bool is_video(const v1::Session& session);
int frames_to_solve(const v1::Session& session);  // for a video: the captured ones

// Formats ascending numbers: "3, 17 to 20".
std::string ranges_text(const google::protobuf::RepeatedField<std::int32_t>& numbers);
std::string ranges_text(const google::protobuf::RepeatedPtrField<v1::StepRange>& steps);
// What happened to the rig, when, and what to do.
std::string describe(const v1::RigChange& change);

}  // namespace glasswing
