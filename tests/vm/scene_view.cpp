#include "tests/vm/scene_view.h"

namespace glasswing {
namespace {

constexpr nanoseconds kPatience = std::chrono::seconds(5);

}  // namespace

SceneView::SceneView(const std::string& scene, int width_px, int height_px, double full_scale_exposure_ms)
    : scene_(scene), width_px_(width_px), height_px_(height_px) {
  sensor_.read_sd = sensor_.gain = 0.0;
  sensor_.bits = 16;
  sensor_.full_scale_exposure_ms = full_scale_exposure_ms;
}

const Transport& SceneView::transport(const std::vector<MonitorEmission>& emission, bool object) {
  std::optional<Transport>& through = object ? with_ : without_;
  if (!through) {
    std::vector<SceneMonitor> lit;
    for (const MonitorEmission& each : emission)
      lit.push_back({.name = each.monitor.name, .size = {each.monitor.width_px, each.monitor.height_px}});
    through = build_transport(scene_, object, lit, width_px_, height_px_).value();
  }
  return *through;
}

Image16 SceneView::expose(const EmissionTimeline& timeline, const ExposureWindow& window, bool object) {
  const nanoseconds end = window.start + window.exposure;
  const auto emission =
      timeline.wait_known_until(end, kPatience) ? timeline.between(window.start, end) : std::nullopt;
  if (!emission || emission->empty()) return Image16(width_px_, height_px_);
  const double exposure_ms = std::chrono::duration<double, std::milli>(window.exposure).count();
  return glasswing::expose(integrate(transport(*emission, object), *emission, window, nanoseconds(0)),
                           exposure_ms, sensor_, 0);
}

}  // namespace glasswing
