#include "core/sim/transport.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <tuple>

#include "core/base/status.h"
#include "core/sim/scene.h"

namespace glasswing {
namespace {

constexpr double kCameraWidths = 4.0;  // distance of the camera, in widths of the back monitor

enum class Side { kBack, kLeft, kRight, kTop };

struct Panel {
  Side side;
  std::int32_t monitor;
  MonitorSize size;
};

// Where a ray meets a panel, px of that panel.
struct Landing {
  double distance, u, v;
};

std::optional<Landing> land(const Ray& ray, const Panel& panel, MonitorSize back) {
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
  const bool inside = landing.u >= 0.0 && landing.u < panel.size.width_px && landing.v >= 0.0 &&
                      landing.v < panel.size.height_px;
  if (!inside) return std::nullopt;
  return landing;
}

void add_path(const Path& path, const std::vector<Panel>& panels, MonitorSize back, double scale,
              std::vector<Tap>& taps) {
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
  taps.push_back({.monitor = on->monitor,
                  .x_px = static_cast<std::int32_t>(nearest->u),
                  .y_px = static_cast<std::int32_t>(nearest->v),
                  .weight = static_cast<float>(path.weight * scale)});
}

// Sorted, each monitor pixel once.
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
  TransportBuilder(int width_px, int height_px, const std::vector<SceneMonitor>& monitors) {
    transport_.width_px_ = width_px;
    transport_.height_px_ = height_px;
    for (const SceneMonitor& monitor : monitors)
      transport_.parts_.emplace_back().width_px = monitor.size.width_px;
  }
  void begin_row() {
    for (Transport::Part& part : transport_.parts_) {
      part.first_taps.push_back(part.taps.size());
      part.rows.push_back({.first = std::numeric_limits<int>::max(), .last = -1});
    }
  }
  void add(const std::vector<Tap>& taps, float foreground) {
    for (Transport::Part& part : transport_.parts_) part.counts.push_back(0);
    for (const Tap& tap : taps) {
      Transport::Part& part = transport_.parts_[static_cast<size_t>(tap.monitor)];
      const auto channel = static_cast<int>(transport_.foreground_.size() % 3);
      part.taps.push_back(
          {.sample = static_cast<std::uint32_t>((tap.y_px * part.width_px + tap.x_px) * 3 + channel),
           .weight = tap.weight});
      ++part.counts.back();
      Transport::Rows& rows = part.rows.back();
      rows = {.first = std::min(rows.first, tap.y_px), .last = std::max(rows.last, tap.y_px)};
    }
    transport_.foreground_.push_back(foreground);
  }
  Transport built() { return std::move(transport_); }

 private:
  Transport transport_;
};

std::vector<Tap> Transport::taps(int x, int y, int channel) const {
  std::vector<Tap> taps;
  for (size_t m = 0; m < parts_.size(); ++m) {
    const Part& part = parts_[m];
    const std::uint16_t* counts = part.counts.data() + row_begin(y);
    const std::uint16_t* count = counts + 3 * x + channel;
    const SampleTap* tap =
        part.taps.data() + std::accumulate(counts, count, part.first_taps[static_cast<size_t>(y)]);
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
  return foreground_row(y)[static_cast<size_t>(3 * x + channel)];
}

std::span<const float> Transport::foreground_row(int y) const {
  return {foreground_.data() + row_begin(y), static_cast<size_t>(width_px_) * 3};
}

RadianceImage Transport::respond(std::span<const RadianceImage> pictures) const {
  RadianceImage out(width_px_, height_px_);
  for (int y = 0; y < height_px_; ++y) {
    const std::span<float> row(out.samples.data() + row_begin(y), static_cast<size_t>(width_px_) * 3);
    std::ranges::copy(foreground_row(y), row.begin());
    for (size_t m = 0; m < pictures.size(); ++m) {
      const float* samples = pictures[m].samples.data();
      if (!pictures[m].empty()) add_row(m, y, row, [&](std::uint32_t sample) { return samples[sample]; });
    }
  }
  return out;
}

absl::StatusOr<Transport> build_transport(const std::string& scene_name, bool object,
                                          const std::vector<SceneMonitor>& monitors, int camera_width_px,
                                          int camera_height_px, int rays_across) {
  MonitorSize back;
  std::vector<Panel> panels;
  for (size_t i = 0; i < monitors.size(); ++i) {
    Panel panel{.side = Side::kBack, .monitor = static_cast<std::int32_t>(i), .size = monitors[i].size};
    const std::string& name = monitors[i].name;
    if (name == "back") {
      back = panel.size;
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
    panels.push_back(panel);
  }
  if (back.width_px == 0)
    return absl::InvalidArgumentError("a scene needs a monitor \"back\", behind the object");
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<Scene> scene, make_scene(scene_name, back));

  const Vec3 eye{0.5 * back.width_px, 0.5 * back.height_px, -kCameraWidths * back.width_px};
  const double scale = 1.0 / (rays_across * rays_across);
  TransportBuilder builder(camera_width_px, camera_height_px, monitors);
  for (int y = 0; y < camera_height_px; ++y) {
    builder.begin_row();
    for (int x = 0; x < camera_width_px; ++x) {
      for (int c = 0; c < 3; ++c) {
        std::vector<Tap> taps;
        int hits = 0;
        for (int s = 0; s < rays_across * rays_across; ++s) {
          const Vec3 target{(x + (s % rays_across + 0.5) / rays_across) * back.width_px / camera_width_px,
                            (y + (s / rays_across + 0.5) / rays_across) * back.height_px / camera_height_px,
                            0.0};
          const Ray ray{eye, normalized(target - eye)};
          // Within kRaysAcross x kRaysAcross of them, whatever pixels they make.
          const int number = (y * rays_across + s / rays_across) % kRaysAcross * kRaysAcross +
                             (x * rays_across + s % rays_across) % kRaysAcross;
          std::optional<std::vector<Path>> paths;
          if (object && scene != nullptr) paths = scene->trace(ray, c, number);
          if (!paths) {
            add_path({.ray = ray, .weight = 1.0}, panels, back, scale, taps);
            continue;
          }
          ++hits;
          for (const Path& path : *paths) add_path(path, panels, back, scale, taps);
        }
        merge(taps);
        const float own = hits == 0 ? 0.0f : scene->foreground()[static_cast<size_t>(c)];
        builder.add(taps, own * static_cast<float>(hits * scale));
      }
    }
  }
  return builder.built();
}

}  // namespace glasswing
