#include "client/capture/stage_axes.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "client/cli/rpc.h"
#include "core/base/scanner.h"
#include "core/base/status.h"
#include "glasswing/v1/axis_service.grpc.pb.h"
#include "glasswing/v1/node_service.grpc.pb.h"

namespace glasswing {
namespace {

constexpr double kFinest = 1e-4;  // of positions

double rounded(double position) {
  return std::round(position / kFinest) / (1.0 / kFinest) + 0.0;  // no -0
}

// Digits behind the point that all positions need.
int decimals_of(const std::vector<double>& positions) {
  for (int decimals = 0; decimals < 4; ++decimals) {
    const double scale = std::pow(10.0, decimals);
    const auto fits = [&](double p) {
      return std::abs(p * scale - std::round(p * scale)) < scale * kFinest / 2;
    };
    if (std::ranges::all_of(positions, fits)) return decimals;
  }
  return 4;
}

}  // namespace

absl::StatusOr<std::vector<v1::Axis>> read_axes(const Client& client, const std::string& camera) {
  const Peer<v1::NodeService> server(client.server_title(), client.server);
  GW_ASSIGN_OR_RETURN(const v1::ListNodesResponse listed,
                      call_pages(server, &v1::NodeService::Stub::ListNodes, {}));
  std::vector<v1::Node> cameras;
  for (const v1::Node& node : listed.nodes()) {
    const bool wanted = camera.empty() || node.name() == camera;
    if (node.up() && node.kind() == v1::NODE_KIND_CAMERA && wanted) cameras.push_back(node);
  }
  if (cameras.empty())
    return absl::UnavailableError(camera.empty() ? "no camera node is up; start glasswing-camera"
                                                 : fmt::format("camera node \"{}\" is not up", camera));
  if (cameras.size() > 1) {
    std::vector<std::string> names;
    for (const v1::Node& node : cameras) names.push_back(node.name());
    return absl::FailedPreconditionError(
        fmt::format("the rig has several cameras, {}; name the one with the stage", fmt::join(names, ", ")));
  }
  return read_axes_at(cameras[0].address());
}

absl::StatusOr<std::vector<v1::Axis>> read_axes_at(const std::string& address) {
  const Peer<v1::AxisService> stage("camera node at " + address, address);
  const absl::StatusOr<v1::GetAxesResponse> found = call(stage, &v1::AxisService::Stub::GetAxes, {});
  if (absl::IsUnimplemented(found.status())) return std::vector<v1::Axis>();
  GW_RETURN_IF_ERROR(found.status());
  return std::vector<v1::Axis>(found->axes().begin(), found->axes().end());
}

absl::StatusOr<v1::Axis> find_axis(const std::string& named, const std::vector<v1::Axis>& axes,
                                   const std::string& unit) {
  std::vector<std::string> names;
  std::vector<v1::Axis> suited;
  for (const v1::Axis& axis : axes) {
    names.push_back(axis.name());
    if (axis.name() == named) return axis;
    if (axes.size() == 1 || unit.empty() || axis.unit() == unit) suited.push_back(axis);
  }
  if (axes.empty()) {
    return absl::FailedPreconditionError(
        "the camera node's stage has no axis that could move the object; glasswing-camera --axis turn=0:360 "
        "gives it one (docs/turntable.md)");
  }
  if (!named.empty())
    return absl::NotFoundError(
        fmt::format("the stage has no axis \"{}\"; it has: {}", named, fmt::join(names, ", ")));
  if (suited.size() == 1) return suited[0];
  return absl::FailedPreconditionError(
      fmt::format("the stage has several axes, {}; name one, as {}=30", fmt::join(names, ", "), names[0]));
}

absl::StatusOr<Poses> parse_poses(std::string_view option, const std::string& text) {
  Poses poses;
  std::string_view rest = text;
  if (const size_t equals = rest.find('='); equals != std::string_view::npos) {
    poses.axis = rest.substr(0, equals);
    rest.remove_prefix(equals + 1);
  }
  const auto wrong = [&](const std::string& what) {
    return absl::InvalidArgumentError(fmt::format(
        "{} is \"{}\"; {}: FIRST:LAST:STEP, as 0:350:10, or a list, as 0,90,180; of one of several axes "
        "turn=0:350:10",
        option, text, what));
  };
  double first = 0.0, last = 0.0, step = 0.0;
  if (Scanner(rest).number(first).then(":").number(last).then(":").number(step).done()) {
    if (!((last - first) * step >= 0.0) || std::abs(step) < kFinest)
      return wrong("the step must lead to LAST");
    const double count = std::floor((last - first) / step + 1e-9) + 1.0;
    if (count > kMaxPoses) return wrong(fmt::format("a series has at most {} poses", kMaxPoses));
    for (int i = 0; i < count; ++i) poses.positions.push_back(rounded(first + i * step));
    return poses;
  }
  Scanner scan(rest);
  do {
    if (!poses.positions.empty()) scan.then(",");
    poses.positions.push_back(0.0);
    scan.number(poses.positions.back());
  } while (scan.more() && poses.positions.size() < kMaxPoses);
  if (!scan.done()) return wrong("it must be");
  for (double& position : poses.positions) position = rounded(position);
  return poses;
}

absl::Status check_poses(std::string_view option, const Poses& poses, const v1::Axis& axis) {
  std::set<double> stands;
  for (const double position : poses.positions) {
    if (!(position >= axis.min() && position <= axis.max())) {
      return absl::InvalidArgumentError(fmt::format("{} has {}; axis \"{}\" takes {} to {} {}", option,
                                                    position, axis.name(), axis.min(), axis.max(),
                                                    axis.unit()));
    }
    const bool turns = axis.unit() == "deg";
    const double once = turns ? rounded(std::fmod(std::fmod(position, 360.0) + 360.0, 360.0)) : position;
    if (stands.insert(turns && once >= 360.0 ? 0.0 : once).second) continue;
    return absl::InvalidArgumentError(
        fmt::format("{} has {} {}, where the object stands as at another of its positions; end before it",
                    option, position, axis.unit()));
  }
  return absl::OkStatus();
}

std::vector<std::string> names_of_poses(const std::string& series, const std::vector<double>& positions) {
  const int decimals = decimals_of(positions);
  size_t width = 0;
  for (const double position : positions)
    width = std::max(width, fmt::format("{:.{}f}", position, decimals).size());
  std::vector<std::string> names;
  for (const double position : positions)
    names.push_back(fmt::format("{}-{:0{}.{}f}", series, position, width, decimals));
  return names;
}

}  // namespace glasswing
