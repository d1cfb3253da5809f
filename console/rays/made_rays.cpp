#include "console/rays/made_rays.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/geometry/rig_geometry.h"
#include "core/matte/matte_file.h"
#include "core/rays/match_rays.h"
#include "core/rays/ray_file.h"
#include "core/web/web_description.h"
#include "core/web/web_matte.h"
#include "core/web/web_rays.h"

namespace glasswing {
namespace {

struct MadeRays {
  RayMatte rays;
  int step = 1;  // of so many pixels along either side one is in them
};

std::int64_t modes_in_object(const Matte& matte) {
  std::int64_t count = 0;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      if (!(matte.coverage(x, y) > 0.0f)) continue;
      for (int c = 0; c < kChannels; ++c) {
        count +=
            std::ranges::count_if(matte.modes(x, y, c), [](const Mode& mode) { return mode.weight > 0.0f; });
      }
    }
  }
  return count;
}

absl::StatusOr<Matte> matte_in(const RayDepth& depth) {
  absl::StatusOr<Matte> matte = decode_matte(depth.file);
  if (matte.ok()) return matte;
  return absl::Status(matte.status().code(), fmt::format("the matte of {}: {}", depth.session,
                                                         std::string(matte.status().message())));
}

absl::StatusOr<MadeRays> made_rays(v1::RigGeometry geometry, const std::array<RayDepth, 2>& depths,
                                   const RayLimits& limits) {
  GW_ASSIGN_OR_RETURN(const Matte near, matte_in(depths[0]));
  GW_ASSIGN_OR_RETURN(const Matte far, matte_in(depths[1]));
  const std::int64_t modes = modes_in_object(near) + modes_in_object(far);
  if (modes > limits.modes) {
    return absl::ResourceExhaustedError(fmt::format(
        "the object has {} modes in both mattes; the console matches up to {}, and glasswing rays {} "
        "{} any number",
        modes, limits.modes, depths[0].session, depths[1].session));
  }
  const int step = std::max(near.metadata.sampling_px(), 1);
  *geometry.mutable_camera() = sampled_camera(geometry.camera(), step);
  GW_ASSIGN_OR_RETURN(RayMatte rays, match_rays(near, far, geometry, {depths[0].pose, depths[1].pose}));
  return MadeRays{std::move(rays), step};
}

nlohmann::ordered_json counts_json(const v1::RayCounts& counts) {
  const auto one = [](std::int64_t count, double light) {
    return nlohmann::ordered_json{{"rays", count}, {"light", light}};
  };
  return {{"matched", one(counts.matched(), counts.matched_weight())},
          {"ambiguous", one(counts.ambiguous(), counts.ambiguous_weight())},
          {"extrapolated", one(counts.extrapolated(), counts.extrapolated_weight())},
          {"unknown", one(counts.unknown(), counts.unknown_weight())}};
}

nlohmann::ordered_json sampled_json(const std::vector<Ray>& rays) {
  nlohmann::ordered_json all = nlohmann::json::array();
  for (const Ray& ray : rays) {
    const Eigen::Vector3f &from = ray.origin_mm, &along = ray.direction;
    all.push_back({static_cast<int>(ray.state), ray.weight, from.x(), from.y(), from.z(), along.x(),
                   along.y(), along.z()});
  }
  return all;
}

}  // namespace

RayLimits ray_limits(std::int64_t memory_bytes) {
  constexpr double kBytesAPixel = 7600.0;  // with the most modes
  const RayLimits most;
  const double share =
      static_cast<double>(memory_bytes) / 8.0 / (kBytesAPixel * static_cast<double>(most.pixels));
  if (share >= 1.0) return most;
  return {.pixels = static_cast<std::int64_t>(share * static_cast<double>(most.pixels)),
          .modes = static_cast<std::int64_t>(share * static_cast<double>(most.modes))};
}

absl::StatusOr<v1::RigGeometry> geometry_in(const std::string& text) {
  GW_ASSIGN_OR_RETURN(v1::RigGeometry geometry, parse_geometry(text, "the geometry"));
  // What is answered is JSON. Escapes of protobuf's text may be any bytes.
  for (const v1::MonitorPose& pose : geometry.monitors()) {
    if (!is_utf8(pose.name()) || !is_utf8(pose.monitor()))
      return absl::InvalidArgumentError(
          fmt::format("the geometry: the name of a pose or of its monitor, \"{}\", is not UTF-8",
                      printable(is_utf8(pose.name()) ? pose.monitor() : pose.name())));
  }
  if (std::ranges::all_of(geometry.warnings(), [](const std::string& each) { return is_utf8(each); }))
    return geometry;
  return absl::InvalidArgumentError("the geometry: a warning is not UTF-8");
}

absl::StatusOr<std::string> rays_to_play(const v1::RigGeometry& geometry,
                                         const std::array<RayDepth, 2>& depths, const RayLimits& limits,
                                         bool lossless) {
  GW_ASSIGN_OR_RETURN(const MadeRays made, made_rays(geometry, depths, limits));
  const v1::RayMetadata& metadata = made.rays.metadata;
  const Matte directions = web_matte_of(made.rays, 1, lossless);
  GW_ASSIGN_OR_RETURN(const WebMatte web, encode_web_matte(directions));
  nlohmann::ordered_json description =
      describe_web_matte(metadata.matte().session(), directions.metadata, made.step, web);
  description["environments"] = nlohmann::json::array();
  description["view_deg"] = view_deg(metadata.geometry().camera());
  const nlohmann::ordered_json told = {
      {"description", description},
      {"poses", std::vector<std::string>(metadata.poses().begin(), metadata.poses().end())},
      {"counts", counts_json(metadata.counts())},
      {"sampled", sampled_json(sampled_rays(made.rays, kMaxSampledRays))}};
  return told.dump() + "\n" + web.bytes;
}

absl::StatusOr<std::string> file_of_rays(const v1::RigGeometry& geometry,
                                         const std::array<RayDepth, 2>& depths, const RayLimits& limits) {
  GW_ASSIGN_OR_RETURN(const MadeRays made, made_rays(geometry, depths, limits));
  if (made.step == 1) return encode_rays(made.rays);
  return absl::FailedPreconditionError(fmt::format(
      "the camera's picture has more than the {} pixels that the console can process; use glasswing rays {} "
      "{}",
      limits.pixels, depths[0].session, depths[1].session));
}

}  // namespace glasswing
