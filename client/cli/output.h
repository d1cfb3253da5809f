// How answers are written to standard output.
#pragma once

#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "client/cli/client.h"
#include "core/cli/amount.h"
#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

// protobuf's JSON mapping, with the field names of the .proto files and every plain field present.
void print_json(const google::protobuf::Message& message);

struct Column {
  std::string title;   // "NAME"
  bool right = false;  // numbers
};
// A list: columns in line under their titles; with --tsv a line of titles and one a row, a tab between cells
// (tabs and line breaks within a cell become spaces). A row has a cell a column. What stands under STATE is
// coloured. JSON is each command's own.
void print_table(const Client& client, const std::vector<Column>& columns,
                 const std::vector<std::vector<std::string>>& rows);

// "paused"
std::string state_name(v1::SessionState state);

// How far its solve came: "3 of 40 tiles".
std::string tiles_text(const v1::Session& session);

// One line: "session vase is captured: 311 steps (2 retaken) in 10.4 s, 1260 frames taken".
std::string summary_of(const v1::Session& session);

// The session as JSON or as its summary.
void print_session(const v1::Session& session, bool json);

// Solved frame by frame.
bool is_video(const v1::Session& session);
int frames_to_solve(const v1::Session& session);  // of a video: those that were captured

// Of rising numbers: "3, 17 to 20".
std::string ranges_text(const google::protobuf::RepeatedField<std::int32_t>& numbers);

// "9.2 s", "3 min 20 s"
std::string seconds_text(double seconds);

}  // namespace glasswing
