#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iostream>
#include <map>

#include "client/cli/camera_argument.h"
#include "client/cli/session_text.h"
#include "client/sessions/commands.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/output.h"
#include "core/pattern/describe_step.h"
#include "core/pattern/draft_stages.h"

namespace glasswing {
namespace {

void row(const char* label, const std::string& value) {
  if (!value.empty()) std::cout << fmt::format("{:9} {}\n", label, printable(value));
}

void print_capture(const v1::Session& session) {
  row("steps", fmt::format("{} of {} proven, {} retaken, {} frames taken in {}", session.proven_count(),
                           session.step_count(), session.retaken_count(), session.frames_taken(),
                           seconds_text(session.capture_seconds())));
  std::string causes;
  for (const v1::RetakeCount& retakes : session.retakes())
    causes += fmt::format("{}{} {}", causes.empty() ? "" : ", ", retakes.count(), describe(retakes.cause()));
  row("retakes", causes);
  if (session.frames_taken() > 0) {
    row("proof", fmt::format("{} by time and id patch, {} by time alone; {} rejected for their pixels",
                             session.patch_proven_count(),
                             session.proven_count() - session.patch_proven_count(), session.refused_count()));
  }
  for (const v1::UnprovenStep& step : session.unproven())
    row(&step == &session.unproven(0) ? "unproven" : "", fmt::format("{:5}  {}", step.step(), step.what()));
}

void print_video(const v1::Session& session) {
  if (session.frame_count() == 0) return;
  row("video", fmt::format("{} frames", session.frame_count()));
  if (!session.lost_frames().empty())
    row("lost",
        fmt::format("{} of them: {}", session.lost_frames_size(), ranges_text(session.lost_frames())));
  if (!session.refused_frames().empty())
    row("refused", fmt::format("{} of them: {}; {}", session.refused_frames_size(),
                               ranges_text(session.refused_frames()), session.refusal()));
  if (!session.solved_frames().empty())
    row("solved",
        fmt::format("{} of them: {}", session.solved_frames_size(), ranges_text(session.solved_frames())));
}

void print_solve(const v1::Session& session) {
  if (session.job() != 0) {
    row("solving", fmt::format("{}, {}, {}", session.method(), tiles_text(session),
                               seconds_text(session.solve_seconds())));
    for (const auto& [key, value] : session.options()) row("", key + "=" + value);
  }
  for (const v1::QuarantinedTile& tile : session.quarantined())
    row(&tile == &session.quarantined(0) ? "failed" : "",
        fmt::format("tile {}, {} {} to {}: {}", tile.tile(), is_video(session) ? "frames" : "rows",
                    tile.first(), tile.first() + tile.count() - 1, tile.error()));
  for (const std::string& warning : session.matte_warnings()) row("warning", warning);
  if (session.matte_ready() && session.state() != v1::SESSION_STATE_DONE)
    row("matte", "the matte of the previous solve can be fetched");
  row("pixels", fmt::format("{}{}, {} show the object{}, {} of them flagged{}", session.pixel_count(),
                            is_video(session) ? " a frame" : "", session.object_pixel_count(),
                            is_video(session) ? " in all frames" : "", session.flagged_pixel_count(),
                            unsolved_text(session.unsolved_pixel_count())));
}

void print_verdict(const v1::Session& session) {
  if (!session.has_verdict()) return;
  const v1::SessionVerdict& verdict = session.verdict();
  row("quality", (verdict.outlier() ? "unusual: " : "") + verdict.text());
}

// When the rules remove its frames, or did.
void print_ends(const v1::Session& session) {
  if (!session.frames_deleted().empty()) {
    row("",
        fmt::format("a rule removes them; keep them: glasswing undelete {}; du says when", session.name()));
  }
  if (!session.frames_gone().empty()) row("frames", "removed by a rule at " + session.frames_gone());
}

void print_details(const v1::Session& session) {
  row("session", session.name());
  row("state", state_name(session.state()));
  if (session.has_waiting()) {
    row("waiting", session.waiting().what() +
                       (session.waiting().since().empty() ? "" : ", since " + session.waiting().since()));
    row("", session.waiting().advice());
  }
  // The reason of a running capture or solve is what it is waiting for.
  if (!session.has_waiting() || session.state() == v1::SESSION_STATE_PAUSED) row("reason", session.reason());
  row("created", session.created() + (session.started_by().empty() ? "" : " by " + session.started_by()));
  row("note", session.note());
  row("tags", fmt::format("{}", fmt::join(session.tags(), " ")));
  row("frames",
      session.archive_address().empty()
          ? ""
          : fmt::format("{} on the node at {}", bytes_text(static_cast<double>(session.archive_bytes())),
                        session.archive_address()));
  print_ends(session);
  for (const v1::ArchiveCopy& copy : session.copies()) {
    row(&copy == &session.copies(0) ? "copies" : "",
        copy.address().empty() ? copy.node() + ", incomplete; finish it with: glasswing replicate " +
                                     session.name() + " " + copy.node()
                               : fmt::format("{} at {}", copy.node(), copy.address()));
  }
  const std::map<std::string, double> positions(session.rail_mm().begin(), session.rail_mm().end());
  for (const auto& [monitor, position_mm] : positions)
    row(monitor == positions.begin()->first ? "positions" : "",
        fmt::format("{} at {} mm", monitor, position_mm));
  const std::map<std::string, double> axes(session.axes().begin(), session.axes().end());
  for (const auto& [axis, position] : axes)
    row(axis == axes.begin()->first ? "pose" : "", fmt::format("{} at {}", axis, position));
  if (!session.empty_stage_of().empty()) row("stage", "the empty one of session " + session.empty_stage_of());
  for (const v1::Session& view : session.views())
    row(&view == &session.views(0) ? "cameras" : "", view.view_camera() + ": " + summary_of(view));
  if (!session.view_of().empty()) row("camera", session.view_camera() + ", of session " + session.view_of());
  print_capture(session);
  print_video(session);
  row("warning", session.warning());
  for (const v1::RigChange& change : session.rig_changes()) {
    row("rig", describe(change));
    row("", change.lost().empty() ? "" : "lost: steps " + ranges_text(change.lost()));
  }
  for (const v1::AdaptedRound& round : session.adapted())
    row(&round == &session.adapted(0) ? "adapted" : "", describe(round));
  print_verdict(session);
  if (session.has_draft()) row("draft", describe(session.draft()) + "; fetch it with --partial");
  print_solve(session);
}

absl::Status show(const Client& client, const std::string& name, const std::string& camera) {
  GW_ASSIGN_OR_RETURN(const v1::Session session, session_of(client, name, camera));
  if (client.json) {
    print_json(session);
  } else {
    print_details(session);
  }
  return absl::OkStatus();
}

}  // namespace

void add_show_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand("show", "Show everything about one session.");
  command.footer("Examples:\n  glasswing show vase --json\n  glasswing show vase --camera left");
  auto name = std::make_shared<std::string>(), camera = std::make_shared<std::string>();
  command.add_option("session", *name, "the session's name")->required();
  add_view_option(command, *camera);
  command.callback([&client, name, camera] {
    client.run = [&client, name, camera] { return show(client, *name, *camera); };
  });
}

}  // namespace glasswing
