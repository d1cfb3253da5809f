#include "client/capture/rail_positions.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "client/cli/rpc.h"
#include "core/base/status.h"
#include "core/cli/progress.h"
#include "glasswing/v1/rig_service.grpc.pb.h"

namespace glasswing {
namespace {

constexpr std::chrono::seconds kMoveTimeout(90);  // the rail may take a minute

}  // namespace

absl::StatusOr<RailPositions> parse_rail_positions(std::string_view option, const std::string& text) {
  RailPositions positions;
  std::string_view rest = text;
  if (const size_t colon = rest.find(':'); colon != std::string_view::npos) {
    positions.monitor = rest.substr(0, colon);
    rest.remove_prefix(colon + 1);
  }
  for (bool more = true; more;) {
    const size_t comma = rest.find(',');
    more = comma != std::string_view::npos;
    const std::string_view number = rest.substr(0, comma);
    if (more) rest.remove_prefix(comma + 1);
    double mm = 0.0;
    const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), mm);
    if (error != std::errc() || end != number.data() + number.size() || !std::isfinite(mm)) {
      return absl::InvalidArgumentError(
          fmt::format("{} is \"{}\"; it must be mm separated by commas, such as 200,251.2, or for one of "
                      "several monitors "
                      "MONITOR:MM,MM, such as back:200,251.2",
                      option, text));
    }
    if (std::ranges::count(positions.mm, mm) > 0)
      return absl::InvalidArgumentError(fmt::format("{} is \"{}\"; it has {} twice", option, text, mm));
    positions.mm.push_back(mm);
  }
  return positions;
}

absl::StatusOr<std::string> monitor_to_move(const std::string& named, const RigView& rig,
                                            const std::vector<std::string>& planned) {
  std::vector<std::string> all, railed;
  for (const v1::Monitor& monitor : rig.monitors) all.push_back(monitor.name());
  for (const auto& [monitor, rail] : rig.rails) railed.push_back(monitor);
  if (!named.empty()) {
    if (std::ranges::count(all, named) > 0) return named;
    return absl::NotFoundError(
        fmt::format("there is no monitor \"{}\"; there are: {}", named, fmt::join(all, ", ")));
  }
  if (all.empty()) return absl::UnavailableError("no display node is up; start glasswing-display");
  for (const std::vector<std::string>* names : {&std::as_const(railed), &planned, &std::as_const(all)}) {
    if (names->size() == 1) return names->front();
  }
  return absl::FailedPreconditionError(
      fmt::format("the rig has several monitors, {}; name the one to move, such as {}:200",
                  fmt::join(all, ", "), all.front()));
}

absl::Status move_along_rail(const Client& client, const std::string& monitor, double position_mm) {
  const Waiting waiting(fmt::format("moving monitor {} to {} mm", monitor, position_mm));
  const Peer<v1::RigService> server(client.server_title(), client.server);
  v1::PlaceMonitorRequest request;
  request.set_monitor(monitor);
  request.set_position_mm(position_mm);
  return call(server, &v1::RigService::Stub::PlaceMonitor, request, kMoveTimeout).status();
}

}  // namespace glasswing
