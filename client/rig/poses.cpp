#include <fmt/format.h>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "client/rig/axis_sessions.h"
#include "client/rig/commands.h"
#include "core/axis/object_pose.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"
#include "core/geometry/rig_geometry.h"

namespace glasswing {
namespace {

struct PosesArguments {
  std::vector<std::string> sessions;
  std::string series, geometry, output = kStandardOutput;
};

absl::Status poses(const Client& client, const PosesArguments& arguments) {
  if (arguments.sessions.empty() == arguments.series.empty())
    return absl::InvalidArgumentError("name sessions, or a series with --series");
  GW_ASSIGN_OR_RETURN(const v1::RigGeometry geometry, read_geometry(arguments.geometry));
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> sessions,
                      find_poses(client, arguments.sessions, arguments.series));
  GW_ASSIGN_OR_RETURN(const std::string name, axis_of(sessions, ""));
  GW_ASSIGN_OR_RETURN(const v1::AxisGeometry* const axis, find_axis_geometry(geometry, name));
  nlohmann::ordered_json matrices, positions;
  for (const v1::Session& session : sessions) {
    const double position = session.axes().at(name);
    const Eigen::Matrix4d pose = object_to_rig(*axis, position);
    for (int row = 0; row < 4; ++row) {
      matrices[session.name()].push_back({pose(row, 0), pose(row, 1), pose(row, 2), pose(row, 3)});
    }
    positions[session.name()] = position;
  }
  const nlohmann::ordered_json written = {{"frame", "camera: x right, y down, z forward"},
                                          {"unit", "mm"},
                                          {"axis", name},
                                          {"object_to_rig", matrices},
                                          {"positions", positions}};
  return write_output(arguments.output, written.dump(1) + "\n");
}

}  // namespace

void add_poses_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand(
      "poses", "Write the object's poses in a turntable series as JSON: a 4x4 matrix for each session.");
  command.footer(
      "object_to_rig maps the object's frame, in mm, to the rig's, which is the camera's: x right, y down,\n"
      "z forward. The object's frame has its origin on the axis and turns with the table. The geometry "
      "needs\n"
      "the axis (glasswing calibrate axis).\n\n"
      "Examples:\n"
      "  glasswing poses --series vase --geometry rig.txtpb -o poses.json\n"
      "  glasswing poses vase-000 vase-090 --geometry rig.txtpb");
  auto arguments = std::make_shared<PosesArguments>();
  command.add_option("sessions", arguments->sessions, "sessions, one for each pose")->type_name("SESSION");
  command.add_option("--series", arguments->series, "all sessions of this series (glasswing capture --turn)")
      ->type_name("SERIES");
  command.add_option("--geometry", arguments->geometry, "the rig, with the axis")
      ->required()
      ->type_name("FILE")
      ->check(CLI::ExistingFile);
  command.add_option("-o,--output", arguments->output, "the .json file to write; default: standard output")
      ->check(output_file({".json", kStandardOutput}));
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return poses(client, *arguments); }; });
}

}  // namespace glasswing
