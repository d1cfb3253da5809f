#include "core/rays/match_rays.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/base/for_rows.h"
#include "core/base/status.h"
#include "core/footprint/footprint.h"
#include "core/footprint/seen_part.h"
#include "core/rays/path_fit.h"

namespace glasswing {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kMinWeight = 1e-4;  // of a mode, below which it is left out
constexpr float kMaxWeight = 1.05f;  // no object has more
constexpr double kUncut = 0.25;      // sigmas inside its monitor, where 60 % of a mode's light were seen
constexpr double kNearPx = 4.0;      // as LightPaths
constexpr double kMaxCost = 1.0;     // of a pair
constexpr double kStrayLight = 0.1;  // of a mode's light, that may be left without a partner
constexpr double kSameCost = 0.1;    // of two pairs of which either may be right
constexpr int kPasses = 4;
constexpr float kMaxLengthError = 1e-4f;  // of a direction

// A mode on one monitor, as the matching needs it.
struct Place {
  double weight = 0.0;
  Vector2d at;  // px
  Matrix2d covariance;
  double width = 0.0, sd = 0.0;  // px
  int texture = 0;
};
struct Pair {
  size_t near = 0, far = 0;
  double light = 0.0;
  bool ambiguous = false;
};
struct Node {
  std::vector<Place> near, far;
  std::vector<Pair> pairs;
};

Place place_of(const Mode& mode) {
  Place place{.weight = mode.weight,
              .at = {mode.x_px, mode.y_px},
              .covariance = Matrix2d::Zero(),
              .width = 0.0,
              .sd = mode.centre_sd_px,
              .texture = mode.texture};
  place.covariance << static_cast<double>(mode.xx_px2), static_cast<double>(mode.xy_px2),
      static_cast<double>(mode.xy_px2), static_cast<double>(mode.yy_px2);
  place.width = std::sqrt(std::max(0.5 * place.covariance.trace(), 0.0));
  return place;
}

// How far a mode's centre lies inside its monitor, in its sigmas; below 0: beyond it.
double inside(const Mode& mode, const MonitorExtent& extent) {
  const auto along = [](float at_px, float variance_px2, double size_px) {
    constexpr double kMinSigma_px = 1e-3;
    const double at = at_px, sigma_px = std::sqrt(static_cast<double>(variance_px2));
    return std::min(at, size_px - at) / std::max(sigma_px, kMinSigma_px);
  };
  return std::min(along(mode.x_px, mode.xx_px2, extent.width_px),
                  along(mode.y_px, mode.yy_px2, extent.height_px));
}

// Whether the other depth has a mode that may be the same light, but none of about this weight.
bool is_contradicted(const Mode& mode, std::span<const Mode> others) {
  constexpr float kSame = 0.1f, kComparable = 0.3f;
  bool comparable = false;
  for (const Mode& other : others) {
    if (other.texture != mode.texture) continue;
    if (std::abs(other.weight - mode.weight) < kSame * mode.weight) return false;
    comparable |= other.weight > kComparable * mode.weight;
  }
  return comparable;
}

// A mode that is cut by its monitor's edge counts with the part that was seen, unless the other depth
// confirms it: what the rest of it would be is the fit's guess, of any size, and would show at other depths
// and in an environment.
Mode as_seen(const Mode& mode, std::span<const Mode> others, const MonitorExtent& extent) {
  const double distance = inside(mode, extent);
  if (distance > kUncut || (distance >= 0.0 && !is_contradicted(mode, others))) return mode;
  return mode_of(seen_part(footprint_of(mode), extent), static_cast<double>(mode.weight_sd),
                 static_cast<double>(mode.centre_sd_px), mode.texture);
}

// `other`: of the other depth, if there is one.
std::vector<Place> places_of(const Matte& matte, const Matte* other, int x, int y, int channel) {
  std::vector<Place> places;
  const std::span<const Mode> others =
      other != nullptr ? other->modes(x, y, channel) : std::span<const Mode>();
  for (const Mode& mode : matte.modes(x, y, channel)) {
    if (!(mode.weight > kMinWeight && mode.weight <= kMaxWeight)) continue;
    const Mode seen = as_seen(mode, others, extent_of(matte.metadata.monitors(mode.texture)));
    if (seen.weight > kMinWeight) places.push_back(place_of(seen));
  }
  return places;
}

Matrix2d root_of(const Matrix2d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Matrix2d> solver(covariance);
  return solver.eigenvectors() * solver.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() *
         solver.eigenvectors().transpose();
}

// The pixels' places on the plane of a monitor at one depth, and where rays through it go.
class Depth {
 public:
  Depth(const v1::RigGeometry& geometry, const Matte& matte, std::string pose)
      : geometry_(geometry), metadata_(matte.metadata), pose_(std::move(pose)) {}
  absl::Status find() {
    for (const v1::Monitor& monitor : metadata_.monitors()) {
      GW_ASSIGN_OR_RETURN(const v1::MonitorPose* const pose, find_pose(geometry_, pose_, monitor.name()));
      if (pose->width_px() != monitor.width_px() || pose->height_px() != monitor.height_px()) {
        return absl::InvalidArgumentError(fmt::format(
            "pose \"{}\" is of a monitor of {}x{} px; the matte's monitor {} has {}x{}", pose_,
            pose->width_px(), pose->height_px(), monitor.name(), monitor.width_px(), monitor.height_px()));
      }
      planes_.emplace_back(*pose);
      covariances_.push_back(covariance_of(*pose));
    }
    if (planes_.empty()) return absl::DataLossError("the matte's header names no monitors");
    return absl::OkStatus();
  }
  const MonitorPlane& plane(int texture) const { return planes_[texture]; }
  const std::vector<MonitorPlane>& planes() const { return planes_; }
  // Of where a monitor's place lies, mm^2, by the calibration's covariance of its pose; 0 where there is
  // none.
  Matrix3d error_at(int texture, const Vector2d& at) const {
    const MonitorPlane& plane = planes_[texture];
    const Vector3d turned = plane.at(at.x(), at.y()) - plane.corner_mm;
    Eigen::Matrix<double, 3, 6> by_pose;  // a turn about the camera's axes, then a translation
    by_pose << 0.0, turned.z(), -turned.y(), 1.0, 0.0, 0.0,  //
        -turned.z(), 0.0, turned.x(), 0.0, 1.0, 0.0,         //
        turned.y(), -turned.x(), 0.0, 0.0, 0.0, 1.0;
    return by_pose * covariances_[texture] * by_pose.transpose();
  }

 private:
  using PoseCovariance = Eigen::Matrix<double, 6, 6>;
  static PoseCovariance covariance_of(const v1::MonitorPose& pose) {
    if (pose.covariance().empty()) return PoseCovariance::Zero();
    return Eigen::Map<const PoseCovariance>(pose.covariance().data());
  }

  const v1::RigGeometry& geometry_;
  const v1::MatteMetadata& metadata_;
  const std::string pose_;
  std::vector<MonitorPlane> planes_;
  std::vector<PoseCovariance> covariances_;
};

absl::Status check_camera(const Matte& matte, const v1::RigGeometry& geometry) {
  const v1::CameraGeometry& camera = geometry.camera();
  if (matte.x0_px() != 0 || matte.y0_px() != 0 || matte.width_px() != camera.width_px() ||
      matte.height_px() != camera.height_px()) {
    return absl::InvalidArgumentError(fmt::format(
        "the matte has {}x{} px from ({}, {}) on; the geometry's camera has {}x{}", matte.width_px(),
        matte.height_px(), matte.x0_px(), matte.y0_px(), camera.width_px(), camera.height_px()));
  }
  if (matte.metadata.footprint() == kBoxFootprint) {
    return absl::InvalidArgumentError(
        "the matte's footprints are boxes, which have no axes to follow; solve it with --method gaussian");
  }
  return absl::OkStatus();
}

Vector3d spread_on(const MonitorPlane& plane, const Matrix2d& axes, int axis) {
  return plane.x_mm * axes(0, axis) + plane.y_mm * axes(1, axis);
}

// The bundle through two places.
Ray ray_through(const MonitorPlane& near, const Vector2d& from, const Matrix2d& from_axes,
                const MonitorPlane& far, const Vector2d& to, const Matrix2d& to_axes) {
  Ray ray;
  const Vector3d origin = near.at(from.x(), from.y()), through = far.at(to.x(), to.y());
  const double length = (through - origin).norm();
  const Vector3d direction = (through - origin) / length;
  ray.origin_mm = origin.cast<float>();
  ray.direction = direction.cast<float>();
  for (int axis = 0; axis < 2; ++axis) {
    const Vector3d here = spread_on(near, from_axes, axis), there = spread_on(far, to_axes, axis);
    const Vector3d turn = (there - here) / length;
    ray.origin_spread_mm[axis] = here.cast<float>();
    ray.direction_spread[axis] = (turn - direction * direction.dot(turn)).cast<float>();
  }
  return ray;
}

class Matcher {
 public:
  Matcher(const Matte& one, const Matte& other, const Depth& near, const Depth& far)
      : one_(one), width_(one.width_px()), height_(one.height_px()), near_(near), far_(far) {
    nodes_.resize(static_cast<size_t>(width_) * height_ * kChannels);
    for_rows(height_, 0, [&](int first, int end) {
      for (int y = first; y < end; ++y) {
        for (int x = 0; x < width_; ++x) {
          if (!(one.coverage(x, y) > 0.0f) && !(other.coverage(x, y) > 0.0f)) continue;
          for (int c = 0; c < kChannels; ++c) {
            node(x, y, c).near = places_of(one, &other, x, y, c);
            node(x, y, c).far = places_of(other, &one, x, y, c);
          }
        }
      }
    });
  }

  void run() {
    for (int pass = 0; pass < kPasses; ++pass) {
      std::vector<std::vector<Pair>> next(nodes_.size());
      for_rows(height_, 0, [&](int first, int end) {
        for (int y = first; y < end; ++y) {
          for (int x = 0; x < width_; ++x) {
            for (int c = 0; c < kChannels; ++c) next[index(x, y, c)] = paired(x, y, c, pass);
          }
        }
      });
      for (size_t i = 0; i < nodes_.size(); ++i) nodes_[i].pairs = std::move(next[i]);
    }
    label(false, near_labels_);
    label(true, far_labels_);
  }

  // The rays of a pixel's channel.
  std::vector<Ray> rays(int x, int y, int c) const {
    const Node& here = node(x, y, c);
    std::vector<Ray> rays;
    std::vector<double> near_left, far_left, near_light(here.near.size(), 0.0),
        far_light(here.far.size(), 0.0);
    for (const Place& place : here.near) near_left.push_back(place.weight);
    for (const Place& place : here.far) far_left.push_back(place.weight);
    for (const Pair& pair : here.pairs) {
      near_left[pair.near] -= pair.light;
      far_left[pair.far] -= pair.light;
      near_light[pair.near] += pair.light;
      far_light[pair.far] += pair.light;
    }
    for (const Pair& pair : here.pairs) {
      const Place &from = here.near[pair.near], &to = here.far[pair.far];
      Ray ray = joined(x, y, c, from, to);
      // What is left of a mode by noise goes with its pairs.
      const bool whole = near_left[pair.near] < kStrayLight * from.weight;
      const double near_weight = whole ? pair.light * from.weight / near_light[pair.near] : pair.light;
      const bool far_whole = far_left[pair.far] < kStrayLight * to.weight;
      const double far_weight = far_whole ? pair.light * to.weight / far_light[pair.far] : pair.light;
      ray.weight = static_cast<float>(0.5 * (near_weight + far_weight));
      ray.state = pair.ambiguous ? RayState::kAmbiguous : RayState::kMatched;
      rays.push_back(ray);
    }
    double unpaired = 0.0;
    for (size_t i = 0; i < here.near.size(); ++i) {
      if (near_left[i] < kStrayLight * here.near[i].weight) continue;
      unpaired += near_left[i];
      rays.push_back(extrapolated(x, y, c, i, near_left[i], false));
    }
    // What only the far depth saw may be the same light as what only the near one saw.
    for (size_t k = 0; k < here.far.size(); ++k) {
      const double light = std::min(far_left[k], here.far[k].weight);
      if (light < std::max(kStrayLight * here.far[k].weight, 3.0 * kMinWeight)) continue;
      const double surplus = light - unpaired;
      unpaired = std::max(unpaired - light, 0.0);
      if (surplus > 0.5 * light) rays.push_back(extrapolated(x, y, c, k, surplus, true));
    }
    return rays;
  }

 private:
  struct Candidate {
    double cost;
    size_t near, far;
  };

  size_t index(int x, int y, int c) const {
    return (static_cast<size_t>(y) * width_ + x) * kChannels + static_cast<size_t>(c);
  }
  Node& node(int x, int y, int c) { return nodes_[index(x, y, c)]; }
  const Node& node(int x, int y, int c) const { return nodes_[index(x, y, c)]; }
  bool holds(int x, int y) const { return x >= 0 && x < width_ && y >= 0 && y < height_; }

  template <class Each>
  void for_neighbours(int x, int y, int c, Each each) const {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        if ((dx != 0 || dy != 0) && holds(x + dx, y + dy)) each(node(x + dx, y + dy, c), dx, dy);
      }
    }
    for (int other = 0; other < kChannels; ++other) {
      if (other != c) each(node(x, y, other), 0, 0);
    }
  }

  // How far a neighbour's pair is from this one: 0 to 1.
  static double distance(const Node& there, const Pair& pair, const Place& from, const Place& to) {
    const Place &near = there.near[pair.near], &far = there.far[pair.far];
    if (near.texture != from.texture) return 1.0;
    const double d = ((near.at - from.at).norm() + (far.at - to.at).norm()) /
                     (2.0 * kNearPx + near.width + from.width + far.width + to.width);
    return d / (1.0 + d);
  }

  // 0 to 1: what the neighbours' pairs say of a pair; 0.5 where there are none.
  double strangeness(int x, int y, int c, const Place& from, const Place& to) const {
    double sum = 0.0, count = 0.0;
    for_neighbours(x, y, c, [&](const Node& there, int, int) {
      double best = 1.0, light = 0.0;
      for (const Pair& pair : there.pairs) {
        const double d = distance(there, pair, from, to);
        if (d < best) {
          best = d;
          light = pair.light;
        }
      }
      if (light > 0.0) {
        sum += best;
        count += 1.0;
      }
    });
    return count > 0.0 ? sum / count : 0.5;
  }

  std::vector<Pair> paired(int x, int y, int c, int pass) const {
    const Node& here = node(x, y, c);
    std::vector<Candidate> candidates;
    for (size_t i = 0; i < here.near.size(); ++i) {
      for (size_t k = 0; k < here.far.size(); ++k) {
        const Place &from = here.near[i], &to = here.far[k];
        if (from.texture != to.texture) continue;
        double cost = std::abs(from.weight - to.weight) / (from.weight + to.weight);
        if (pass == 0) {
          // Nothing but the weights; a turn of the ray costs a little.
          const double moved = (to.at - from.at).norm();
          cost += 0.2 * moved / (moved + 32.0) + 0.3;
        } else {
          cost += strangeness(x, y, c, from, to);
        }
        candidates.push_back({cost, i, k});
      }
    }
    std::ranges::sort(candidates, [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
    std::vector<double> near_left, far_left;
    for (const Place& place : here.near) near_left.push_back(place.weight);
    for (const Place& place : here.far) far_left.push_back(place.weight);
    std::vector<Pair> pairs;
    for (const Candidate& candidate : candidates) {
      if (candidate.cost > kMaxCost) break;
      const double light = std::min(near_left[candidate.near], far_left[candidate.far]);
      const Place &from = here.near[candidate.near], &to = here.far[candidate.far];
      if (light < std::max(0.05 * std::min(from.weight, to.weight), kMinWeight)) continue;
      Pair pair{.near = candidate.near, .far = candidate.far, .light = light};
      // Another partner of about the same cost, elsewhere, that is no part of the same path.
      for (const Candidate& rival : candidates) {
        if (rival.cost > candidate.cost + kSameCost) break;
        if (rival.near != candidate.near || rival.far == candidate.far) continue;
        const Place& other = here.far[rival.far];
        if (far_left[rival.far] > 0.5 * light &&
            (other.at - to.at).norm() > kNearPx + 2.0 * (other.width + to.width))
          pair.ambiguous = true;
      }
      near_left[candidate.near] -= light;
      far_left[candidate.far] -= light;
      pairs.push_back(pair);
    }
    return pairs;
  }

  // How the far place moves with the near one, from the neighbours' pairs of the same path.
  std::optional<Matrix2d> slope(int x, int y, int c, const Place& from, const Place& to) const {
    Matrix2d near_moments = Matrix2d::Zero(), far_moments = Matrix2d::Zero(), steps = Matrix2d::Zero();
    int count = 0;
    for_neighbours(x, y, c, [&](const Node& there, int dx, int dy) {
      if (dx == 0 && dy == 0) return;
      const Pair* best = nullptr;
      double least = 0.5;
      for (const Pair& pair : there.pairs) {
        const double d = distance(there, pair, from, to);
        if (d < least) {
          least = d;
          best = &pair;
        }
      }
      if (best == nullptr) return;
      const Vector2d step(dx, dy);
      near_moments += (there.near[best->near].at - from.at) * step.transpose();
      far_moments += (there.far[best->far].at - to.at) * step.transpose();
      steps += step * step.transpose();
      ++count;
    });
    constexpr int kMinNeighbours = 3;
    if (count < kMinNeighbours || std::abs(steps.determinant()) < 1e-6) return std::nullopt;
    const Matrix2d per_pixel = near_moments * steps.inverse();
    constexpr double kMinDeterminant = 1e-4;  // of a caustic, px^2
    if (std::abs(per_pixel.determinant()) < kMinDeterminant) return std::nullopt;
    return far_moments * steps.inverse() * per_pixel.inverse();
  }

  Ray joined(int x, int y, int c, const Place& from, const Place& to) const {
    const Matrix2d near = root_of(from.covariance), far = root_of(to.covariance);
    const Matrix2d along = slope(x, y, c, from, to).value_or(Matrix2d::Identity());
    const Eigen::JacobiSVD<Matrix2d> svd(far * along * near, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const MonitorPlane &near_plane = near_.plane(from.texture), &far_plane = far_.plane(to.texture);
    Ray ray = ray_through(near_plane, from.at, near, far_plane, to.at,
                          far * svd.matrixU() * svd.matrixV().transpose());
    const double gap = (far_plane.at(to.at.x(), to.at.y()) - near_plane.at(from.at.x(), from.at.y())).norm();
    if (from.sd > 0.0 && to.sd > 0.0) {
      ray.origin_sd_mm = static_cast<float>(from.sd * near_plane.pitch_mm);
      ray.direction_sd =
          static_cast<float>(std::hypot(from.sd * near_plane.pitch_mm, to.sd * far_plane.pitch_mm) / gap);
    }
    widen_by_poses(ray, from.texture, from.at, to.at);
    return ray;
  }

  // Adds the errors of both poses, taken to be independent of each other, to the standard errors that are
  // known.
  void widen_by_poses(Ray& ray, int texture, const Vector2d& from, const Vector2d& to) const {
    const Vector3d direction = ray.direction.cast<double>();
    const Matrix3d across = Matrix3d::Identity() - direction * direction.transpose();
    const auto widened = [&](float sd, const Matrix3d& error, double length) {
      const double own = std::sqrt(std::max(0.5 * (across * error * across).trace(), 0.0)) / length;
      return sd > 0.0f ? static_cast<float>(std::hypot(static_cast<double>(sd), own)) : sd;
    };
    const Matrix3d near = near_.error_at(texture, from), far = far_.error_at(texture, to);
    const double length =
        (far_.plane(texture).at(to.x(), to.y()) - near_.plane(texture).at(from.x(), from.y())).norm();
    ray.origin_sd_mm = widened(ray.origin_sd_mm, near, 1.0);
    ray.direction_sd = widened(ray.direction_sd, near + far, length);
  }

  // Which places of one depth lie on one path: those of neighbouring pixels that lie as near each other as
  // their widths say, and carry about the same light.
  void label(bool of_far, std::vector<std::vector<int>>& labels) const {
    std::vector<int> parent;
    labels.assign(nodes_.size(), {});
    const auto places = [&](const Node& at) -> const std::vector<Place>& {
      return of_far ? at.far : at.near;
    };
    for (size_t i = 0; i < nodes_.size(); ++i) {
      for (size_t m = 0; m < places(nodes_[i]).size(); ++m) {
        labels[i].push_back(static_cast<int>(parent.size()));
        parent.push_back(static_cast<int>(parent.size()));
      }
    }
    const auto root = [&](int of) {
      while (parent[of] != of) {
        parent[of] = parent[parent[of]];
        of = parent[of];
      }
      return of;
    };
    const auto join = [&](size_t one, size_t other) {
      for (size_t m = 0; m < labels[one].size(); ++m) {
        for (size_t n = 0; n < labels[other].size(); ++n) {
          const Place &a = places(nodes_[one])[m], &b = places(nodes_[other])[n];
          constexpr double kMaxRatio = 3.0;
          if (a.texture != b.texture || a.weight > kMaxRatio * b.weight || b.weight > kMaxRatio * a.weight)
            continue;
          if ((a.at - b.at).norm() > 0.5 * kNearPx + 2.0 * (a.width + b.width)) continue;
          parent[root(labels[one][m])] = root(labels[other][n]);
        }
      }
    };
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        for (int c = 0; c < kChannels; ++c) {
          if (x + 1 < width_) join(index(x, y, c), index(x + 1, y, c));
          if (y + 1 < height_) join(index(x, y, c), index(x, y + 1, c));
        }
      }
    }
    for (std::vector<int>& of_node : labels) {
      for (int& own : of_node) own = root(own);
    }
  }

  // Of a place that one depth alone saw: the other by fits to the pairs around on the same path, affine and
  // quadratic in this one. Their difference is its standard error.
  Ray extrapolated(int x, int y, int c, size_t place, double light, bool seen_far) const {
    struct Sample {
      Vector2d seen, other;
      double squared, width;
    };
    const Place& seen = seen_far ? node(x, y, c).far[place] : node(x, y, c).near[place];
    const auto& labels = seen_far ? far_labels_ : near_labels_;
    const int path = labels[index(x, y, c)][place];
    std::vector<Sample> samples;
    double least = 1e30;
    for (const int radius : {8, 16, 32, 64}) {
      const int step = radius / 8;
      samples.clear();
      least = 1e30;
      for (int dy = -radius; dy <= radius; dy += step) {
        for (int dx = -radius; dx <= radius; dx += step) {
          if (!holds(x + dx, y + dy)) continue;
          const Node& there = node(x + dx, y + dy, c);
          for (const Pair& pair : there.pairs) {
            if (labels[index(x + dx, y + dy, c)][seen_far ? pair.far : pair.near] != path) continue;
            const Place &near = there.near[pair.near], &far = there.far[pair.far];
            const Place &same = seen_far ? far : near, &other = seen_far ? near : far;
            constexpr double kMainPart = 0.4;  // of both modes: others are pairs of small parts of a path
            if (pair.light < kMainPart * std::max(near.weight, far.weight)) continue;
            const double squared = dx * dx + dy * dy;
            least = std::min(least, squared);
            samples.push_back({same.at - seen.at, other.at, squared, other.width});
          }
        }
      }
      constexpr size_t kEnough = 24;
      if (samples.size() >= kEnough && 2.0 * std::sqrt(least) <= radius) break;
    }
    const MonitorPlane &near_plane = near_.plane(seen.texture), &far_plane = far_.plane(seen.texture);
    const MonitorPlane &own = seen_far ? far_plane : near_plane, &target = seen_far ? near_plane : far_plane;
    const double gap = (far_plane.corner_mm - near_plane.corner_mm).norm();
    const Matrix2d seen_axes = root_of(seen.covariance);
    constexpr size_t kMinSamples = 12;
    if (samples.size() < kMinSamples) {
      // The direction is as good as unknown: straight on from the camera, by half a radian or so.
      constexpr double kUnknownSd = 0.5;
      const Vector3d here = own.at(seen.at.x(), seen.at.y());
      const Vector3d straight = here * (target.depth_mm() / here.dot(target.normal)) - target.corner_mm;
      const double per_px2 = target.pitch_mm * target.pitch_mm;
      const Vector2d other(target.x_mm.dot(straight) / per_px2, target.y_mm.dot(straight) / per_px2);
      return one_sided(seen, seen_axes, other, kUnknownSd * gap / target.pitch_mm, 0.0, light, seen_far,
                       RayState::kUnknown);
    }
    const double reach = std::max(0.6 * std::sqrt(least), 3.0);
    std::vector<PathSample> near_ones;
    double total = 0.0, width = 0.0;
    for (const Sample& sample : samples) {
      const double w = std::exp(-0.5 * sample.squared / (reach * reach));
      near_ones.push_back({.step = sample.seen, .seen = sample.other, .weight = w});
      total += w;
      width += w * sample.width;
    }
    const double unit_px = std::max(seen.width, 8.0);
    const PathFit affine = fit_path(near_ones, PathShape::kAffine, unit_px),
                  quadratic = fit_path(near_ones, PathShape::kQuadratic, unit_px);
    const double sd =
        std::hypot(quadratic.rms_px, std::sqrt(0.125) * (quadratic.at_start - affine.at_start).norm());
    return one_sided(seen, seen_axes, affine.at_start, sd, width / total, light, seen_far,
                     RayState::kExtrapolated);
  }

  // A bundle through a place that was seen and one that was not, px on the other depth's monitor, with that
  // one's standard error and width. A monitor that did not see it is not where it went.
  Ray one_sided(const Place& seen, const Matrix2d& seen_axes, Vector2d other, double sd, double width,
                double light, bool seen_far, RayState state) const {
    const MonitorPlane &near_plane = near_.plane(seen.texture), &far_plane = far_.plane(seen.texture);
    const v1::Monitor& monitor = one_.metadata.monitors(seen.texture);
    const Vector2d size(monitor.width_px(), monitor.height_px());
    {
      // Distances inside the four edges; moved out over the nearest, and no wider than that leaves it there.
      const Vector2d low = other, high = size - other;
      const double inside = std::min(low.minCoeff(), high.minCoeff());
      constexpr double kMaxMargin = 3.0;  // px
      const double margin = std::min(sd, kMaxMargin);
      if (inside > -margin) {
        Eigen::Index axis = 0;
        const bool is_low = low.minCoeff(&axis) < high.minCoeff();
        if (!is_low) high.minCoeff(&axis);
        other[axis] = is_low ? -margin : size[axis] + margin;
      }
      const double outside = -std::min(other.minCoeff(), (size - other).minCoeff());
      const double within = std::max(0.5 * outside, 0.05);
      sd = std::min(sd, within);
      width = std::min(width, within);
    }
    const Matrix2d other_axes = Matrix2d::Identity() * std::hypot(width, sd);
    Ray ray = seen_far ? ray_through(near_plane, other, other_axes, far_plane, seen.at, seen_axes)
                       : ray_through(near_plane, seen.at, seen_axes, far_plane, other, other_axes);
    const double gap = (far_plane.corner_mm - near_plane.corner_mm).norm();
    ray.direction_sd = static_cast<float>(sd * far_plane.pitch_mm / gap);
    widen_by_poses(ray, seen.texture, seen_far ? other : seen.at, seen_far ? seen.at : other);
    ray.weight = static_cast<float>(light);
    ray.state = state;
    return ray;
  }

  const Matte& one_;
  const int width_, height_;
  const Depth &near_, &far_;
  std::vector<Node> nodes_;
  std::vector<std::vector<int>> near_labels_, far_labels_;  // of each node's places: their path
};

// The ray that the camera sends through a pixel, with the pixel's extent as its spread.
Ray straight_ray(const CameraLens& lens, int x, int y, float weight) {
  const Vector2d middle(x + 0.5, y + 0.5);
  const auto direction_at = [&](const Vector2d& pixel) {
    const Vector2d slope = lens.slope_of(pixel);
    return Vector3d(slope.x(), slope.y(), 1.0).normalized();
  };
  Ray ray;
  ray.weight = weight;
  ray.direction = direction_at(middle).cast<float>();
  const double sd_px = std::sqrt(1.0 / 12.0);  // of a square pixel
  for (int axis = 0; axis < 2; ++axis) {
    const Vector2d step = 0.5 * Vector2d::Unit(axis);
    ray.direction_spread[axis] =
        (sd_px * (direction_at(middle + step) - direction_at(middle - step))).cast<float>();
  }
  ray.state = RayState::kStraight;
  return ray;
}

// Makes the file of rays: `rays_at` gives those of a pixel's channel inside the object.
template <class RaysAt>
RayMatte gathered(const Matte& matte, const v1::RigGeometry& geometry, const std::vector<std::string>& poses,
                  const Matte* other, const RaysAt& rays_at) {
  const int width = matte.width_px(), height = matte.height_px();
  const CameraLens lens(geometry.camera());
  std::vector<std::vector<Ray>> all(static_cast<size_t>(width) * height * kChannels);
  const auto at = [&](int x, int y, int c) -> std::vector<Ray>& {
    return all[(static_cast<size_t>(y) * width + x) * kChannels + static_cast<size_t>(c)];
  };
  const auto covers = [&](int x, int y) {
    return std::max(matte.coverage(x, y), other != nullptr ? other->coverage(x, y) : 0.0f);
  };
  for_rows(height, 0, [&](int first, int end) {
    for (int y = first; y < end; ++y) {
      for (int x = 0; x < width; ++x) {
        for (int c = 0; c < kChannels; ++c) {
          std::vector<Ray>& rays = at(x, y, c);
          if (covers(x, y) > 0.0f) {
            rays = rays_at(x, y, c);
          } else {
            // The empty stage passes all light.
            rays.push_back(straight_ray(lens, x, y, 1.0f));
          }
          // Planes that cross where both were seen, or a lens that cannot be undone there.
          std::erase_if(rays, [](const Ray& ray) {
            return !ray.origin_mm.allFinite() || !ray.direction.allFinite() ||
                   std::abs(ray.direction.norm() - 1.0f) > kMaxLengthError;
          });
          std::ranges::stable_sort(rays, [](const Ray& a, const Ray& b) { return a.weight > b.weight; });
          if (rays.size() > static_cast<size_t>(kMaxModes)) rays.resize(kMaxModes);
        }
      }
    }
  });
  size_t most = 1;
  for (const std::vector<Ray>& rays : all) most = std::max(most, rays.size());
  RayMatte made(width, height, static_cast<int>(most));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      made.foreground(x, y) = matte.foreground(x, y);
      made.coverage(x, y) = covers(x, y);
      made.flags(x, y) = matte.flags(x, y) | (other != nullptr ? other->flags(x, y) : std::uint8_t{0});
      for (int c = 0; c < kChannels; ++c) std::ranges::copy(at(x, y, c), made.rays(x, y, c).begin());
    }
  }
  made.metadata.set_format_version(1);
  *made.metadata.mutable_matte() = matte.metadata;
  *made.metadata.mutable_geometry() = geometry;
  for (const std::string& pose : poses) made.metadata.add_poses(pose);
  *made.metadata.mutable_counts() = count_rays(made);
  return made;
}

}  // namespace

absl::StatusOr<RayMatte> match_rays(const Matte& one, const Matte& other, const v1::RigGeometry& geometry,
                                    const std::vector<std::string>& poses) {
  if (poses.size() != 2) {
    return absl::InvalidArgumentError(fmt::format("there are {} poses for two mattes", poses.size()));
  }
  GW_RETURN_IF_ERROR(check_camera(one, geometry));
  GW_RETURN_IF_ERROR(check_camera(other, geometry));
  Depth first(geometry, one, poses[0]), second(geometry, other, poses[1]);
  GW_RETURN_IF_ERROR(first.find());
  GW_RETURN_IF_ERROR(second.find());
  if (first.planes().size() != second.planes().size()) {
    return absl::InvalidArgumentError(fmt::format("one matte is of {} monitors, the other of {}",
                                                  first.planes().size(), second.planes().size()));
  }
  const bool in_order = first.plane(0).depth_mm() < second.plane(0).depth_mm();
  const Depth &near = in_order ? first : second, &far = in_order ? second : first;
  constexpr double kMinGap = 1e-3;  // of the distance
  for (size_t t = 0; t < near.planes().size(); ++t) {
    const double distance = near.planes()[t].depth_mm();
    const double gap = far.planes()[t].depth_mm() - distance;
    if (!(gap > kMinGap * distance)) {
      return absl::InvalidArgumentError(fmt::format(
          "monitor {} stands {} mm from the camera in one pose and {} mm in the other; they must be "
          "more than {} mm apart, in one order for all monitors",
          t, distance, distance + gap, kMinGap * distance));
    }
  }
  const Matte &front = in_order ? one : other, &back = in_order ? other : one;
  Matcher matcher(front, back, near, far);
  matcher.run();
  return gathered(front, geometry, in_order ? poses : std::vector{poses[1], poses[0]}, &back,
                  [&](int x, int y, int c) { return matcher.rays(x, y, c); });
}

absl::StatusOr<RayMatte> far_light_rays(const Matte& matte, const v1::RigGeometry& geometry,
                                        const std::string& pose, double object_depth_mm) {
  GW_RETURN_IF_ERROR(check_camera(matte, geometry));
  Depth depth(geometry, matte, pose);
  GW_RETURN_IF_ERROR(depth.find());
  if (!(object_depth_mm > 0.0)) {
    return absl::InvalidArgumentError(
        fmt::format("the object's depth is {} mm; it must be above 0", object_depth_mm));
  }
  const CameraLens lens(geometry.camera());
  RayMatte rays = gathered(matte, geometry, {pose}, nullptr, [&](int x, int y, int c) {
    const Vector2d slope = lens.slope_of({x + 0.5, y + 0.5});
    const Vector3d object = object_depth_mm * Vector3d(slope.x(), slope.y(), 1.0);
    std::vector<Ray> rays_here;
    for (const Place& place : places_of(matte, nullptr, x, y, c)) {
      const MonitorPlane& plane = depth.plane(place.texture);
      const Vector3d through = plane.at(place.at.x(), place.at.y());
      const double length = (through - object).norm();
      const Vector3d direction = (through - object) / length;
      const Matrix2d axes = root_of(place.covariance);
      Ray ray;
      ray.weight = static_cast<float>(place.weight);
      ray.state = RayState::kFarLight;
      ray.origin_mm = object.cast<float>();
      ray.direction = direction.cast<float>();
      for (int axis = 0; axis < 2; ++axis) {
        const Vector3d turn = spread_on(plane, axes, axis) / length;
        ray.direction_spread[axis] = (turn - direction * direction.dot(turn)).cast<float>();
      }
      rays_here.push_back(ray);
    }
    return rays_here;
  });
  rays.metadata.set_approximation(
      fmt::format("far environment: one depth; directions are from the object, taken to stand {} mm from the "
                  "camera, to where modes lie on the monitor",
                  object_depth_mm));
  return rays;
}

}  // namespace glasswing
