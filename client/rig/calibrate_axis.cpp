#include "client/rig/calibrate_axis.h"

#include <fmt/format.h>

#include <algorithm>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "client/capture/stage_axes.h"
#include "client/rig/axis_sessions.h"
#include "core/archive/remote_archive.h"
#include "core/axis/axis_fit.h"
#include "core/axis/board.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/output.h"
#include "core/cli/output_file.h"
#include "core/cli/progress.h"
#include "core/file/file.h"
#include "core/geometry/rig_geometry.h"
#include "core/image/mosaic.h"

namespace glasswing {
namespace {

constexpr int kMaxFrames = 16;  // of a session, which are averaged

struct AxisArguments {
  std::vector<std::string> sessions;
  std::string series, points, axis, geometry, board, dictionary = "4x4_100", output;
};

// What was seen of the boards.
struct Track {
  std::string axis;
  std::vector<double> positions_deg;
  std::vector<AxisSighting> points;
};

// The mean of a session's frames with the object.
absl::StatusOr<RadianceImage> picture_of(const v1::Session& session, const v1::CameraGeometry& camera) {
  std::vector<std::string> addresses{session.archive_address()};
  for (const v1::ArchiveCopy& copy : session.copies()) {
    if (!copy.address().empty()) addresses.push_back(copy.address());
  }
  std::erase(addresses, "");
  if (addresses.empty())
    return absl::FailedPreconditionError(fmt::format("session \"{}\" has no frames", session.name()));
  const RemoteArchive archive(addresses, session.name(), {});
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, archive.manifest());
  const v1::Camera& seen_by = manifest.camera();
  if (seen_by.width_px() != camera.width_px() || seen_by.height_px() != camera.height_px()) {
    return absl::InvalidArgumentError(
        fmt::format("session \"{}\" has frames of {}x{} px; the geometry is for {}x{}", session.name(),
                    seen_by.width_px(), seen_by.height_px(), camera.width_px(), camera.height_px()));
  }
  const std::optional<Mosaic> mosaic = mosaic_of(seen_by);
  RadianceImage sum(camera.width_px(), camera.height_px());
  int count = 0;
  for (int i = 0; i < manifest.frames_size() && count < kMaxFrames; ++i) {
    if (!manifest.frames(i).object()) continue;
    Image16 frame(camera.width_px(), camera.height_px(), mosaic ? 1 : 3);
    GW_ASSIGN_OR_RETURN(frame.samples, archive.samples(manifest, {i}, 0, camera.height_px()));
    const Image16 colours = interpolated(frame, mosaic);
    for (size_t k = 0; k < sum.samples.size(); ++k) sum.samples[k] += radiance_of(colours.samples[k]);
    ++count;
  }
  if (count == 0)
    return absl::FailedPreconditionError(
        fmt::format("session \"{}\" has no frames with an object on the stage", session.name()));
  return sum;
}

// FAILED_PRECONDITION: the stage says that the axis does not turn. One that does not answer is not needed.
absl::Status check_turns(const v1::Session& session, const std::string& name) {
  const absl::StatusOr<std::vector<v1::Axis>> stage = read_axes_at(session.archive_address());
  if (!stage.ok()) return absl::OkStatus();
  const auto axis = std::ranges::find(*stage, name, &v1::Axis::name);
  if (axis == stage->end() || axis->unit() == "deg") return absl::OkStatus();
  return absl::FailedPreconditionError(
      fmt::format("axis \"{}\" moves along a line, in {}; calibrate axis measures axes that turn, in degrees",
                  name, axis->unit()));
}

absl::StatusOr<Track> track_of_board(const Client& client, const AxisArguments& arguments,
                                     const v1::CameraGeometry& camera) {
  GW_ASSIGN_OR_RETURN(const Board board, parse_board("--board", arguments.board, arguments.dictionary));
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> sessions,
                      find_poses(client, arguments.sessions, arguments.series));
  Track track;
  GW_ASSIGN_OR_RETURN(track.axis, axis_of(sessions, arguments.axis));
  GW_RETURN_IF_ERROR(check_turns(sessions.front(), track.axis));
  Waiting waiting("looking for the board");
  for (const v1::Session& session : sessions) {
    GW_ASSIGN_OR_RETURN(const RadianceImage picture, picture_of(session, camera));
    GW_ASSIGN_OR_RETURN(const std::vector<BoardCorner> corners, find_corners(board, picture));
    for (const BoardCorner& corner : corners) {
      track.points.push_back({.position = static_cast<int>(track.positions_deg.size()),
                              .board = corner.board,
                              .pixel = corner.pixel,
                              .at_mm = corner.at_mm});
    }
    track.positions_deg.push_back(session.axes().at(track.axis));
  }
  return track;
}

// Lines of "position x_px y_px X_mm Y_mm Z_mm", after # comments.
absl::StatusOr<Track> track_in_file(const AxisArguments& arguments) {
  constexpr size_t kMaxPoints = 1'000'000;
  GW_ASSIGN_OR_RETURN(const std::string text, read_file(arguments.points));
  Track track{.axis = arguments.axis.empty() ? "turn" : arguments.axis, .positions_deg = {}, .points = {}};
  std::map<double, int> positions;
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    line.resize(std::min(line.find('#'), line.size()));
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    std::istringstream words(line);
    double position_deg = 0.0;
    AxisSighting point;
    std::string rest;
    words >> position_deg >> point.pixel.x() >> point.pixel.y() >> point.at_mm.x() >> point.at_mm.y() >>
        point.at_mm.z();
    if (words.fail() || words >> rest) {
      return absl::InvalidArgumentError(fmt::format(
          "{}:{}: it must be six numbers: the position in degrees, the pixel x y, and the point X Y "
          "Z on the object in mm",
          arguments.points, number));
    }
    if (track.points.size() == kMaxPoints)
      return absl::InvalidArgumentError(
          fmt::format("{} has more than {} points", arguments.points, kMaxPoints));
    const auto [at, is_new] = positions.emplace(position_deg, static_cast<int>(positions.size()));
    if (is_new) track.positions_deg.push_back(position_deg);
    point.position = at->second;
    track.points.push_back(point);
  }
  return track;
}

void print_as_json(const std::string& file, const Track& track, const AxisFit& fit) {
  const v1::AxisGeometry& axis = fit.axis;
  const auto numbers = [](const auto& values) { return std::vector<double>(values.begin(), values.end()); };
  nlohmann::ordered_json positions = nlohmann::ordered_json::array();
  for (size_t i = 0; i < fit.positions.size(); ++i) {
    positions.push_back({{"position_deg", track.positions_deg[i]},
                         {"points", fit.positions[i].used},
                         {"left_out", fit.positions[i].left_out},
                         {"rms_px", fit.positions[i].rms_px}});
  }
  const nlohmann::ordered_json written = {
      {"file", file},
      {"axis", axis.name()},
      {"direction", numbers(axis.direction())},
      {"direction_sd_deg", fit.errors.direction_sd_deg},
      {"point_mm", numbers(axis.point_mm())},
      {"point_sd_mm", fit.errors.point_sd_mm},
      {"wobble_deg", axis.wobble_deg()},
      {"runout_mm", axis.runout_mm()},
      {"tip_deg", axis.tip_deg()},
      {"turn_deg", axis.turn_deg()},
      {"shift_mm", axis.shift_mm()},
      {"residual_px", axis.residual_px()},
      {"positions", positions},
      {"warnings", std::vector<std::string>(axis.warnings().begin(), axis.warnings().end())}};
  std::cout << written.dump(1) << "\n";
}

void print_as_text(const Client& client, const std::string& file, const Track& track, const AxisFit& fit) {
  std::vector<std::vector<std::string>> rows;
  for (size_t i = 0; i < fit.positions.size(); ++i) {
    const AxisFit::Position& position = fit.positions[i];
    rows.push_back({fmt::format("{}", track.positions_deg[i]), fmt::format("{}", position.used),
                    fmt::format("{}", position.left_out),
                    position.used > 0 ? fmt::format("{:.3f}", position.rms_px) : "-"});
  }
  print_table(client, {{"POSITION", true}, {"POINTS", true}, {"LEFT_OUT", true}, {"RMS_PX", true}}, rows);
  if (client.tsv) return;
  const v1::AxisGeometry& axis = fit.axis;
  std::cout << fmt::format("axis {}: direction {:.5f} {:.5f} {:.5f}, +- {:.4f} degrees\n", axis.name(),
                           axis.direction(0), axis.direction(1), axis.direction(2),
                           fit.errors.direction_sd_deg);
  std::cout << fmt::format("through {:.3f} {:.3f} {:.3f} mm, +- {:.4f} mm\n", axis.point_mm(0),
                           axis.point_mm(1), axis.point_mm(2), fit.errors.point_sd_mm);
  std::cout << fmt::format(
      "a wobble of {:.4f} degrees and {:.4f} mm repeats with the turn; each position is off by "
      "{:.4f} degrees of tip, {:.4f} of turn and {:.4f} mm\n",
      axis.wobble_deg(), axis.runout_mm(), axis.tip_deg(), axis.turn_deg(), axis.shift_mm());
  std::cout << fmt::format("points are off by {:.3f} px (rms along either axis)\n", axis.residual_px());
  std::cout << fmt::format("{}: for glasswing poses --geometry\n", file);
  for (const std::string& warning : axis.warnings())
    std::cout << fmt::format("warning: {}\n", printable(warning));
}

absl::Status calibrate_axis(const Client& client, const AxisArguments& arguments) {
  const bool from_board = !arguments.sessions.empty() || !arguments.series.empty();
  if (from_board == !arguments.points.empty()) {
    return absl::InvalidArgumentError(
        "the axis is found either from sessions, by name or with --series, or from --points");
  }
  if (from_board && arguments.board.empty())
    return absl::InvalidArgumentError(
        "--board is missing: the board that the sessions show, such as 7x5:8:6");
  GW_ASSIGN_OR_RETURN(v1::RigGeometry geometry, read_geometry(arguments.geometry));
  GW_ASSIGN_OR_RETURN(const Track track, from_board ? track_of_board(client, arguments, geometry.camera())
                                                    : track_in_file(arguments));
  GW_ASSIGN_OR_RETURN(AxisFit fit, fit_axis(geometry.camera(), track.positions_deg, track.points));
  fit.axis.set_name(track.axis);
  v1::AxisGeometry* place = nullptr;
  for (v1::AxisGeometry& axis : *geometry.mutable_axes()) {
    if (axis.name() == track.axis) place = &axis;
  }
  *(place != nullptr ? place : geometry.add_axes()) = fit.axis;
  GW_RETURN_IF_ERROR(write_output(arguments.output, geometry_text(geometry)));
  if (client.json) {
    print_as_json(arguments.output, track, fit);
  } else {
    print_as_text(client, arguments.output, track, fit);
  }
  return absl::OkStatus();
}

}  // namespace

void add_axis_command(CLI::App& calibrate, Client& client) {
  CLI::App& command = *calibrate.add_subcommand(
      "axis", "Find the turntable's axis in the rig's geometry, from a board on the table.");
  command.footer(
      "Put a ChArUco board on the table, or a column with several, and capture it all round:\n"
      "glasswing capture PLAN --turn 0:345:15 --session board. One white image is enough. Each session is a\n"
      "position; those that show no board are left out. --points reads the places of known points instead, "
      "a\n"
      "line each: the position in degrees, the pixel x y, and the point X Y Z on the object in mm.\n\n"
      "The axis is added to the geometry, with its standard errors, which include the table's wobble\n"
      "(docs/turntable.md).\n\n"
      "Examples:\n"
      "  glasswing calibrate axis --series board --board 7x5:8:6:4 --geometry rig.txtpb -o rig.txtpb\n"
      "  glasswing calibrate axis --points track.txt --axis turn --geometry rig.txtpb -o rig.txtpb");
  auto arguments = std::make_shared<AxisArguments>();
  command.add_option("sessions", arguments->sessions, "sessions that show the board, one for each position")
      ->type_name("SESSION");
  command.add_option("--series", arguments->series, "all sessions of this series (glasswing capture --turn)")
      ->type_name("SERIES");
  command.add_option("--points", arguments->points, "a file with the places of known points")
      ->type_name("FILE")
      ->check(CLI::ExistingFile);
  command
      .add_option(
          "--board", arguments->board,
          "squares across and down, their size and that of the markers, mm: 7x5:8:6; with a number at its "
          "end several boards, numbered through: 7x5:8:6:4")
      ->type_name("BOARD");
  command.add_option("--dictionary", arguments->dictionary, "of the markers: " + dictionary_names())
      ->capture_default_str();
  command.add_option("--axis", arguments->axis, "the stage's axis; default: that of the sessions")
      ->type_name("AXIS");
  command.add_option("--geometry", arguments->geometry, "the rig, from glasswing calibrate geometry")
      ->required()
      ->type_name("FILE")
      ->check(CLI::ExistingFile);
  command.add_option("-o,--output", arguments->output, "the .txtpb file to write, or - for standard output")
      ->required()
      ->check(output_file({".txtpb", kStandardOutput}));
  command.callback([&client, arguments] {
    client.run = [&client, arguments] { return calibrate_axis(client, *arguments); };
  });
}

}  // namespace glasswing
