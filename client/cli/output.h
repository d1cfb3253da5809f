// Writes answers to standard output, and says why a file was not written.
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/message.h>

#include <cstdint>
#include <string>
#include <vector>

#include "client/cli/client.h"
#include "core/cli/amount.h"
#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

// Protobuf's JSON mapping, with the field names of the .proto files; fields with default values are included.
void print_json(const google::protobuf::Message& message);

struct Column {
  std::string title;   // "NAME"
  bool right = false;  // right-aligned, for numbers
};
// Prints aligned columns under their titles; with --tsv tab-separated values with a header row (tabs and line
// breaks within a cell become spaces). Each row has one cell per column. The column STATE is coloured.
// Commands write their JSON themselves.
void print_table(const Client& client, const std::vector<Column>& columns,
                 const std::vector<std::vector<std::string>>& rows);

// "paused"
std::string state_name(v1::SessionState state);

// True if the server would accept this call now.
bool allows(const v1::Session& session, v1::SessionAction action);

// ", 189 not solved"; empty: none.
std::string unsolved_text(std::int64_t pixels);

// Progress of the solve: "3 of 40 tiles".
std::string tiles_text(const v1::Session& session);

// What the session waits for, in the server's words: "no solver is running, since 2026-01-31T12:00:00Z;
// start one: ...". Empty: for nothing.
std::string waiting_text(const v1::Session& session);

// One line: "session vase is captured: 311 steps (2 retaken) in 10.4 s, 1260 frames taken".
std::string summary_of(const v1::Session& session);

// Prints the session as JSON or as its summary.
void print_session(const v1::Session& session, bool json);

// True for sessions that are solved frame by frame.
bool is_video(const v1::Session& session);
int frames_to_solve(const v1::Session& session);  // of a video: the captured ones

// Formats ascending numbers: "3, 17 to 20".
std::string ranges_text(const google::protobuf::RepeatedField<std::int32_t>& numbers);
std::string ranges_text(const google::protobuf::RepeatedPtrField<v1::StepRange>& steps);
// What happened to the rig, when, and what to do.
std::string describe(const v1::RigChange& change);

// UNAVAILABLE. `output` is a path, or "-" for standard output.
absl::Status cannot_write(const std::string& output);

// "9.2 s", "3 min 20 s"
std::string seconds_text(double seconds);

}  // namespace glasswing
