#include "client/capture/capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <random>

#include "client/capture/capture_at_positions.h"
#include "client/capture/capture_turn.h"
#include "client/capture/commands.h"
#include "client/capture/upload.h"
#include "client/capture/watch.h"
#include "client/cli/camera_argument.h"
#include "client/cli/rig_view.h"
#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "client/plans/estimate.h"
#include "client/plans/rig_limits.h"
#include "core/base/name.h"
#include "core/base/scanner.h"
#include "core/base/status.h"
#include "core/cli/output.h"
#include "core/cli/progress.h"
#include "core/design/plan_design.h"
#include "core/pattern/plan.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

std::string random_request_id() {
  std::random_device entropy;
  return fmt::format("{:08x}{:08x}{:08x}{:08x}", entropy(), entropy(), entropy(), entropy());
}

struct CaptureArguments {
  std::string plan, session, note;
  std::vector<std::string> tags, cameras;
  bool solve = false, watch = false, dry_run = false;
  bool adapt = false;
  std::string target_error, footprints, rail_mm, turn;
  int at_most = 0;  // 0: as the plan says
};

// "42dB" or "0.1px".
absl::Status read_target(const std::string& text, v1::Adapt& adapt) {
  double value = 0.0;
  Scanner scan(text);
  const std::string_view unit = scan.number(value).rest();
  adapt.clear_target_db();
  adapt.clear_target_px();
  if (scan.then("px").done()) {
    adapt.set_target_px(value);
  } else if (unit == "dB" || unit == "db") {
    adapt.set_target_db(value);
  } else {
    return absl::InvalidArgumentError(fmt::format(
        "--target-error is \"{}\"; it must be decibels of composites, such as 42dB, or pixels of the "
        "monitor, such as 0.1px",
        text));
  }
  return absl::OkStatus();
}

// The first images of an adaptive session without a plan.
absl::StatusOr<v1::Plan> first_images(const Client& client) {
  constexpr int kFirstImages = 50;  // a monitor
  GW_ASSIGN_OR_RETURN(const RigLimits rig, read_plan_limits(client, {.for_rig = true, .monitors = {}}));
  DesignWish wish{.images = kFirstImages * std::max(static_cast<int>(rig.monitors.size()), 1), .noise = {}};
  if (rig.camera) wish.noise = noise_of(rig.camera->camera());
  GW_ASSIGN_OR_RETURN(DesignedPlan designed, design_plan(wish, rig));
  return std::move(designed.plan);
}

absl::StatusOr<v1::Plan> plan_to_capture(const Client& client, const CaptureArguments& arguments) {
  if (!arguments.adapt &&
      (!arguments.target_error.empty() || arguments.at_most != 0 || !arguments.footprints.empty()))
    return absl::InvalidArgumentError("--target-error, --at-most and --footprints need --adapt");
  if (arguments.plan.empty() && !arguments.adapt)
    return absl::InvalidArgumentError("name a plan, a .txtpb file; without one --adapt makes its own");
  GW_ASSIGN_OR_RETURN(v1::Plan plan,
                      arguments.plan.empty() ? first_images(client) : read_plan(arguments.plan));
  use_cameras(arguments.cameras, plan);
  GW_RETURN_IF_ERROR(check_plan(plan));
  if (!arguments.adapt) return plan;
  v1::Adapt& adapt = *plan.mutable_adapt();
  if (!arguments.target_error.empty()) GW_RETURN_IF_ERROR(read_target(arguments.target_error, adapt));
  if (arguments.at_most != 0) adapt.set_at_most(arguments.at_most);
  if (!arguments.footprints.empty()) adapt.set_footprints(arguments.footprints);
  GW_RETURN_IF_ERROR(check_plan(plan));
  return plan;
}

absl::Status dry_run(const Client& client, const Peer<v1::SessionService>& server,
                     const CaptureArguments& arguments) {
  v1::EstimateSessionRequest request;
  request.set_name(arguments.session);
  GW_ASSIGN_OR_RETURN(*request.mutable_plan(), plan_to_capture(client, arguments));
  GW_ASSIGN_OR_RETURN(const v1::EstimateSessionResponse estimate,
                      call(server, &v1::SessionService::Stub::EstimateSession, request, kLongCallTimeout));
  if (client.json) {
    print_json(estimate);
    return absl::OkStatus();
  }
  print_cost(request.plan(), estimate);
  print_rig_state(estimate);
  return absl::OkStatus();
}

absl::StatusOr<v1::CreateSessionRequest> request_of(const Client& client,
                                                    const Peer<v1::SessionService>& server,
                                                    const CaptureArguments& arguments) {
  // Checked before the capture starts; the server checks tags only afterwards.
  for (const std::string& tag : arguments.tags) GW_RETURN_IF_ERROR(check_name("tag", tag));
  v1::CreateSessionRequest request;
  GW_ASSIGN_OR_RETURN(*request.mutable_plan(), plan_to_capture(client, arguments));
  GW_RETURN_IF_ERROR(upload_photos(client, server, arguments.plan, *request.mutable_plan()));
  request.set_name(arguments.session);
  request.set_solve(arguments.solve);
  return request;
}

absl::StatusOr<v1::Session> annotated(const Peer<v1::SessionService>& server, v1::Session session,
                                      const CaptureArguments& arguments) {
  if (arguments.note.empty() && arguments.tags.empty()) return session;
  v1::AnnotateSessionRequest annotation;
  annotation.set_name(session.name());
  if (!arguments.note.empty()) annotation.set_note(arguments.note);
  annotation.mutable_add_tags()->Assign(arguments.tags.begin(), arguments.tags.end());
  GW_ASSIGN_OR_RETURN(const v1::AnnotateSessionResponse stored,
                      call(server, &v1::SessionService::Stub::AnnotateSession, annotation));
  return stored.session();
}

absl::Status capture_in_poses(const Client& client, const Peer<v1::SessionService>& server,
                              const CaptureArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const Poses poses, parse_poses("--turn", arguments.turn));
  GW_RETURN_IF_ERROR(check_turn(arguments.session, poses));
  if (!arguments.rail_mm.empty() || arguments.dry_run) {
    return absl::InvalidArgumentError(
        fmt::format("--turn goes with no {}", arguments.dry_run ? "--dry-run" : "--rail-mm"));
  }
  GW_ASSIGN_OR_RETURN(const v1::CreateSessionRequest request, request_of(client, server, arguments));
  return capture_turn(client, request, poses, [&](v1::Session session, const std::string& note) {
    CaptureArguments own = arguments;
    own.tags.push_back(arguments.session);
    if (own.note.empty()) own.note = note;
    return annotated(server, std::move(session), own);
  });
}

absl::Status capture(const Client& client, const CaptureArguments& arguments) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  if (!arguments.turn.empty()) return capture_in_poses(client, server, arguments);
  if (arguments.dry_run) return dry_run(client, server, arguments);
  if (!arguments.rail_mm.empty()) {
    GW_ASSIGN_OR_RETURN(const RailPositions positions, parse_rail_positions("--rail-mm", arguments.rail_mm));
    GW_RETURN_IF_ERROR(check_series(arguments.session, positions));
    GW_ASSIGN_OR_RETURN(const v1::CreateSessionRequest request, request_of(client, server, arguments));
    return capture_at_positions(client, request, positions, [&](v1::Session session) {
      return annotated(server, std::move(session), arguments);
    });
  }
  GW_ASSIGN_OR_RETURN(v1::CreateSessionRequest request, request_of(client, server, arguments));
  GW_ASSIGN_OR_RETURN(v1::Session session, create_session(client, std::move(request)));
  GW_ASSIGN_OR_RETURN(session, annotated(server, std::move(session), arguments));
  if (arguments.watch) {
    return follow_to_outcome(client, session.name(),
                             session.solve_follows() ? Goal::kDone : Goal::kCapturedOrDone);
  }
  print_session(session, client.json);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<v1::Session> create_session(const Client& client, v1::CreateSessionRequest request) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  request.set_request_id(random_request_id());
  absl::StatusOr<v1::CreateSessionResponse> created =
      call(server, &v1::SessionService::Stub::CreateSession, request, kLongCallTimeout);
  // The request id makes a retry safe if only the answer was lost.
  if (absl::IsDeadlineExceeded(created.status())) {
    created = call(server, &v1::SessionService::Stub::CreateSession, request, kLongCallTimeout);
  }
  GW_RETURN_IF_ERROR(created.status());
  return std::move(*created->mutable_session());
}

void add_capture_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand("capture", "Start a capture session from a plan.");
  command.footer(
      "Examples:\n"
      "  glasswing capture deploy/plans/crystal.txtpb --session vase --watch\n"
      "  glasswing capture deploy/plans/crystal.txtpb --session vase --solve --watch\n"
      "  glasswing capture --adapt --session vase --watch\n"
      "  glasswing capture deploy/plans/design-50.txtpb --adapt --target-error 42dB --at-most 150\n"
      "  glasswing capture --adapt --footprints any --session lens --watch\n"
      "  glasswing capture deploy/plans/crystal.txtpb --rail-mm 200,251.2 --session vase --solve --watch\n"
      "  glasswing capture deploy/plans/crystal.txtpb --turn 0:350:10 --session vase --solve\n"
      "  glasswing capture deploy/plans/crystal.txtpb --session vase --camera left --camera right --solve\n"
      "  glasswing capture deploy/plans/crystal.txtpb --dry-run\n"
      "  glasswing capture deploy/plans/crystal.txtpb --note \"handle to the left\" --tag vases --tag lab3");
  auto arguments = std::make_shared<CaptureArguments>();
  command.add_option("plan", arguments->plan, "the plan, a .txtpb file; with --adapt it may be left out");
  command.add_option("--session", arguments->session, "the session's name; default: chosen by the server");
  add_cameras_option(command, arguments->cameras);
  command.add_option("--note", arguments->note, "a note to keep with it");
  command.add_option("--tag", arguments->tags, "a tag for finding it; may be repeated")
      ->allow_extra_args(false);
  command.add_flag(
      "--solve", arguments->solve,
      "solve it with the plan's method as soon as it is captured, and drafts before that (fetch --partial)");
  command.add_flag("--adapt", arguments->adapt,
                   "after the plan's images show further ones, chosen by what is still uncertain, until the "
                   "object is known well enough; then solve it");
  command.add_option("--target-error", arguments->target_error,
                     "with --adapt: stop when 95 % of the object's pixels are expected to be this good: 42dB "
                     "of a composite, "
                     "or 0.1px on the monitor; default: 40dB");
  command
      .add_option("--at-most", arguments->at_most,
                  fmt::format("with --adapt: stop at this many images; default: {}", kDefaultAtMost))
      ->check(CLI::Range(30, 20000));
  command
      .add_option(
          "--footprints", arguments->footprints,
          "with --adapt: gaussian, or any: pixels that no few Gaussians explain get footprints of any "
          "shape, and ask for waves in more directions; default: gaussian")
      ->check(CLI::IsMember({"gaussian", "any"}));
  command
      .add_option(
          "--rail-mm", arguments->rail_mm,
          "capture a session at each of these positions of a monitor, named NAME-MM such as vase-200, one "
          "after the other: its rail moves it there, or you do and press Enter; for one of several monitors, "
          "such as back:200,251.2")
      ->type_name("MM,MM");
  command
      .add_option(
          "--turn", arguments->turn,
          "capture a session in each pose of the stage's turntable, FIRST:LAST:STEP or a list of degrees, "
          "named as vase-010, and the empty stage once; the same command goes on with a series that broke "
          "off; one of several axes as turn=0:350:10")
      ->type_name("FIRST:LAST:STEP");
  command.add_flag(
      "--watch", arguments->watch,
      "wait until it is captured, or with --solve until it is solved; any other outcome is a failure");
  command.add_flag("--dry-run", arguments->dry_run,
                   "capture nothing: check everything, and print the cost and who holds the rig");
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return capture(client, *arguments); }; });
}

}  // namespace glasswing
