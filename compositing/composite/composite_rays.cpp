#include "compositing/composite/composite_rays.h"

#include <fmt/format.h>

#include <charconv>
#include <fstream>
#include <numbers>

#include "compositing/composite/backdrop.h"
#include "compositing/picture/picture.h"
#include "core/base/status.h"
#include "core/rays/ray_file.h"
#include "core/rays/surroundings.h"

namespace glasswing {
namespace {

// "DEPTH_MM[:PICTURE]".
struct PlaneArgument {
  double depth_mm = 0.0;
  std::string picture;
};
absl::StatusOr<PlaneArgument> parse_plane(const std::string& text) {
  constexpr double kMaxDepth_mm = 1e7;
  PlaneArgument plane;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, plane.depth_mm);
  if (error == std::errc() && plane.depth_mm > 0.0 && plane.depth_mm <= kMaxDepth_mm &&
      (rest == end || *rest == ':')) {
    if (rest != end) plane.picture = std::string(rest + 1, end);
    if (rest == end || !plane.picture.empty()) return plane;
  }
  return absl::InvalidArgumentError(fmt::format(
      "--plane is \"{}\"; it must be DEPTH_MM or DEPTH_MM:PICTURE, up to {} mm, as 850:harbour.png", text,
      kMaxDepth_mm));
}

absl::Status check_options(const CompositeArguments& arguments) {
  const auto refuse = [&](bool given, std::string_view option) {
    return given ? absl::InvalidArgumentError(
                       fmt::format("{} holds rays, for which {} is not there", arguments.matte, option))
                 : absl::OkStatus();
  };
  const BackgroundArguments& backgrounds = arguments.backgrounds;
  GW_RETURN_IF_ERROR(refuse(!backgrounds.shifts.empty(), "--shift"));
  GW_RETURN_IF_ERROR(refuse(!backgrounds.pans.empty(), "--pan"));
  GW_RETURN_IF_ERROR(refuse(backgrounds.wraps, "--wrap"));
  GW_RETURN_IF_ERROR(refuse(!backgrounds.matches.empty(), "--match"));
  GW_RETURN_IF_ERROR(refuse(!arguments.error.empty(), "--error"));
  GW_RETURN_IF_ERROR(refuse(arguments.fill, "--fill"));
  if (backgrounds.pictures.size() > 1) {
    return absl::InvalidArgumentError(fmt::format(
        "--background is given {} times; rays take one, at the nearest depth that was captured, and any "
        "number of --plane",
        backgrounds.pictures.size()));
  }
  if (arguments.lossless && arguments.environment.empty())
    return absl::InvalidArgumentError("--lossless is about light of an --environment, which is not given");
  if (backgrounds.pictures.empty() && arguments.planes.empty() && arguments.environment.empty())
    return absl::InvalidArgumentError(
        "--background, --plane or --environment must say what stands behind the object");
  return absl::OkStatus();
}

RadianceImage coverage_of(const RayMatte& rays) {
  RadianceImage coverage(rays.width_px(), rays.height_px(), 1);
  for (int y = 0; y < rays.height_px(); ++y) {
    for (int x = 0; x < rays.width_px(); ++x) coverage.at(x, y, 0) = rays.coverage(x, y);
  }
  return coverage;
}

}  // namespace

bool holds_rays(const std::string& file) {
  constexpr size_t kHead = 65536;
  std::ifstream in(file, std::ios::binary);
  std::string head(kHead, '\0');
  in.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(in.gcount());
  return is_ray_file(head);
}

absl::StatusOr<ObjectPicture> composite_of_rays(const CompositeArguments& arguments,
                                                const PictureColours& colours,
                                                const std::function<void(double)>& progress) {
  GW_RETURN_IF_ERROR(check_options(arguments));
  GW_ASSIGN_OR_RETURN(RayMatte rays, read_rays(arguments.matte));
  for (int y = 0; y < rays.height_px(); ++y) {
    for (int x = 0; x < rays.width_px(); ++x) {
      for (float& light : rays.foreground(x, y)) light *= arguments.foreground_gain;
    }
  }
  const absl::StatusOr<const v1::MonitorPose*> pose = nearest_pose(rays);
  if (!pose.ok())
    return absl::Status(pose.status().code(),
                        fmt::format("{}: {}", arguments.matte, std::string(pose.status().message())));
  Surroundings surroundings;
  const auto add_plane = [&](double depth_mm, const std::string& file) -> absl::Status {
    GW_ASSIGN_OR_RETURN(const RadianceImage picture, colours.read(file, arguments.encoding()));
    tell_layer(file);
    surroundings.planes.push_back(picture_at(**pose, depth_mm, picture));
    return absl::OkStatus();
  };
  std::string behind;
  if (!arguments.backgrounds.pictures.empty()) {
    GW_ASSIGN_OR_RETURN(const BackgroundArgument background,
                        parse_background(arguments.backgrounds.pictures[0], rays.metadata.matte()));
    if (background.texture != 0)
      return absl::InvalidArgumentError("--background of rays is a picture on the first monitor");
    behind = background.file;
  }
  bool taken = false;  // the background stands on a --plane
  for (const std::string& text : arguments.planes) {
    GW_ASSIGN_OR_RETURN(const PlaneArgument plane, parse_plane(text));
    if (plane.picture.empty() && behind.empty()) {
      return absl::InvalidArgumentError(
          fmt::format("--plane {} names no picture, and there is no --background to stand there", text));
    }
    taken = taken || plane.picture.empty();
    GW_RETURN_IF_ERROR(add_plane(plane.depth_mm, plane.picture.empty() ? behind : plane.picture));
  }
  if (!behind.empty() && !taken) GW_RETURN_IF_ERROR(add_plane(MonitorPlane(**pose).depth_mm(), behind));
  if (!arguments.environment.empty()) {
    GW_ASSIGN_OR_RETURN(RadianceImage picture, colours.read(arguments.environment, arguments.encoding()));
    tell_layer(arguments.environment);
    for (float& light : picture.samples) light *= arguments.environment_gain;
    surroundings.environment =
        Environment{std::move(picture), arguments.environment_turn_deg * std::numbers::pi / 180.0};
  }
  surroundings.lossless = arguments.lossless;
  GW_ASSIGN_OR_RETURN(const RadianceImage made,
                      composite_rays(rays, surroundings, arguments.exact, 0, progress));
  ObjectPicture picture;
  GW_ASSIGN_OR_RETURN(picture.light, cropped(made, arguments.crop));
  if (arguments.object) {
    GW_ASSIGN_OR_RETURN(picture.coverage, cropped(coverage_of(rays), arguments.crop));
  }
  return picture;
}

}  // namespace glasswing
