// A capture for method gaussian on a small monitor: solids, bars and four sweeps.
#pragma once

#include <cmath>
#include <numbers>

#include "core/pattern/pattern.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing {

inline constexpr MonitorSize kSwept{.width_px = 64, .height_px = 48};

inline v1::Stimulus stripe_at(double phi_deg, double r_px, double sigma_px) {
  v1::Stimulus stripe;
  stripe.set_kind("gauss_stripe");
  stripe.set_panel("back");
  stripe.set_phi_deg(phi_deg);
  stripe.set_r_px(r_px);
  stripe.set_sigma_px(sigma_px);
  stripe.set_peak(1.0);
  return stripe;
}

inline void add_frame(v1::CaptureManifest& manifest, bool object, const v1::Stimulus& stimulus) {
  v1::Frame& frame = *manifest.add_frames();
  frame.set_file("frames/" + std::to_string(manifest.frames_size()) + ".tif");
  frame.set_object(object);
  *frame.mutable_stimulus() = stimulus;
}

// Stripes of 4 px, 2 px apart, up to 6 px past the edges.
inline v1::CaptureManifest swept_manifest() {
  v1::CaptureManifest manifest;
  v1::Monitor& monitor = *manifest.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(kSwept.width_px);
  monitor.set_height_px(kSwept.height_px);
  for (const bool object : {false, true}) {
    for (const double light : {0.0, 1.0}) {
      v1::Stimulus solid;
      solid.set_kind("solid");
      solid.set_panel("back");
      for (int c = 0; c < 3; ++c) solid.add_colour(light);
      add_frame(manifest, object, solid);
    }
    for (const char* orient : {"vertical_bars", "horizontal_bars"}) {
      for (const double width_px : {32.0, 8.0, 2.0}) {
        for (const bool inverse : {false, true}) {
          v1::Stimulus bars;
          bars.set_kind("square");
          bars.set_panel("back");
          bars.set_orient(orient);
          bars.set_bar_width_px(width_px);
          bars.set_inverse(inverse);
          add_frame(manifest, object, bars);
        }
      }
    }
  }
  for (const double phi_deg : {0.0, 90.0, 45.0, -45.0}) {
    const double across = kSwept.width_px * std::cos(phi_deg * std::numbers::pi / 180.0);
    const double down = kSwept.height_px * std::sin(phi_deg * std::numbers::pi / 180.0);
    const double low = std::min(across, 0.0) + std::min(down, 0.0) - 6.0;
    const double high = std::max(across, 0.0) + std::max(down, 0.0) + 6.0;
    for (double r = 2.0 * std::ceil(low / 2.0); r <= high; r += 2.0)
      add_frame(manifest, true, stripe_at(phi_deg, r, 4.0));
  }
  return manifest;
}

}  // namespace glasswing
