// How answers are written to standard output.
#pragma once

#include <google/protobuf/message.h>

#include <string>

#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

// protobuf's JSON mapping, with the field names of the .proto files and every plain field present.
void print_json(const google::protobuf::Message& message);

// "paused"
std::string state_name(v1::SessionState state);

// One line: "session vase is captured: 311 steps (2 retaken) in 10.4 s, 1260 frames taken".
std::string summary_of(const v1::Session& session);

// The session as JSON or as its summary.
void print_session(const v1::Session& session, bool json);

// "9.2 s", "3 min 20 s"; "22.9 MB"
std::string seconds_text(double seconds);
std::string bytes_text(double bytes);

}  // namespace glasswing
