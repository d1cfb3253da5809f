#include "core/rays/surroundings.h"

#include <Eigen/Dense>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <mutex>
#include <numbers>

#include "core/base/for_rows.h"
#include "core/base/status.h"
#include "core/composite/compositor.h"
#include "core/composite/footprint_rows.h"
#include "core/footprint/normal_rectangle.h"
#include "core/image/image_file.h"
#include "core/radiometry/primary_mix.h"

namespace glasswing {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kSmallWidth = 256, kSmallHeight = 128;
constexpr int kMaxFaceSide = 4096;
constexpr int kBlockRows = 16;
constexpr double kPi = std::numbers::pi;

Vector3d direction_of(double lon, double th) {
  return {std::sin(th) * std::sin(lon), -std::cos(th), std::sin(th) * std::cos(lon)};
}

// The pixel that a direction of any length sees.
const float* pixel_at(const RadianceImage& map, const Vector3d& direction) {
  const double lon = std::atan2(direction.x(), direction.z());
  const double th = std::acos(std::clamp(-direction.y() / direction.norm(), -1.0, 1.0));
  const int u = std::min(static_cast<int>((lon / (2.0 * kPi) + 0.5) * map.width_px), map.width_px - 1);
  const int v = std::min(static_cast<int>(th / kPi * map.height_px), map.height_px - 1);
  return &map.samples[map.index(std::max(u, 0), v, 0)];
}

RadianceImage drawn_face(const RadianceImage& map, int face, int side) {
  constexpr int kSub = 4;  // samples along a pixel's side
  RadianceImage drawn(side, side);
  for_rows(side, 0, [&](int first, int end) {
    for (int y = first; y < end; ++y) {
      for (int x = 0; x < side; ++x) {
        std::array<float, kChannels> sum{};
        for (int s = 0; s < kSub * kSub; ++s) {
          const auto place = [&](int pixel, int sub) {
            return ((pixel + (sub + 0.5) / kSub) / side * 2.0 - 1.0) * EnvironmentMap::kHalfSide;
          };
          const float* light = pixel_at(map, cube_direction(face, place(x, s % kSub), place(y, s / kSub)));
          for (size_t c = 0; c < kChannels; ++c) sum[c] += light[c];
        }
        for (int c = 0; c < kChannels; ++c) drawn.at(x, y, c) = sum[c] / static_cast<float>(kSub * kSub);
      }
    }
  });
  return drawn;
}

// Means over solid angle.
RadianceImage shrunk(const RadianceImage& map) {
  const int width = std::min(kSmallWidth, map.width_px), height = std::min(kSmallHeight, map.height_px);
  RadianceImage small(width, height);
  std::vector<double> sums(small.samples.size()), weights(small.samples.size() / kChannels);
  for (int v = 0; v < map.height_px; ++v) {
    const double weight = std::sin(kPi * (v + 0.5) / map.height_px);
    const int y = std::min(static_cast<int>((v + 0.5) * height / map.height_px), height - 1);
    for (int u = 0; u < map.width_px; ++u) {
      const int x = std::min(static_cast<int>((u + 0.5) * width / map.width_px), width - 1);
      const size_t at = small.index(x, y, 0);
      weights[at / kChannels] += weight;
      for (int c = 0; c < kChannels; ++c) sums[at + static_cast<size_t>(c)] += weight * map.at(u, v, c);
    }
  }
  for (size_t i = 0; i < sums.size(); ++i)
    small.samples[i] = static_cast<float>(sums[i] / weights[i / kChannels]);
  return small;
}

// The map's pixel as seen ahead, halved where that is affordable.
int face_side(const RadianceImage& map) {
  constexpr int kMaxDoubled = 2048;
  const double pixels = 2.0 * EnvironmentMap::kHalfSide * map.width_px / (2.0 * kPi);
  return std::clamp(static_cast<int>(std::ceil(map.width_px <= kMaxDoubled ? 2.0 * pixels : pixels)), 16,
                    kMaxFaceSide);
}

Mode mode_of(const PlaneFootprint& footprint, double weight, int texture) {
  return {.weight = static_cast<float>(weight),
          .x_px = static_cast<float>(footprint.centre_px.x()),
          .y_px = static_cast<float>(footprint.centre_px.y()),
          .xx_px2 = static_cast<float>(footprint.covariance_px2(0, 0)),
          .xy_px2 = static_cast<float>(footprint.covariance_px2(0, 1)),
          .yy_px2 = static_cast<float>(footprint.covariance_px2(1, 1)),
          .texture = texture};
}

// The share of a footprint on a picture.
double share_on(const PlaneFootprint& footprint, const RadianceImage& picture) {
  constexpr double kMinVariance = 1e-4;  // px^2: narrower ones are points beside a pixel
  const double x = footprint.centre_px.x(), y = footprint.centre_px.y();
  const double xx = std::max(footprint.covariance_px2(0, 0), kMinVariance);
  const double yy = std::max(footprint.covariance_px2(1, 1), kMinVariance);
  const double limit = 0.999 * std::sqrt(xx * yy);
  const double xy = std::clamp(footprint.covariance_px2(0, 1), -limit, limit);
  return std::clamp(
      NormalOnRectangles({x, y, xx, xy, yy})
          .share({0.0, 0.0, static_cast<double>(picture.width_px), static_cast<double>(picture.height_px)})
          .share,
      0.0, 1.0);
}

class Projector {
 public:
  Projector(const RayMatte& rays, const Surroundings& surroundings, const EnvironmentMap* environment,
            const PrimaryMix& mix, const v1::MatteMetadata& metadata)
      : rays_(rays), surroundings_(surroundings), environment_(environment), mix_(mix), metadata_(metadata) {
    for (size_t p = 0; p < surroundings.planes.size(); ++p) order_.push_back(p);
    std::ranges::stable_sort(order_, [&](size_t a, size_t b) {
      return surroundings.planes[a].plane.depth_mm() < surroundings.planes[b].plane.depth_mm();
    });
  }

  // Rows [first, end) as a matte of planes and faces.
  Matte rows(int first, int end) const {
    const auto targets = static_cast<int>(order_.size()) + (environment_ != nullptr ? 1 : 0);
    Matte matte(0, first, rays_.width_px(), end - first, std::max(1, rays_.rays_per_channel() * targets));
    matte.metadata = metadata_;
    for (int y = first; y < end; ++y) {
      for (int x = 0; x < rays_.width_px(); ++x) {
        std::array<float, kChannels>& foreground = matte.foreground(x, y - first);
        foreground = rays_.foreground(x, y);
        matte.coverage(x, y - first) = rays_.coverage(x, y);
        for (int c = 0; c < kChannels; ++c) {
          double seen = 0.0;
          size_t used = 0;
          const std::span<Mode> modes = matte.modes(x, y - first, c);
          for (const Ray& ray : rays_.rays(x, y, c)) {
            if (!(ray.weight > 0.0f)) continue;
            seen += static_cast<double>(ray.weight);
            add(ray, c, modes, used, foreground[c]);
          }
          const double unseen = 1.0 - seen;
          if (surroundings_.lossless && environment_ != nullptr && rays_.coverage(x, y) > 0.0f &&
              unseen > 0.0) {
            foreground[c] += static_cast<float>(unseen) * mix_.seen(0, environment_->mean())[c];
          }
        }
      }
    }
    return matte;
  }

 private:
  void add(const Ray& ray, int channel, std::span<Mode> modes, size_t& used, float& light) const {
    // The camera's own rays and those of the object start before all planes; others start at the nearest
    // monitor, and planes may stand before it.
    const bool forward = ray.state == RayState::kStraight || ray.state == RayState::kFarLight;
    const double from_mm = forward ? 0.0 : -std::numeric_limits<double>::infinity();
    double left = ray.weight;
    PlaneFootprint footprint;
    for (size_t i = 0; i < order_.size(); ++i) {
      const PlanePicture& plane = surroundings_.planes[order_[i]];
      if (!meet_plane(ray, plane.plane, from_mm, footprint)) continue;
      modes[used++] = mode_of(footprint, left, static_cast<int>(order_[i]));
      const bool is_last = i + 1 == order_.size() && environment_ == nullptr;
      if (!is_last) left *= 1.0 - share_on(footprint, plane.picture);
      constexpr double kNothing = 1e-6;
      if (left < kNothing) return;
    }
    if (environment_ == nullptr) return;
    int face = 0;
    if (environment_->on_face(ray, face, footprint)) {
      modes[used++] = mode_of(footprint, left, static_cast<int>(order_.size()) + face);
    } else {
      light += static_cast<float>(left) * mix_.seen(0, environment_->wide(ray))[channel];
    }
  }

  const RayMatte& rays_;
  const Surroundings& surroundings_;
  const EnvironmentMap* environment_;
  const PrimaryMix& mix_;
  const v1::MatteMetadata& metadata_;
  std::vector<size_t> order_;
};

}  // namespace

EnvironmentMap::EnvironmentMap(const Environment& environment)
    : cos_turn_(std::cos(environment.turn_rad)),
      sin_turn_(std::sin(environment.turn_rad)),
      side_px_(face_side(environment.picture)),
      small_(shrunk(environment.picture)) {
  for (int face = 0; face < kCubeFaces; ++face)
    faces_.push_back(drawn_face(environment.picture, face, side_px_));
  double total = 0.0;
  std::array<double, kChannels> sums{};
  for (int v = 0; v < small_.height_px; ++v) {
    const double weight = std::sin(kPi * (v + 0.5) / small_.height_px);
    total += weight * small_.width_px;
    for (int u = 0; u < small_.width_px; ++u) {
      for (int c = 0; c < kChannels; ++c) sums[c] += weight * small_.at(u, v, c);
    }
  }
  for (size_t c = 0; c < kChannels; ++c) mean_[c] = static_cast<float>(sums[c] / total);
}

// The turned environment shows in a direction what the map shows one turn back.
Vector3d EnvironmentMap::in_map(const Eigen::Vector3f& direction) const {
  const Vector3d d = direction.cast<double>();
  return {cos_turn_ * d.x() - sin_turn_ * d.z(), d.y(), sin_turn_ * d.x() + cos_turn_ * d.z()};
}

bool EnvironmentMap::on_face(const Ray& ray, int& face, PlaneFootprint& footprint) const {
  double trace = 0.0;
  for (const Eigen::Vector3f& spread : ray.direction_spread)
    trace += static_cast<double>(spread.squaredNorm());
  if (trace > kMaxFaceSd * kMaxFaceSd) return false;
  footprint = on_cube({.half_side = kHalfSide, .side_px = side_px_}, in_map(ray.direction),
                      {in_map(ray.direction_spread[0]), in_map(ray.direction_spread[1])}, face);
  return true;
}

std::array<float, kChannels> EnvironmentMap::wide(const Ray& ray) const {
  const Vector3d direction = in_map(ray.direction).normalized();
  const Vector3d right = direction.unitOrthogonal(), down = direction.cross(right);
  Matrix2d covariance = Matrix2d::Identity() * std::pow(kPi / small_.height_px, 2) / 12.0;
  for (const Eigen::Vector3f& spread : ray.direction_spread) {
    const Vector3d turn = in_map(spread);
    const Vector2d across(right.dot(turn), down.dot(turn));
    covariance += across * across.transpose();
  }
  const Matrix2d inverse = covariance.inverse();
  constexpr double kReach = 4.0;  // sigmas
  const double reach = kReach * std::sqrt(covariance.trace());
  const double th = std::acos(std::clamp(-direction.y(), -1.0, 1.0));
  const int first = std::max(static_cast<int>((th - reach) / kPi * small_.height_px), 0);
  const int last = std::min(static_cast<int>((th + reach) / kPi * small_.height_px), small_.height_px - 1);
  const double min_cosine = std::cos(std::min(reach, kPi));
  std::array<double, kChannels> sums{};
  double total = 0.0;
  for (int v = first; v <= last; ++v) {
    const double row = kPi * (v + 0.5) / small_.height_px;
    for (int u = 0; u < small_.width_px; ++u) {
      const Vector3d to = direction_of(2.0 * kPi * ((u + 0.5) / small_.width_px - 0.5), row);
      const double cosine = direction.dot(to);
      if (cosine < min_cosine) continue;
      Vector2d across(right.dot(to), down.dot(to));
      const double sine = across.norm(), angle = std::atan2(sine, cosine);
      const double stretch = sine > 1e-12 ? angle / sine : 1.0;  // of the tangent plane against the sphere
      across *= stretch;
      const double weight = std::exp(-0.5 * across.dot(inverse * across)) * std::sin(row) * stretch;
      total += weight;
      for (int c = 0; c < kChannels; ++c) sums[c] += weight * small_.at(u, v, c);
    }
  }
  if (!(total > 0.0)) return mean_;
  std::array<float, kChannels> light{};
  for (size_t c = 0; c < kChannels; ++c) light[c] = static_cast<float>(sums[c] / total);
  return light;
}

absl::StatusOr<const v1::MonitorPose*> nearest_pose(const RayMatte& rays) {
  const v1::RayMetadata& metadata = rays.metadata;
  if (metadata.poses().empty() || metadata.matte().monitors().empty())
    return absl::DataLossError("the rays name no pose or no monitor");
  return find_pose(metadata.geometry(), metadata.poses(0), metadata.matte().monitors(0).name());
}

PlanePicture picture_at(const v1::MonitorPose& pose, double depth_mm, const RadianceImage& picture) {
  return {MonitorPlane(pose).at_depth(depth_mm), resized(picture, pose.width_px(), pose.height_px())};
}

absl::StatusOr<RadianceImage> composite_rays(const RayMatte& rays, const Surroundings& surroundings,
                                             bool exact, int thread_count,
                                             const std::function<void(double)>& progress) {
  // A matte of the planes and the environment's faces instead of the monitors.
  v1::MatteMetadata metadata = rays.metadata.matte();
  metadata.clear_monitors();
  metadata.clear_crosstalk();
  std::vector<RadianceImage> pictures;
  const auto add = [&](const RadianceImage& picture) {
    v1::Monitor& monitor = *metadata.add_monitors();
    monitor.set_width_px(picture.width_px);
    monitor.set_height_px(picture.height_px);
    if (rays.metadata.matte().crosstalk_size() > 0)
      *metadata.add_crosstalk() = rays.metadata.matte().crosstalk(0);
    pictures.push_back(picture);
  };
  for (const PlanePicture& plane : surroundings.planes) add(plane.picture);
  std::optional<EnvironmentMap> environment;
  if (surroundings.environment) {
    environment.emplace(*surroundings.environment);
    for (const RadianceImage& face : environment->faces()) add(face);
  }
  GW_ASSIGN_OR_RETURN(const PrimaryMix mix, PrimaryMix::create(metadata));
  const Projector projector(rays, surroundings, environment ? &*environment : nullptr, mix, metadata);
  std::vector<FootprintTexture> textures = footprint_textures(metadata);
  for (FootprintTexture& texture : textures)
    texture.level_count = static_cast<int>(texture.shape.levels().size());
  const BackgroundSamples samples(textures, mix, exact ? std::vector<RadianceImage>() : pictures,
                                  thread_count);
  RadianceImage out(rays.width_px(), rays.height_px());
  const size_t row_length = static_cast<size_t>(out.width_px) * kChannels;
  const int blocks = (out.height_px + kBlockRows - 1) / kBlockRows;
  std::atomic<int> next = 0;
  std::mutex mutex;
  int done = 0;
  absl::Status failed;
  for_rows(blocks, thread_count, [&](int, int) {
    FootprintRows rows(textures, false, kMaxTiles);
    FootprintRow row;
    for (int block = next++; block < blocks; block = next++) {
      const int first = block * kBlockRows, end = std::min(first + kBlockRows, out.height_px);
      const Matte matte = projector.rows(first, end);
      if (exact) {
        const absl::StatusOr<RadianceImage> made = composite(matte, pictures, 1);
        if (!made.ok()) {
          const std::lock_guard lock(mutex);
          failed.Update(made.status());
          return;
        }
        std::ranges::copy(made->samples, out.samples.begin() + first * row_length);
      } else {
        for (int y = first; y < end; ++y) {
          rows.prepare(matte, y - first, row);
          samples.composite(row,
                            std::span(out.samples).subspan(static_cast<size_t>(y) * row_length, row_length));
        }
      }
      const std::lock_guard lock(mutex);
      ++done;
      if (progress) progress(static_cast<double>(done) / blocks);
    }
  });
  GW_RETURN_IF_ERROR(failed);
  return out;
}

}  // namespace glasswing
