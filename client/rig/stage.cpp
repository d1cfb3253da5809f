#include <fmt/format.h>

#include <iostream>
#include <nlohmann/json.hpp>

#include "client/capture/stage_axes.h"
#include "client/cli/rpc.h"
#include "client/rig/commands.h"
#include "core/base/scanner.h"
#include "core/base/status.h"
#include "core/cli/output.h"
#include "core/cli/progress.h"
#include "glasswing/v1/rig_service.grpc.pb.h"

namespace glasswing {
namespace {

constexpr std::chrono::minutes kMoveTimeout(10);

struct StageArguments {
  std::vector<std::string> positions;  // "turn=30", or "30"
  std::string camera;
  bool home = false, stop = false;
};

void print_axes(const Client& client, const std::vector<v1::Axis>& axes) {
  if (client.json) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const v1::Axis& axis : axes) {
      list.push_back({{"name", axis.name()},
                      {"unit", axis.unit()},
                      {"min", axis.min()},
                      {"max", axis.max()},
                      {"homes", axis.homes()}});
      if (axis.has_position()) list.back()["position"] = axis.position();
    }
    std::cout << list.dump(1) << "\n";
    return;
  }
  std::vector<std::vector<std::string>> rows;
  for (const v1::Axis& axis : axes) {
    rows.push_back({axis.name(), axis.has_position() ? fmt::format("{}", axis.position()) : "unknown",
                    axis.unit(), fmt::format("{}", axis.min()), fmt::format("{}", axis.max()),
                    axis.homes() ? "yes" : "no"});
  }
  print_table(client, {{"AXIS"}, {"POSITION", true}, {"UNIT"}, {"MIN", true}, {"MAX", true}, {"HOMES"}},
              rows);
}

absl::StatusOr<v1::PlaceObjectRequest> request_of(const StageArguments& arguments,
                                                  const std::vector<v1::Axis>& axes) {
  v1::PlaceObjectRequest request;
  request.set_camera(arguments.camera);
  for (const std::string& text : arguments.positions) {
    const size_t equals = text.find('=');
    const std::string name = equals == std::string::npos ? "" : text.substr(0, equals);
    if (arguments.home) {
      GW_ASSIGN_OR_RETURN(const v1::Axis axis, find_axis(text, axes));
      request.add_home(axis.name());
      continue;
    }
    double position = 0.0;
    if (!Scanner(std::string_view(text).substr(equals == std::string::npos ? 0 : equals + 1))
             .number(position)
             .done()) {
      return absl::InvalidArgumentError(fmt::format(
          "the position is \"{}\"; it must be a number, or of one of several axes AXIS=NUMBER, as turn=30",
          text));
    }
    GW_ASSIGN_OR_RETURN(const v1::Axis axis, find_axis(name, axes));
    if (!request.mutable_positions()->insert({axis.name(), position}).second)
      return absl::InvalidArgumentError(fmt::format("axis \"{}\" has two positions", axis.name()));
  }
  if (arguments.home && arguments.positions.empty()) {
    for (const v1::Axis& axis : axes) request.add_home(axis.name());
  }
  return request;
}

absl::Status stage(const Client& client, const StageArguments& arguments) {
  const Peer<v1::RigService> server(client.server_title(), client.server);
  if (arguments.stop) {
    v1::StopObjectRequest request;
    request.set_camera(arguments.camera);
    GW_RETURN_IF_ERROR(call(server, &v1::RigService::Stub::StopObject, request).status());
  }
  GW_ASSIGN_OR_RETURN(std::vector<v1::Axis> axes, read_axes(client, arguments.camera));
  if (arguments.home || !arguments.positions.empty()) {
    GW_RETURN_IF_ERROR(axes.empty() ? find_axis("", axes).status() : absl::OkStatus());
    GW_ASSIGN_OR_RETURN(const v1::PlaceObjectRequest request, request_of(arguments, axes));
    const Waiting waiting("moving the stage");
    GW_ASSIGN_OR_RETURN(const v1::PlaceObjectResponse moved,
                        call(server, &v1::RigService::Stub::PlaceObject, request, kMoveTimeout));
    axes.assign(moved.axes().begin(), moved.axes().end());
  }
  print_axes(client, axes);
  return absl::OkStatus();
}

}  // namespace

void add_stage_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand(
      "stage", "Move the axes of the stage, such as a turntable, home or stop them; or list them.");
  command.footer(
      "Axes are those of glasswing-camera --axis. To capture in many poses: glasswing capture --turn.\n\n"
      "Examples:\n"
      "  glasswing stage\n"
      "  glasswing stage 30\n"
      "  glasswing stage turn=30 lift=5\n"
      "  glasswing stage --home\n"
      "  glasswing stage --stop");
  auto arguments = std::make_shared<StageArguments>();
  command
      .add_option("position", arguments->positions,
                  "where to, degrees or mm; AXIS=NUMBER for one of several axes; with --home, axes")
      ->type_name("POSITION");
  command.add_flag("--home", arguments->home, "move axes to 0, by their switches; all, where none is named");
  command.add_flag(
      "--stop", arguments->stop,
      "stop all axes at once, whoever moves them; a session that needs them fails, and glasswing retry "
      "goes on with it");
  command.add_option("--camera", arguments->camera,
                     "the camera node with the stage, where there are several");
  command.callback([&client, arguments]() -> void {
    client.run = [&client, arguments]() -> absl::Status {
      if (arguments->stop && (arguments->home || !arguments->positions.empty()))
        return absl::InvalidArgumentError("--stop stands alone: it moves nothing");
      return stage(client, *arguments);
    };
  });
}

}  // namespace glasswing
