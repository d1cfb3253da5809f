#include "client/cli/output.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>

#include "client/cli/colour.h"
#include "core/base/utf8.h"
#include "core/pattern/plan.h"

namespace glasswing {
namespace {

// "300 frames, 7 of them lost"
std::string video_text(const v1::Session& session) {
  const int lost = session.lost_frames_size();
  return fmt::format("{} frames{}", session.frame_count(),
                     lost > 0 ? fmt::format(", {} of them lost", lost) : "");
}

// "gaussian", "gaussian (images=100, modes=2)"
std::string method_text(const v1::Session& session) {
  std::map<std::string, std::string> sorted(session.options().begin(), session.options().end());
  std::string options;
  for (const auto& [name, value] : sorted) options += (options.empty() ? "" : ", ") + name + "=" + value;
  return session.method() + (options.empty() ? "" : " (" + options + ")");
}

// Characters of a UTF-8 text: all bytes but continuation bytes.
size_t width_of(const std::string& text) {
  return static_cast<size_t>(std::ranges::count_if(text, [](char byte) { return (byte & 0xC0) != 0x80; }));
}

void print_tab_separated(const std::vector<std::string>& cells) {
  for (size_t c = 0; c < cells.size(); ++c) {
    std::string cell = cells[c];
    std::ranges::replace_if(
        cell, [](char byte) { return byte == '\t' || byte == '\n' || byte == '\r'; }, ' ');
    std::cout << (c > 0 ? "\t" : "") << cell;
  }
  std::cout << "\n";
}

void print_aligned(const std::vector<Column>& columns, const std::vector<size_t>& widths,
                   const std::vector<std::string>& cells, bool coloured) {
  std::string line;
  for (size_t c = 0; c < cells.size(); ++c) {
    const std::string room(widths[c] - width_of(cells[c]), ' ');
    const std::string cell =
        painted(cells[c], coloured && columns[c].title == "STATE" ? paint_of(cells[c]) : Paint::kNone);
    line += (c > 0 ? "  " : "") + (columns[c].right ? room + cell : cell + room);
  }
  line.erase(line.find_last_not_of(' ') + 1);
  std::cout << line << "\n";
}

}  // namespace

void print_json(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string json;
  // Fails only for invalid Any or Timestamp values, which our messages do not have.
  (void)google::protobuf::util::MessageToJsonString(message, &json, options);
  std::cout << json;
}

void print_table(const Client& client, const std::vector<Column>& columns,
                 const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::vector<std::string>> lines(1);
  for (const Column& column : columns) lines[0].push_back(column.title);
  lines.insert(lines.end(), rows.begin(), rows.end());
  if (!client.tsv) {
    for (std::vector<std::string>& line : lines) std::ranges::transform(line, line.begin(), printable);
  }
  std::vector<size_t> widths(columns.size(), 0);
  for (const auto& line : lines) {
    for (size_t c = 0; c < widths.size(); ++c) widths[c] = std::max(widths[c], width_of(line[c]));
  }
  for (const auto& line : lines) {
    if (client.tsv) {
      print_tab_separated(line);
    } else {
      print_aligned(columns, widths, line, client.coloured);
    }
  }
}

std::string state_name(v1::SessionState state) {
  switch (state) {
    case v1::SESSION_STATE_CREATED:
      return "created";
    case v1::SESSION_STATE_CAPTURING:
      return "capturing";
    case v1::SESSION_STATE_PAUSED:
      return "paused";
    case v1::SESSION_STATE_CAPTURED:
      return "captured";
    case v1::SESSION_STATE_SOLVING:
      return "solving";
    case v1::SESSION_STATE_DONE:
      return "done";
    case v1::SESSION_STATE_FAILED:
      return "failed";
    case v1::SESSION_STATE_CANCELLED:
      return "cancelled";
    default:
      return "unknown";
  }
}

std::string unsolved_text(std::int64_t pixels) {
  return pixels == 0 ? "" : fmt::format(", {} not solved", pixels);
}

bool allows(const v1::Session& session, v1::SessionAction action) {
  return std::ranges::find(session.allowed_actions(), action) != session.allowed_actions().end();
}

std::string tiles_text(const v1::Session& session) {
  if (session.tile_count() == 0) return "estimating the work";
  return fmt::format("{} of {} tiles", session.tiles_done(), session.tile_count());
}

absl::Status cannot_write(const std::string& output) {
  return absl::UnavailableError(
      fmt::format("cannot write {}; its directory must be there and writable, with room on the disk",
                  output == "-" ? "standard output" : output));
}

std::string waiting_text(const v1::Session& session) {
  const v1::Waiting& waiting = session.waiting();
  if (!session.has_waiting()) return "";
  return fmt::format("{}{}; {}", waiting.what(), waiting.since().empty() ? "" : ", since " + waiting.since(),
                     waiting.advice());
}

namespace {

// Of a captured session whose proofs are less than they could be.
std::string by_time_text(const v1::Session& session) {
  if (session.time_proven_count() == 0) return "";
  return fmt::format("; {} of {} steps are proven by time alone", session.time_proven_count(),
                     session.step_count());
}

}  // namespace

std::string summary_of(const v1::Session& session) {
  std::string line = fmt::format("session {} is {}", session.name(), state_name(session.state()));
  // Of a session that is paused the reason says more.
  if (session.has_waiting() && session.state() != v1::SESSION_STATE_PAUSED)
    return line + ", and waits: " + waiting_text(session);
  if (!session.reason().empty()) return line + ": " + session.reason();
  switch (session.state()) {
    case v1::SESSION_STATE_CAPTURING:
    case v1::SESSION_STATE_PAUSED:
      return line + fmt::format(": {} of {} steps", session.proven_count(), session.step_count());
    case v1::SESSION_STATE_CAPTURED:
      if (session.frame_count() > 0) line += fmt::format(": a video of {}", video_text(session));
      // Imported frames have no capture time.
      if (session.frames_taken() == 0) return line + fmt::format(": {} frames", session.step_count());
      return line + fmt::format(": {} steps ({} retaken) in {}, {} frames taken{}", session.step_count(),
                                session.retaken_count(), seconds_text(session.capture_seconds()),
                                session.frames_taken(), by_time_text(session));
    case v1::SESSION_STATE_SOLVING:
      line += " by " + method_text(session);
      if (is_video(session) && !session.matte_ready())  // otherwise the frames are the previous solve's
        return line +
               fmt::format(": {} of {} frames", session.solved_frames_size(), frames_to_solve(session));
      return line + ": " + tiles_text(session);
    case v1::SESSION_STATE_DONE:
      if (is_video(session))
        return line + fmt::format(": mattes of {}, solved by {} in {}{}", video_text(session),
                                  method_text(session), seconds_text(session.solve_seconds()),
                                  by_time_text(session));
      return line + fmt::format(": {} of {} pixels show the object ({} flagged){}, solved by {} in {}{}",
                                session.object_pixel_count(), session.pixel_count(),
                                session.flagged_pixel_count(), unsolved_text(session.unsolved_pixel_count()),
                                method_text(session), seconds_text(session.solve_seconds()),
                                by_time_text(session));
    default:
      return line;
  }
}

void print_session(const v1::Session& session, bool json) {
  if (json) {
    print_json(session);
  } else {
    std::cout << printable(summary_of(session)) << "\n";
  }
}

bool is_video(const v1::Session& session) {
  return session.frame_count() > 0 && session.method() == kRampMethod;
}

int frames_to_solve(const v1::Session& session) {
  return session.frame_count() - session.lost_frames_size();
}

namespace {

void add_range(int first, int last, std::string& text) {
  text +=
      fmt::format("{}{}{}", text.empty() ? "" : ", ", first, last > first ? fmt::format(" to {}", last) : "");
}

}  // namespace

std::string ranges_text(const google::protobuf::RepeatedField<std::int32_t>& numbers) {
  std::string text;
  for (int i = 0; i < numbers.size();) {
    int last = i;
    while (last + 1 < numbers.size() && numbers[last + 1] == numbers[last] + 1) ++last;
    add_range(numbers[i], numbers[last], text);
    i = last + 1;
  }
  return text;
}

std::string ranges_text(const google::protobuf::RepeatedPtrField<v1::StepRange>& steps) {
  std::string text;
  for (const v1::StepRange& range : steps) add_range(range.first(), range.last(), text);
  return text;
}

std::string describe(const v1::RigChange& change) {
  return fmt::format("after {} of capture, {}; {}", seconds_text(change.seconds()), change.what(),
                     change.advice());
}

std::string seconds_text(double seconds) {
  if (seconds < 59.95) return fmt::format("{:.1f} s", seconds);
  const long whole = std::lround(seconds);
  if (whole < 3600) return fmt::format("{} min {} s", whole / 60, whole % 60);
  return fmt::format("{} h {} min", whole / 3600, whole % 3600 / 60);
}

}  // namespace glasswing
