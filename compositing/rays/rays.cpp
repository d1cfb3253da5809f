#include <fmt/format.h>

#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "compositing/picture/picture.h"
#include "compositing/rays/commands.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"
#include "core/file/file.h"
#include "core/matte/matte_file.h"
#include "core/matte/pyramid_share.h"
#include "core/rays/match_rays.h"
#include "core/rays/ray_file.h"

namespace glasswing {
namespace {

struct RaysArguments {
  ReadMatte read;
  std::vector<std::string> mattes, poses;
  std::string geometry, output;
  double object_depth_mm = 0.0;
};

// Rays are made of modes alone.
absl::StatusOr<Matte> read_modes(const RaysArguments& arguments, const std::string& name) {
  GW_ASSIGN_OR_RETURN(Matte matte, arguments.read(name, arguments.output, Pyramids::kKept));
  tell_lost(pyramid_share(matte), "rays");
  matte.drop_pyramids();
  return matte;
}

// A pose that was calibrated with the monitor elsewhere on its rail is a different pose.
absl::Status check_positions(const Matte& matte, const v1::RigGeometry& geometry, const std::string& name) {
  for (const v1::Monitor& monitor : matte.metadata.monitors()) {
    const absl::StatusOr<const v1::MonitorPose*> pose = find_pose(geometry, name, monitor.name());
    if (!pose.ok() || !monitor.has_rail_mm() || !(*pose)->has_rail_mm()) continue;
    if (monitor.rail_mm() == (*pose)->rail_mm()) continue;
    return absl::FailedPreconditionError(fmt::format(
        "monitor \"{}\" was at {} mm on its rail for session {}, but pose \"{}\" has it at {} mm; "
        "name the pose with --poses",
        monitor.name(), monitor.rail_mm(), matte.metadata.session(), name, (*pose)->rail_mm()));
  }
  return absl::OkStatus();
}

absl::StatusOr<RayMatte> rays_of(const RaysArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const v1::RigGeometry geometry, read_geometry(arguments.geometry));
  if (arguments.mattes.size() > 2) {
    return absl::InvalidArgumentError(
        fmt::format("there are {} mattes; rays take two, at two depths, or one", arguments.mattes.size()));
  }
  std::vector<std::string> poses = arguments.poses;
  GW_ASSIGN_OR_RETURN(const Matte one, read_modes(arguments, arguments.mattes[0]));
  if (!poses.empty() && poses.size() != arguments.mattes.size()) {
    return absl::InvalidArgumentError(
        fmt::format("--poses has {} names; there are {} mattes, and it must have one "
                    "for each",
                    poses.size(), arguments.mattes.size()));
  }
  if (arguments.mattes.size() == 1) {
    if (!(arguments.object_depth_mm > 0.0)) {
      return absl::InvalidArgumentError(
          "one matte does not determine directions; give --object-depth, the object's distance from the "
          "camera in mm, for an approximate far environment; or give a second matte");
    }
    const std::string pose = poses.empty() ? one.metadata.session() : poses[0];
    GW_RETURN_IF_ERROR(check_positions(one, geometry, pose));
    return far_light_rays(one, geometry, pose, arguments.object_depth_mm);
  }
  if (arguments.object_depth_mm > 0.0)
    return absl::InvalidArgumentError("--object-depth is for one matte; two determine directions");
  GW_ASSIGN_OR_RETURN(const Matte other, read_modes(arguments, arguments.mattes[1]));
  if (poses.empty()) poses = {one.metadata.session(), other.metadata.session()};
  GW_RETURN_IF_ERROR(check_positions(one, geometry, poses[0]));
  GW_RETURN_IF_ERROR(check_positions(other, geometry, poses[1]));
  return match_rays(one, other, geometry, poses);
}

// Where the monitors were, according to the geometry.
std::vector<const v1::MonitorPose*> poses_of(const v1::RayMetadata& metadata) {
  std::vector<const v1::MonitorPose*> poses;
  for (const std::string& name : metadata.poses()) {
    for (const v1::MonitorPose& pose : metadata.geometry().monitors()) {
      if (pose.name() == name) poses.push_back(&pose);
    }
  }
  return poses;
}

nlohmann::ordered_json poses_as_json(const v1::RayMetadata& metadata) {
  nlohmann::ordered_json poses = nlohmann::ordered_json::array();
  for (const v1::MonitorPose* pose : poses_of(metadata)) {
    poses.push_back({{"name", pose->name()}, {"depth_mm", MonitorPlane(*pose).depth_mm()}});
    if (pose->has_rail_mm()) poses.back()["rail_mm"] = pose->rail_mm();
  }
  return poses;
}

absl::Status write_rays(const CommandLine& command_line, const RaysArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const RayMatte rays, rays_of(arguments));
  GW_ASSIGN_OR_RETURN(const std::string bytes, encode_rays(rays));
  GW_RETURN_IF_ERROR(write_output(arguments.output, bytes));
  const v1::RayCounts& counts = rays.metadata.counts();
  if (command_line.json) {
    const nlohmann::ordered_json written = {{"file", arguments.output},
                                            {"width_px", rays.width_px()},
                                            {"height_px", rays.height_px()},
                                            {"approximation", rays.metadata.approximation()},
                                            {"poses", poses_as_json(rays.metadata)},
                                            {"matched", counts.matched()},
                                            {"ambiguous", counts.ambiguous()},
                                            {"extrapolated", counts.extrapolated()},
                                            {"unknown", counts.unknown()},
                                            {"matched_light", counts.matched_weight()},
                                            {"ambiguous_light", counts.ambiguous_weight()},
                                            {"extrapolated_light", counts.extrapolated_weight()},
                                            {"unknown_light", counts.unknown_weight()}};
    std::cout << written.dump(1) << "\n";
    return absl::OkStatus();
  }
  std::cout << fmt::format("{}: {}x{}\n", arguments.output, rays.width_px(), rays.height_px());
  for (const v1::MonitorPose* pose : poses_of(rays.metadata)) {
    std::cout << fmt::format("pose {}: {:.2f} mm from the camera{}\n", pose->name(),
                             MonitorPlane(*pose).depth_mm(),
                             pose->has_rail_mm() ? fmt::format(", {} mm on its rail", pose->rail_mm()) : "");
  }
  if (!rays.metadata.approximation().empty()) {
    std::cout << "approximation: " << rays.metadata.approximation() << "\n";
    return absl::OkStatus();
  }
  const double all = std::max(counts.matched_weight() + counts.ambiguous_weight() +
                                  counts.extrapolated_weight() + counts.unknown_weight(),
                              1e-12);
  const auto line = [&](const char* what, std::int64_t count, double weight) {
    std::cout << fmt::format("{:<48}{:>9} rays, {:5.1f} % of the object's light\n", what, count,
                             100.0 * weight / all);
  };
  line("through two measured places", counts.matched(), counts.matched_weight());
  line("ambiguous: another match is as likely", counts.ambiguous(), counts.ambiguous_weight());
  line("seen at one depth, direction from its neighbours", counts.extrapolated(),
       counts.extrapolated_weight());
  line("seen at one depth, direction not known", counts.unknown(), counts.unknown_weight());
  return absl::OkStatus();
}

}  // namespace

void add_rays_command(CLI::App& app, CommandLine& command_line, ReadMatte read) {
  CLI::App& command =
      *app.add_subcommand("rays",
                          "Turn mattes of one object in front of monitors at two depths into rays, for any "
                          "surroundings.");
  command.footer(
      "The geometry describes the camera and the monitors' poses (docs/rays.md). Each matte uses\n"
      "the pose named after its session, or those of --poses. The output is for glasswing composite with\n"
      "--environment and --plane; its layers ray.origin and ray.direction are for other programs.\n\n"
      "One matte and --object-depth give an approximation, which is marked as such: light from far away.\n\n"
      "Examples:\n"
      "  glasswing rays near.exr far.exr --geometry rig.txtpb -o rays.exr\n"
      "  glasswing rays near far --geometry rig.txtpb -o rays.exr\n"
      "  glasswing rays a.exr b.exr --geometry rig.txtpb --poses near,far -o rays.exr\n"
      "  glasswing rays near.exr --geometry rig.txtpb --object-depth 450 -o rays.exr");
  auto arguments = std::make_shared<RaysArguments>();
  arguments->read = std::move(read);
  command.add_option("mattes", arguments->mattes, "one matte or two: files (.exr), or solved sessions")
      ->required()
      ->type_name("MATTE");
  command
      .add_option("--geometry", arguments->geometry, "a text file of the camera and its poses (docs/rays.md)")
      ->required();
  command.add_option("-o,--output", arguments->output, "the OpenEXR file to write, or - for standard output")
      ->required()
      ->check(output_file({".exr", kStandardOutput}));
  command.add_option("--poses", arguments->poses, "the pose of each matte; default: named after its session")
      ->delimiter(',');
  command.add_option("--object-depth", arguments->object_depth_mm,
                     "with one matte: the object's distance from the camera, mm");
  command.callback([&command_line, arguments] {
    command_line.run = [&command_line, arguments] { return write_rays(command_line, *arguments); };
  });
}

}  // namespace glasswing
