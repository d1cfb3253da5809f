#include "console/routes/ray_routes.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>
#include <unistd.h>

#include <array>
#include <memory>
#include <vector>

#include "console/http/http_host.h"
#include "console/routes/fetched_matte.h"
#include "core/base/status.h"
#include "core/process/low_priority.h"

namespace glasswing {
namespace {

using httplib::Request;
using httplib::Response;

// Still without files.
absl::StatusOr<std::array<RayDepth, 2>> depths_in(const Request& request) {
  std::array<RayDepth, 2> depths;
  const std::array<const char*, 2> names = {"near", "far"};
  for (size_t i = 0; i < 2; ++i) {
    depths[i].session = request.get_param_value(names[i]);
    depths[i].pose = request.get_param_value(fmt::format("{}_pose", names[i]));
    if (depths[i].session.empty())
      return absl::InvalidArgumentError(fmt::format("{} is \"\"; it must name a session", names[i]));
    if (depths[i].pose.empty()) depths[i].pose = depths[i].session;
  }
  if (depths[0].session != depths[1].session) return depths;
  return absl::InvalidArgumentError(
      fmt::format("near and far are both \"{}\"; they must be two sessions, of monitors at two depths",
                  depths[0].session));
}

absl::Status check_pixel_count(const v1::Session& session, const v1::CameraGeometry& camera) {
  const std::int64_t expected = std::int64_t{camera.width_px()} * camera.height_px();
  if (session.pixel_count() == 0 || session.pixel_count() == expected) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("the pictures of {} have {} pixels; the geometry's camera has {}x{}, which are {}",
                  session.name(), session.pixel_count(), camera.width_px(), camera.height_px(), expected));
}

std::int64_t memory_bytes() {
  return std::int64_t{::sysconf(_SC_PHYS_PAGES)} * ::sysconf(_SC_PAGESIZE);
}

}  // namespace

RayRoutes::RayRoutes(const ServerLink& server) : server_(server), limits_(ray_limits(memory_bytes())) {}

void RayRoutes::read_geometry(const Login&, const Request&, const std::string& text,
                              Response& response) const {
  const absl::StatusOr<v1::RigGeometry> geometry = geometry_in(text);
  if (!geometry.ok()) return refuse(response, geometry.status());
  std::string json;
  if (!google::protobuf::util::MessageToJsonString(*geometry, &json).ok())
    return refuse(response, absl::InvalidArgumentError("the geometry's text is not UTF-8"));
  response.set_content(json, "application/json");
}

void RayRoutes::make(const Login& login, const Request& request, const std::string& geometry,
                     Response& response) const {
  const absl::StatusOr<std::string> bytes = made(login, request, geometry, false);
  if (!bytes.ok()) return refuse(response, bytes.status());
  response.set_content(*bytes, "application/octet-stream");
}

void RayRoutes::make_file(const Login& login, const Request& request, const std::string& geometry,
                          Response& response) const {
  const absl::StatusOr<std::string> bytes = made(login, request, geometry, true);
  if (!bytes.ok()) return refuse(response, bytes.status());
  response.set_content(*bytes, "image/x-exr");
}

absl::StatusOr<std::string> RayRoutes::made(const Login& login, const Request& request,
                                            const std::string& text, bool as_file) const {
  GW_ASSIGN_OR_RETURN(const v1::RigGeometry geometry, geometry_in(text));
  GW_ASSIGN_OR_RETURN(auto depths, depths_in(request));
  const auto place = std::shared_ptr<void>(nullptr, [this](void*) { --makes_; });
  if (++makes_ > kMaxMakes) {
    return absl::ResourceExhaustedError(
        fmt::format("{} pages are already waiting for rays; try again in a minute", kMaxMakes));
  }
  std::vector<FetchedMatte> files;
  for (RayDepth& depth : depths) {
    GW_ASSIGN_OR_RETURN(const v1::Session session, server_.session(login, depth.session));
    GW_RETURN_IF_ERROR(check_pixel_count(session, geometry.camera()));
    v1::FetchMatteRequest wanted;
    wanted.set_name(depth.session);
    wanted.set_max_pixels(limits_.pixels);
    GW_ASSIGN_OR_RETURN(FetchedMatte file, fetch_matte(server_, login, wanted));
    depth.file = files.emplace_back(std::move(file)).file->bytes();
  }
  const std::lock_guard lock(making_);
  absl::StatusOr<std::string> made = absl::InternalError("not made");
  run_at_low_priority([&] {
    made = as_file ? file_of_rays(geometry, depths, limits_)
                   : rays_to_play(geometry, depths, limits_, request.has_param("lossless"));
  });
  return made;
}

}  // namespace glasswing
