#include "core/sim/transport.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <mutex>
#include <numbers>
#include <numeric>
#include <optional>
#include <thread>
#include <tuple>

#include "core/base/status.h"
#include "core/sim/scene.h"

namespace glasswing {
namespace {

enum class Side { kBack, kLeft, kRight, kTop };

// The plane of a panel's pixels: `right` and `down` are a pixel.
struct Plane {
  Vec3 corner, right, down;
};

struct Panel {
  Side side;
  std::int32_t monitor;
  MonitorSize size;
  std::optional<Plane> moved;  // empty: at its own place
};

Plane own_place(Side side, MonitorSize size, MonitorSize back) {
  switch (side) {
    case Side::kLeft:
      return {.corner = {0.0, 0.0, -1.0 * size.width_px}, .right = {0.0, 0.0, 1.0}, .down = {0.0, 1.0, 0.0}};
    case Side::kRight:
      return {.corner = {1.0 * back.width_px, 0.0, 0.0}, .right = {0.0, 0.0, -1.0}, .down = {0.0, 1.0, 0.0}};
    case Side::kTop:
      return {.corner = {0.0, 0.0, -1.0 * size.height_px}, .right = {1.0, 0.0, 0.0}, .down = {0.0, 0.0, 1.0}};
    case Side::kBack:
      break;
  }
  return {.corner = {}, .right = {1.0, 0.0, 0.0}, .down = {0.0, 1.0, 0.0}};
}

// panel_pose.h
Plane moved(const Plane& place, const SceneMonitor& monitor) {
  const double tilt_rad = monitor.pose.tilt_deg * std::numbers::pi / 180.0;
  const double turn_rad = monitor.pose.turn_deg * std::numbers::pi / 180.0;
  const Vec3 away = cross(place.right, place.down);
  const double across = 0.5 * monitor.size.width_px, along = 0.5 * monitor.size.height_px;
  const Vec3 middle = place.corner + across * place.right + along * place.down +
                      (monitor.pose.away_mm / monitor.pitch_mm) * away;
  Plane plane{.corner = middle,
              .right = std::cos(turn_rad) * place.right + std::sin(turn_rad) * away,
              .down = std::cos(tilt_rad) * place.down +
                      std::sin(tilt_rad) * (std::cos(turn_rad) * away - std::sin(turn_rad) * place.right)};
  plane.corner = plane.corner - across * plane.right - along * plane.down;
  return plane;
}

// The point where a ray hits a panel, in px of that panel.
struct Landing {
  double distance, u, v;
};

bool is_inside(const Landing& landing, MonitorSize size) {
  return landing.u >= 0.0 && landing.u < size.width_px && landing.v >= 0.0 && landing.v < size.height_px;
}

std::optional<Landing> meet(const Ray& ray, const Plane& plane) {
  const Vec3 normal = cross(plane.right, plane.down);
  const double t = dot(normal, plane.corner - ray.origin) / dot(normal, ray.direction);
  if (!(t > 1e-9) || !std::isfinite(t)) return std::nullopt;
  const Vec3 p = ray.origin + t * ray.direction - plane.corner;
  return Landing{.distance = t, .u = dot(p, plane.right), .v = dot(p, plane.down)};
}

// Where a ray meets a panel's plane, on the panel or beside it.
std::optional<Landing> meet(const Ray& ray, const Panel& panel, MonitorSize back) {
  if (panel.moved) return meet(ray, *panel.moved);
  const Vec3& o = ray.origin;
  const Vec3& d = ray.direction;
  double t = 0.0;
  switch (panel.side) {
    case Side::kBack:
      t = -o.z / d.z;
      break;
    case Side::kLeft:
      t = -o.x / d.x;
      break;
    case Side::kRight:
      t = (back.width_px - o.x) / d.x;
      break;
    case Side::kTop:
      t = -o.y / d.y;
      break;
  }
  if (!(t > 1e-9) || !std::isfinite(t)) return std::nullopt;
  const Vec3 p = o + t * d;
  Landing landing{.distance = t, .u = p.x, .v = p.y};
  if (panel.side == Side::kLeft) landing.u = panel.size.width_px + p.z;
  if (panel.side == Side::kRight) landing.u = -p.z;
  if (panel.side == Side::kTop) landing.v = panel.size.height_px + p.z;
  return landing;
}

std::optional<Landing> land(const Ray& ray, const Panel& panel, MonitorSize back) {
  const std::optional<Landing> landing = meet(ray, panel, back);
  return landing && is_inside(*landing, panel.size) ? landing : std::nullopt;
}

// Rays beside another: kBeside of its part of the camera's pixel further along x and y.
constexpr double kBeside = 1e-3;
struct Beside {
  std::vector<Path> right, below;  // the same paths as those of the ray, or none
};

// What a part of a camera's pixel covers of a panel, to first order: as wide along u and v as the panel is
// passed by the rays beside it. Empty: a point.
struct Area {
  double width_px = 0.0, height_px = 0.0;
};
std::optional<Area> area_of(const Landing& at, const Beside& beside, size_t path, const Panel& panel,
                            MonitorSize back) {
  constexpr double kLargest_px = 16.0;  // where light is focused the map is not linear
  if (path >= beside.right.size() || path >= beside.below.size()) return std::nullopt;
  const std::optional<Landing> right = meet(beside.right[path].ray, panel, back);
  const std::optional<Landing> below = meet(beside.below[path].ray, panel, back);
  if (!right || !below) return std::nullopt;
  const Area area{.width_px = std::hypot(right->u - at.u, below->u - at.u) / kBeside,
                  .height_px = std::hypot(right->v - at.v, below->v - at.v) / kBeside};
  if (!(area.width_px > 0.0 && area.width_px < kLargest_px)) return std::nullopt;
  if (!(area.height_px > 0.0 && area.height_px < kLargest_px)) return std::nullopt;
  return area;
}

void add_area(const Landing& at, const Area& area, const Panel& panel, double weight,
              std::vector<Tap>& taps) {
  const auto for_each = [](double middle, double width, int size, const auto& use) {
    const double from = middle - 0.5 * width, to = middle + 0.5 * width;
    for (int i = std::max(static_cast<int>(std::floor(from)), 0); i < size && i < to; ++i)
      use(i, (std::min(to, i + 1.0) - std::max(from, 1.0 * i)) / width);
  };
  for_each(at.v, area.height_px, panel.size.height_px, [&](int v, double of_v) {
    for_each(at.u, area.width_px, panel.size.width_px, [&](int u, double of_u) {
      const auto light = static_cast<float>(weight * of_u * of_v);
      if (light > 0.0f) taps.push_back({.monitor = panel.monitor, .x_px = u, .y_px = v, .weight = light});
    });
  });
}

// `number`: of the path among those of its ray.
void add_path(const Path& path, size_t number, const Beside& beside, const std::vector<Panel>& panels,
              MonitorSize back, double scale, std::vector<Tap>& taps) {
  std::optional<Landing> nearest;
  const Panel* on = nullptr;
  for (const Panel& panel : panels) {
    const std::optional<Landing> landing = land(path.ray, panel, back);
    if (landing && (!nearest || landing->distance < nearest->distance)) {
      nearest = landing;
      on = &panel;
    }
  }
  if (on == nullptr) return;
  if (const std::optional<Area> area = area_of(*nearest, beside, number, *on, back)) {
    add_area(*nearest, *area, *on, path.weight * scale, taps);
    return;
  }
  taps.push_back({.monitor = on->monitor,
                  .x_px = static_cast<std::int32_t>(nearest->u),
                  .y_px = static_cast<std::int32_t>(nearest->v),
                  .weight = static_cast<float>(path.weight * scale)});
}

// Sorts taps and merges those of the same monitor pixel.
void merge(std::vector<Tap>& taps) {
  const auto key = [](const Tap& tap) { return std::tuple(tap.monitor, tap.y_px, tap.x_px); };
  std::sort(taps.begin(), taps.end(), [&](const Tap& a, const Tap& b) { return key(a) < key(b); });
  size_t kept = 0;
  for (size_t i = 0; i < taps.size(); ++i) {
    if (kept > 0 && key(taps[kept - 1]) == key(taps[i])) {
      taps[kept - 1].weight += taps[i].weight;
    } else {
      taps[kept++] = taps[i];
    }
  }
  taps.resize(kept);
}

}  // namespace

class TransportBuilder {
 public:
  // With `around`, each row starts at the pixel given to begin_row() and ends with the last pixel added.
  TransportBuilder(int width_px, int height_px, const std::vector<SceneMonitor>& monitors, bool colourless,
                   std::shared_ptr<const Transport> around) {
    transport_.width_px_ = width_px;
    transport_.height_px_ = height_px;
    transport_.colourless_ = colourless;
    transport_.around_ = std::move(around);
    for (const SceneMonitor& monitor : monitors)
      transport_.parts_.emplace_back().width_px = monitor.size.width_px;
  }
  void begin_row(int first_px) {
    const auto y = static_cast<int>(transport_.own_.size());
    transport_.own_.push_back(
        {.first = first_px, .last = first_px, .first_pixel = transport_.foreground_.size() / 3});
    for (size_t m = 0; m < transport_.parts_.size(); ++m) {
      Transport::Part& part = transport_.parts_[m];
      part.first_taps.push_back(part.taps.size());
      part.rows.push_back(transport_.around_ != nullptr
                              ? transport_.around_->rows_seen(m, y)
                              : Transport::Rows{.first = std::numeric_limits<int>::max(), .last = -1});
    }
  }
  // Taps of one channel, or of all channels if the transport is colourless.
  void add_taps(const std::vector<Tap>& taps, int channel) {
    for (Transport::Part& part : transport_.parts_) part.counts.push_back(0);
    for (const Tap& tap : taps) {
      Transport::Part& part = transport_.parts_[tap.monitor];
      part.taps.push_back(
          {.sample = static_cast<std::uint32_t>((tap.y_px * part.width_px + tap.x_px) * 3 + channel),
           .weight = tap.weight});
      ++part.counts.back();
      Transport::Rows& rows = part.rows.back();
      rows = {.first = std::min(rows.first, tap.y_px), .last = std::max(rows.last, tap.y_px)};
    }
  }
  void end_pixel(const Colour& foreground) {
    transport_.foreground_.insert(transport_.foreground_.end(), foreground.begin(), foreground.end());
    ++transport_.own_.back().last;
  }
  Transport built() {
    for (Transport::Part& part : transport_.parts_) {
      part.taps.shrink_to_fit();
      part.counts.shrink_to_fit();
    }
    transport_.foreground_.shrink_to_fit();
    return std::move(transport_);
  }

 private:
  Transport transport_;
};

Transport::PixelTaps Transport::find(const Part& part, int x, int y) const {
  const Columns& own = own_[y];
  const std::uint16_t* counts = part.counts.data() + own.first_pixel * samples_a_pixel();
  const std::uint16_t* count = counts + static_cast<size_t>(x - own.first) * samples_a_pixel();
  return {.tap = part.taps.data() + std::accumulate(counts, count, part.first_taps[y]), .count = count};
}

std::vector<Tap> Transport::taps(int x, int y, int channel) const {
  if (!owns(x, y)) return around_->taps(x, y, channel);
  std::vector<Tap> taps;
  for (size_t m = 0; m < parts_.size(); ++m) {
    const Part& part = parts_[m];
    auto [tap, count] = find(part, x, y);
    for (int c = 0; c < channel && !colourless_; ++c) tap += *count++;
    for (int left = *count; left > 0; --left, ++tap) {
      const auto pixel = static_cast<std::int32_t>(tap->sample / 3);
      taps.push_back({.monitor = static_cast<std::int32_t>(m),
                      .x_px = pixel % part.width_px,
                      .y_px = pixel / part.width_px,
                      .weight = tap->weight});
    }
  }
  return taps;
}

float Transport::foreground(int x, int y, int channel) const {
  if (!owns(x, y)) return around_->foreground(x, y, channel);
  const Columns& own = own_[y];
  return foreground_[3 * (own.first_pixel + static_cast<size_t>(x - own.first)) +
                     static_cast<size_t>(channel)];
}

void Transport::start_row(int y, std::span<float> row) const {
  if (around_ != nullptr) around_->start_row(y, row);
  const Columns& own = own_[y];
  const auto from = foreground_.begin() + 3 * own.first_pixel;
  std::copy(from, from + 3 * (own.last - own.first), row.begin() + 3 * own.first);
}

RadianceImage Transport::respond(std::span<const RadianceImage> pictures) const {
  RadianceImage out(width_px_, height_px_);
  for (int y = 0; y < height_px_; ++y) {
    const std::span<float> row(out.samples.data() + out.index(0, y, 0), static_cast<size_t>(width_px_) * 3);
    start_row(y, row);
    for (size_t m = 0; m < pictures.size(); ++m) {
      const float* samples = pictures[m].samples.data();
      if (!pictures[m].empty()) add_row(m, y, row, [&](std::uint32_t sample) { return samples[sample]; });
    }
  }
  return out;
}

namespace {

class EmptyStage final : public Scene {
 public:
  std::optional<std::vector<Path>> trace(const Ray&, int, int) const override { return std::nullopt; }
  bool is_colourless() const override { return true; }
};

// Traces the rays of a camera's pixels.
class Tracer {
 public:
  static absl::StatusOr<Tracer> create(const std::vector<SceneMonitor>& monitors, int camera_width_px,
                                       int camera_height_px, int rays_across, double focal_widths,
                                       bool areas) {
    Tracer tracer;
    tracer.areas_ = areas;
    tracer.monitors_ = monitors;
    tracer.width_px_ = camera_width_px;
    tracer.height_px_ = camera_height_px;
    tracer.rays_across_ = rays_across;
    for (size_t i = 0; i < monitors.size(); ++i) {
      Panel panel{.side = Side::kBack,
                  .monitor = static_cast<std::int32_t>(i),
                  .size = monitors[i].size,
                  .moved = {}};
      const std::string& name = monitors[i].name;
      if (name == "back") {
        tracer.back_ = panel.size;
      } else if (name == "left") {
        panel.side = Side::kLeft;
      } else if (name == "right") {
        panel.side = Side::kRight;
      } else if (name == "top") {
        panel.side = Side::kTop;
      } else {
        return absl::InvalidArgumentError(
            fmt::format("monitor \"{}\" has no place in the scene; there are: back, left, right, top", name));
      }
      tracer.panels_.push_back(panel);
    }
    if (tracer.back_.width_px == 0)
      return absl::InvalidArgumentError("a scene needs a monitor \"back\", behind the object");
    for (size_t i = 0; i < monitors.size(); ++i) {
      if (monitors[i].pose == PanelPose()) continue;
      Panel& panel = tracer.panels_[i];
      panel.moved = moved(own_place(panel.side, panel.size, tracer.back_), monitors[i]);
    }
    const double width = tracer.back_.width_px, height = tracer.back_.height_px;
    tracer.eye_ = {0.5 * width, 0.5 * height, -focal_widths * width};
    return tracer;
  }
  MonitorSize back() const { return back_; }

  // With `around`, keeps only the columns between the object's edges. Calls `row_done` after each row with
  // its share of the work, and breaks off if it returns false.
  Transport trace(const Scene& scene, std::shared_ptr<const Transport> around,
                  const std::function<bool(double share)>& row_done) const {
    const bool colourless = scene.is_colourless();
    std::vector<Columns> rows(height_px_, {.first = 0, .last = width_px_});
    if (around != nullptr && !find_edges(scene, rows, row_done)) return {};
    int pixels = 0;
    for (const Columns& row : rows) pixels += row.last - row.first;
    TransportBuilder builder(width_px_, height_px_, monitors_, colourless, std::move(around));
    for (int y = 0; y < height_px_; ++y) {
      const auto [first, last] = rows[y];
      builder.begin_row(first);
      for (int x = first; x < last; ++x) {
        Colour foreground{};
        for (int c = 0; c < (colourless ? 1 : kChannels); ++c)
          builder.add_taps(taps(scene, x, y, c, foreground[c]), c);
        if (colourless) foreground.fill(foreground[0]);
        builder.end_pixel(foreground);
      }
      if (!row_done(static_cast<double>(last - first) / std::max(pixels, 1))) return {};
    }
    return builder.built();
  }

 private:
  static constexpr int kChannels = 3;

  struct Columns {  // [first, last)
    int first, last;
  };
  bool find_edges(const Scene& scene, std::vector<Columns>& rows,
                  const std::function<bool(double share)>& row_done) const {
    for (int y = 0; y < height_px_; ++y) {
      auto& [first, last] = rows[y];
      while (first < last && !hits(scene, first, y)) ++first;
      while (first < last && !hits(scene, last - 1, y)) --last;
      if (!row_done(0.0)) return false;
    }
    return true;
  }
  int rays() const { return rays_across_ * rays_across_; }
  // `right` and `below`: further, in parts of the pixel that each ray stands for.
  Ray ray(int x, int y, int number, double right = 0.0, double below = 0.0) const {
    const int i = number % rays_across_, j = number / rays_across_;
    const Vec3 target{(x + (i + 0.5 + right) / rays_across_) * back_.width_px / width_px_,
                      (y + (j + 0.5 + below) / rays_across_) * back_.height_px / height_px_, 0.0};
    return {eye_, normalized(target - eye_)};
  }
  // One straight on where the ray misses the object.
  static std::vector<Path> paths(const Scene& scene, const Ray& ray, int channel, int number) {
    return scene.trace(ray, channel, number).value_or(std::vector<Path>{{.ray = ray, .weight = 1.0}});
  }
  Beside beside(const Scene& scene, int x, int y, int s, int channel, int number, size_t path_count) const {
    if (!areas_) return {};
    Beside beside{.right = paths(scene, ray(x, y, s, kBeside, 0.0), channel, number),
                  .below = paths(scene, ray(x, y, s, 0.0, kBeside), channel, number)};
    if (beside.right.size() != path_count || beside.below.size() != path_count) return {};
    return beside;
  }
  bool hits(const Scene& scene, int x, int y) const {
    for (int s = 0; s < rays(); ++s) {
      if (scene.trace(ray(x, y, s), 0, 0)) return true;
    }
    return false;
  }
  std::vector<Tap> taps(const Scene& scene, int x, int y, int channel, float& foreground) const {
    const double scale = 1.0 / rays();
    std::vector<Tap> taps;
    double own_light = 0.0, lamp_light = 0.0;
    for (int s = 0; s < rays(); ++s) {
      const Ray seen = ray(x, y, s);
      // Numbers repeat every kRaysAcross x kRaysAcross rays, for any number of rays per pixel.
      const int number = (y * rays_across_ + s / rays_across_) % kRaysAcross * kRaysAcross +
                         (x * rays_across_ + s % rays_across_) % kRaysAcross;
      const std::optional<std::vector<Path>> paths = scene.trace(seen, channel, number);
      const Beside around = beside(scene, x, y, s, channel, number, paths ? paths->size() : 1);
      if (!paths) {
        add_path({.ray = seen, .weight = 1.0}, 0, around, panels_, back_, scale, taps);
        continue;
      }
      own_light += scene.foreground(seen)[channel];
      for (size_t i = 0; i < paths->size(); ++i) {
        const Path& path = (*paths)[i];
        add_path(path, i, around, panels_, back_, scale, taps);
        if (const std::optional<Lamp> lamp = scene.lamp(); lamp && lamp->lights(path.ray))
          lamp_light += path.weight * lamp->radiance;
      }
    }
    merge(taps);
    foreground = static_cast<float>(own_light * scale) + static_cast<float>(lamp_light * scale);
    return taps;
  }

  std::vector<SceneMonitor> monitors_;
  int width_px_ = 0, height_px_ = 0, rays_across_ = 1;
  bool areas_ = false;
  MonitorSize back_;
  std::vector<Panel> panels_;
  Vec3 eye_;
};

// An object takes 4 (glass) to 30 (brushed) times as long as the empty stage, which has one channel and no
// bounces.
constexpr double kObjectWork = 8.0;

// The share of a stage that is traced, of all threads.
class Traced {
 public:
  Traced(double work, const TraceReport& report) : work_(work), report_(report) {}
  // More of it is done. False: stop.
  bool add(double work) {
    const std::lock_guard lock(mutex_);
    done_ += work;
    if (!stopped_ && report_) stopped_ = !report_(std::min(done_ / work_, 1.0));
    return !stopped_;
  }
  bool stopped() const { return stopped_; }  // once all threads have ended

 private:
  const double work_;
  const TraceReport& report_;
  std::mutex mutex_;
  double done_ = 0.0;     // guarded by mutex_
  bool stopped_ = false;  // guarded by mutex_
};

}  // namespace

absl::StatusOr<Transport> build_transport(const std::string& scene_name, bool object,
                                          const std::vector<SceneMonitor>& monitors, int camera_width_px,
                                          int camera_height_px, int rays_across, double focal_widths,
                                          const Turntable& table, bool areas) {
  GW_ASSIGN_OR_RETURN(const Tracer tracer, Tracer::create(monitors, camera_width_px, camera_height_px,
                                                          rays_across, focal_widths, areas));
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<Scene> scene, make_scene(scene_name, tracer.back(), 0, table));
  const auto to_the_end = [](double) { return true; };
  if (!object || scene == nullptr) return tracer.trace(EmptyStage(), nullptr, to_the_end);
  return tracer.trace(*scene, nullptr, to_the_end);
}

absl::StatusOr<StageTransports> build_phases(const std::string& scene_name,
                                             const std::vector<SceneMonitor>& monitors, int camera_width_px,
                                             int camera_height_px, int rays_across, double focal_widths,
                                             const TraceReport& report, const Turntable& table, bool areas) {
  GW_ASSIGN_OR_RETURN(const Tracer tracer, Tracer::create(monitors, camera_width_px, camera_height_px,
                                                          rays_across, focal_widths, areas));
  StageTransports stage;
  const auto share = [](Transport transport) {
    return std::make_shared<const Transport>(std::move(transport));
  };
  std::vector<std::unique_ptr<Scene>> scenes;
  for (int phase = 0; phase < motion_of(scene_name).phases; ++phase) {
    GW_ASSIGN_OR_RETURN(scenes.emplace_back(), make_scene(scene_name, tracer.back(), phase, table));
  }
  const auto objects = std::ranges::count_if(scenes, [](const auto& scene) { return scene != nullptr; });
  Traced traced(1.0 + kObjectWork * static_cast<double>(objects), report);
  stage.empty = share(tracer.trace(EmptyStage(), nullptr, [&](double row) { return traced.add(row); }));
  stage.phases.resize(scenes.size(), stage.empty);
  std::atomic<size_t> next = traced.stopped() ? scenes.size() : 0;
  const auto work = [&] {
    for (size_t phase = next++; phase < scenes.size(); phase = next++) {
      if (scenes[phase] == nullptr) continue;
      stage.phases[phase] = share(tracer.trace(*scenes[phase], stage.empty,
                                               [&](double row) { return traced.add(kObjectWork * row); }));
    }
  };
  std::vector<std::jthread> helpers;
  for (unsigned i = 1; i < std::thread::hardware_concurrency(); ++i) helpers.emplace_back(work);
  work();
  helpers.clear();
  if (traced.stopped()) return absl::CancelledError("the trace was stopped");
  return stage;
}

}  // namespace glasswing
