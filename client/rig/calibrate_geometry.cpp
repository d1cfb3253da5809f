#include "client/rig/calibrate_geometry.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>

#include "client/sessions/matte_input.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/output.h"
#include "core/cli/output_file.h"
#include "core/file/file.h"
#include "core/geometry/geometry_fit.h"
#include "core/geometry/lens.h"
#include "core/geometry/rig_geometry.h"

namespace glasswing {
namespace {

constexpr double kMaxPitch_mm = 100.0;

struct GeometryArguments {
  std::vector<std::string> poses, pitches;
  std::string output;
};

// Per monitor; "": for all others.
using Pitches = std::map<std::string, double>;

absl::StatusOr<Pitches> parse_pitches(const std::vector<std::string>& texts) {
  Pitches pitches;
  for (const std::string& text : texts) {
    const size_t colon = text.rfind(':');
    const std::string monitor = colon == std::string::npos ? "" : text.substr(0, colon);
    const char* const begin = text.data() + (colon == std::string::npos ? 0 : colon + 1);
    const char* const end = text.data() + text.size();
    double pitch_mm = 0.0;
    const auto [rest, error] = std::from_chars(begin, end, pitch_mm);
    if (error != std::errc() || rest != end || !(pitch_mm > 0.0 && pitch_mm <= kMaxPitch_mm)) {
      return absl::InvalidArgumentError(fmt::format(
          "--pitch-mm is \"{}\"; it must be a number in (0, {}] or MONITOR:NUMBER, such as 0.2745 or "
          "back:0.2745",
          text, kMaxPitch_mm));
    }
    pitches[monitor] = pitch_mm;
  }
  return pitches;
}

absl::StatusOr<double> pitch_of(const Pitches& pitches, const std::string& monitor) {
  for (const std::string& name : {monitor, std::string()}) {
    if (const auto found = pitches.find(name); found != pitches.end()) return found->second;
  }
  return absl::InvalidArgumentError(
      fmt::format("--pitch-mm gives no pitch for monitor \"{0}\"; add --pitch-mm {0}:MM", monitor));
}

absl::StatusOr<StageView> view_in(const Client& client, const std::string& pose, const std::string& output) {
  const MatteInput input{pose};
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> matte, input.open(client, output));
  absl::StatusOr<StageView> view = sightings_in(matte->bytes());
  if (!view.ok()) return input.error(view.status());
  return view;
}

struct AllViews {
  int width_px = 0, height_px = 0;
  std::vector<MonitorView> views;
  std::vector<double> pitch_mm;
};
absl::StatusOr<AllViews> all_views(const Client& client, const GeometryArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const Pitches pitches, parse_pitches(arguments.pitches));
  AllViews all;
  for (const std::string& pose : arguments.poses) {
    GW_ASSIGN_OR_RETURN(StageView stage, view_in(client, pose, arguments.output));
    if (all.views.empty()) {
      all.width_px = stage.width_px;
      all.height_px = stage.height_px;
    } else if (stage.width_px != all.width_px || stage.height_px != all.height_px) {
      return absl::InvalidArgumentError(
          fmt::format("{} has a picture of {}x{} px, {} of {}x{}; all poses must be from one camera", pose,
                      stage.width_px, stage.height_px, arguments.poses[0], all.width_px, all.height_px));
    }
    for (MonitorView& view : stage.monitors) {
      GW_ASSIGN_OR_RETURN(const double pitch_mm, pitch_of(pitches, view.monitor));
      all.pitch_mm.push_back(pitch_mm);
      all.views.push_back(std::move(view));
    }
  }
  return all;
}

void print_as_json(const std::string& file, const GeometryFit& fit) {
  const v1::CameraGeometry& camera = fit.geometry.camera();
  nlohmann::ordered_json poses = nlohmann::ordered_json::array();
  for (size_t k = 0; k < fit.poses.size(); ++k) {
    const PoseFit& pose = fit.poses[k];
    const v1::MonitorPose& named = fit.geometry.monitors(static_cast<int>(k));
    poses.push_back({{"name", named.name()},
                     {"monitor", named.monitor()},
                     {"distance_mm", pose.distance_mm},
                     {"distance_sd_mm", pose.distance_sd_mm},
                     {"tilt_deg", pose.tilt_deg},
                     {"turn_sd_deg", pose.turn_sd_deg},
                     {"median_px", pose.median_px},
                     {"rms_px", pose.rms_px},
                     {"max_px", pose.max_px},
                     {"points", pose.used},
                     {"left_out", pose.left_out}});
    if (named.has_rail_mm()) poses.back()["rail_mm"] = named.rail_mm();
  }
  const auto& warnings = fit.geometry.warnings();
  const nlohmann::ordered_json written = {
      {"file", file},
      {"median_px", fit.median_px},
      {"rms_px", fit.rms_px},
      {"max_px", fit.max_px},
      {"fx_px", camera.fx_px()},
      {"fx_sd_px", camera.sd(kFx)},
      {"fy_px", camera.fy_px()},
      {"fy_sd_px", camera.sd(kFy)},
      {"cx_px", camera.cx_px()},
      {"cx_sd_px", camera.sd(kCx)},
      {"cy_px", camera.cy_px()},
      {"cy_sd_px", camera.sd(kCy)},
      {"k1", camera.k1()},
      {"k2", camera.k2()},
      {"p1", camera.p1()},
      {"p2", camera.p2()},
      {"k3", camera.k3()},
      {"poses", poses},
      {"warnings", std::vector<std::string>(warnings.begin(), warnings.end())}};
  std::cout << written.dump(1) << "\n";
}

void print_as_text(const Client& client, const std::string& file, const GeometryFit& fit) {
  const bool on_rails = std::ranges::any_of(fit.geometry.monitors(), &v1::MonitorPose::has_rail_mm);
  std::vector<Column> columns{{"POSE"},           {"MONITOR"},      {"DISTANCE_MM", true}, {"SD_MM", true},
                              {"TILT_DEG", true}, {"SD_DEG", true}, {"MEDIAN_PX", true},   {"RMS_PX", true},
                              {"MAX_PX", true},   {"POINTS", true}, {"LEFT_OUT", true}};
  if (on_rails) columns.insert(columns.begin() + 2, {"RAIL_MM", true});
  std::vector<std::vector<std::string>> rows;
  for (size_t k = 0; k < fit.poses.size(); ++k) {
    const PoseFit& pose = fit.poses[k];
    const v1::MonitorPose& named = fit.geometry.monitors(static_cast<int>(k));
    rows.push_back({named.name(), named.monitor(), fmt::format("{:.2f}", pose.distance_mm),
                    fmt::format("{:.2f}", pose.distance_sd_mm), fmt::format("{:.2f}", pose.tilt_deg),
                    fmt::format("{:.3f}", pose.turn_sd_deg), fmt::format("{:.3f}", pose.median_px),
                    fmt::format("{:.3f}", pose.rms_px), fmt::format("{:.3f}", pose.max_px),
                    fmt::format("{}", pose.used), fmt::format("{}", pose.left_out)});
    if (on_rails) {
      rows.back().insert(rows.back().begin() + 2,
                         named.has_rail_mm() ? fmt::format("{}", named.rail_mm()) : "-");
    }
  }
  print_table(client, columns, rows);
  if (client.tsv) return;
  const v1::CameraGeometry& camera = fit.geometry.camera();
  const auto number = [&](const char* name, double value, int at, const char* format) {
    return fmt::format(fmt::runtime(format), name, value, camera.sd(at));
  };
  constexpr const char* kPixels = "{} {:.2f} +- {:.2f} px";
  constexpr const char* kFactor = "{} {:.4f} +- {:.4f}";
  std::cout << "focal length " << number("fx", camera.fx_px(), kFx, kPixels) << ", "
            << number("fy", camera.fy_px(), kFy, kPixels) << "; centre "
            << number("cx", camera.cx_px(), kCx, kPixels) << ", "
            << number("cy", camera.cy_px(), kCy, kPixels) << "\n";
  std::cout << "distortion " << number("k1", camera.k1(), kK1, kFactor) << ", "
            << number("k2", camera.k2(), kK2, kFactor) << ", " << number("p1", camera.p1(), kP1, kFactor)
            << ", " << number("p2", camera.p2(), kP2, kFactor) << ", "
            << number("k3", camera.k3(), kK3, kFactor) << "\n";
  std::cout << fmt::format("points are off by {:.3f} px (median), {:.3f} px (rms), {:.3f} px (largest)\n",
                           fit.median_px, fit.rms_px, fit.max_px);
  std::cout << fmt::format("{}: for glasswing rays --geometry\n", file);
  for (const std::string& warning : fit.geometry.warnings())
    std::cout << fmt::format("warning: {}\n", printable(warning));
}

absl::Status calibrate_geometry(const Client& client, const GeometryArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const AllViews all, all_views(client, arguments));
  GW_ASSIGN_OR_RETURN(const GeometryFit fit,
                      fit_geometry(all.width_px, all.height_px, all.views, all.pitch_mm));
  GW_RETURN_IF_ERROR(write_output(arguments.output, geometry_text(fit.geometry)));
  if (client.json) {
    print_as_json(arguments.output, fit);
  } else {
    print_as_text(client, arguments.output, fit);
  }
  return absl::OkStatus();
}

}  // namespace

void add_geometry_command(CLI::App& calibrate, Client& client) {
  CLI::App& geometry = *calibrate.add_subcommand(
      "geometry",
      "Find the camera's lens and the monitors' poses, from sessions with a monitor at several poses.");
  geometry.footer(
      "Each pose is a solved session, or its matte's file: a plan with square waves, such as "
      "deploy/plans/hierarchical.txtpb, captured with nothing on the stage; or with an object beside which "
      "the monitor is visible. Move the monitor or the camera between sessions, not within one: six or more "
      "poses, turned by 20 to 40 degrees about either axis, that together fill the picture. If several "
      "monitors are in view, each is a separate pose.\n\n"
      "The file contains the camera and a pose for each session, with standard errors and covariances "
      "(docs/rays.md).\n\n"
      "Examples:\n"
      "  glasswing calibrate geometry tilt1 tilt2 tilt3 tilt4 near far --pitch-mm 0.2745 -o rig.txtpb\n"
      "  glasswing calibrate geometry poses/*.exr --pitch-mm back:0.2745 --pitch-mm left:0.311 -o rig.txtpb");
  auto arguments = std::make_shared<GeometryArguments>();
  geometry.add_option("poses", arguments->poses, "sessions, or matte files (.exr), one for each pose")
      ->required()
      ->type_name("SESSION");
  geometry
      .add_option(
          "--pitch-mm", arguments->pitches,
          "distance between the monitor's pixels, mm: its width divided by its pixels; MONITOR:MM for one of "
          "several; may be repeated")
      ->required()
      ->allow_extra_args(false);
  geometry.add_option("-o,--output", arguments->output, "the .txtpb file to write, or - for standard output")
      ->required()
      ->check(output_file({".txtpb", kStandardOutput}));
  geometry.callback([&client, arguments] {
    client.run = [&client, arguments] { return calibrate_geometry(client, *arguments); };
  });
}

}  // namespace glasswing
