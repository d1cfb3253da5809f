// Adaptive captures of light that no few Gaussians describe: drafts say which pixels, and these choose
// waves. Truth is by brute force: sums over a monitor's flat pixels (tests/gate/light.h).
#include <google/protobuf/text_format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <set>
#include <string>

#include "core/composite/compositor.h"
#include "core/design/adaptation.h"
#include "core/design/plan_design.h"
#include "solver/methods.h"
#include "solver/worker/parallel_solve.h"
#include "tests/gate/scene.h"
#include "tests/solver/stack_of.h"
#include "tests/support/status.h"

namespace glasswing::adaptive {
namespace {

using gate::Scene;

constexpr gate::Size kMonitor{128, 96};
constexpr double kNoise_sd = 0.005;
constexpr int kPixels = 10;  // in each row that see the object

gate::Shares ring_at(double x_px, double y_px, double radius_px) {
  constexpr int kSide = 5;  // samples across a pixel
  gate::Shares shares;
  double sum = 0.0;
  for (int y = 0; y < kMonitor.height_px; ++y) {
    for (int x = 0; x < kMonitor.width_px; ++x) {
      double light = 0.0;
      for (int i = 0; i < kSide * kSide; ++i) {
        const double r =
            std::hypot(x + (i % kSide + 0.5) / kSide - x_px, y + (i / kSide + 0.5) / kSide - y_px);
        light += std::exp(-0.5 * std::pow(r - radius_px, 2));
      }
      if (light < 1e-6) continue;
      shares.push_back({x, y, light});
      sum += light;
    }
  }
  for (gate::Share& share : shares) share.part /= sum;
  return shares;
}

// Two rows of pixels, all but the ends of which see the object: the first `rings` of each rings, the others
// Gaussians, each elsewhere.
Scene scene_of(int rings, double radius_px = 12.0) {
  Scene scene = gate::empty_scene("adaptive", {});
  scene.camera = {kPixels + 2, 2};
  scene.monitors = {kMonitor};
  scene.empty.clear();
  std::mt19937 random(9);
  const auto in = [&](double low, double high) { return low + (high - low) * gate::uniform(random); };
  const int count = scene.camera.width_px * scene.camera.height_px;
  for (int i = 0; i < count; ++i) {
    const gate::Box behind{.x_px = 6.0 * (i % scene.camera.width_px) + 5.0,
                           .y_px = 6.0 * (i / scene.camera.width_px) + 30.0,
                           .width_px = 2.0,
                           .height_px = 2.0};
    scene.empty.push_back(
        {.foreground = {}, .paths = {{.tint = {1, 1, 1}, .shares = gate::shares_of(behind, kMonitor)}}});
  }
  scene.object = scene.empty;
  scene.inside.assign(scene.empty.size(), false);
  for (int i = 0; i < count; ++i) {
    const int x = i % scene.camera.width_px;
    if (x == 0 || x > kPixels) continue;
    const double x_px = in(26, 102), y_px = in(26, 70);
    const gate::Shares shares =
        x <= rings ? ring_at(x_px, y_px, radius_px)
                   : gate::shares_of(gate::gaussian({x_px, y_px, in(1.0, 4.0), in(0.7, 3.0), in(0.0, 180.0)}),
                                     kMonitor);
    scene.object[i] = {.foreground = {0.02, 0.02, 0.02},
                       .paths = {{.tint = {0.6, 0.6, 0.6}, .shares = shares}}};
    scene.inside[i] = true;
  }
  return scene;
}

const std::vector<v1::Monitor>& monitors() {
  static const std::vector<v1::Monitor> monitors = [] {
    v1::Monitor back;
    back.set_name("back");
    back.set_width_px(kMonitor.width_px);
    back.set_height_px(kMonitor.height_px);
    return std::vector<v1::Monitor>{back};
  }();
  return monitors;
}

v1::Plan designed(int images, bool any) {
  const DesignWish wish{
      .images = images, .noise = {.read_sd = kNoise_sd, .full_well = {}}, .any_footprints = any};
  return design_plan(wish, {.monitors = monitors(), .camera = {}}).value().plan;
}

Matte solved(const Scene& scene, const v1::Plan& plan, const std::map<std::string, std::string>& options) {
  std::string text;
  google::protobuf::TextFormat::PrintToString(plan, &text);
  gate::Recording recording = gate::recorded(scene, text);
  recording.manifest.mutable_camera()->set_read_sd(kNoise_sd);
  const std::vector<Image16> frames = gate::noisy(recording.frames, kNoise_sd);
  auto matte = solve_in_bands(*make_method("gaussian", options).value(), recording.manifest,
                              stack_of(recording.manifest, frames));
  EXPECT_OK(matte);
  return *std::move(matte);
}

const std::map<std::string, std::string> kAny{{"footprints", "any"}};

struct Grown {
  v1::Plan plan;
  Matte matte;  // of all its images
  v1::AdaptedRound first, last;
};
// A capture that begins with 50 images and may have `at_most`; its drafts are solved with these options.
Grown grown(const Scene& scene, const std::map<std::string, std::string>& options, int at_most,
            double target_db = 80.0) {
  Grown grown{.plan = designed(50, false), .matte = {}, .first = {}, .last = {}};
  grown.plan.mutable_adapt()->set_target_db(target_db);
  grown.plan.mutable_adapt()->set_at_most(at_most);
  while (true) {
    grown.matte = solved(scene, grown.plan, options);
    JudgedView view;
    view.camera.set_read_sd(kNoise_sd);
    add_pixels_of_object(grown.matte, 0, 1, 1, view.pixels);
    Adaptation adaptation = adapt({std::move(view)}, grown.plan, monitors()).value();
    grown.last = adaptation.found.front();
    if (grown.plan.rounds().empty()) grown.first = grown.last;
    if (!adaptation.next) return grown;
    *grown.plan.add_rounds() = *std::move(adaptation.next);
  }
}

double psnr_of(const Scene& scene, const Matte& matte) {
  double sum = 0.0;
  for (const char* name : {"waves", "checks", "grain"}) {
    const std::vector<RadianceImage> shown = gate::pictures(scene, name);
    sum += gate::psnr(scene, composite(matte, shown).value(), gate::photograph(scene, true, shown)) / 3.0;
  }
  return sum;
}

int round_directions(const v1::Plan& plan) {
  std::set<double> found;
  for (const v1::Round& round : plan.rounds()) {
    for (const v1::Fringes& fringes : round.fringes()) found.insert(fringes.orientation_deg());
  }
  return static_cast<int>(found.size());
}

TEST(AdaptiveAny, Prototype) {
  for (const int rings : {kPixels, kPixels / 2, 0}) {
    const Scene scene = scene_of(rings);
    for (const int images : {100, 200}) {
      Grown now = grown(scene, kAny, images), before = grown(scene, {}, images);
      const Matte of_before = solved(scene, before.plan, kAny),
                  of_any = solved(scene, designed(images, true), kAny),
                  of_designed = solved(scene, designed(images, false), kAny);
      std::printf(
          "%d rings, %d images: adaptive any %.1f dB (%d directions, %d images), adaptive %.1f (%d, %d "
          "images), design any %.1f, design %.1f\n",
          rings, images, psnr_of(scene, now.matte), round_directions(now.plan), now.last.image_count(),
          psnr_of(scene, of_before), round_directions(before.plan), before.last.image_count(),
          psnr_of(scene, of_any), psnr_of(scene, of_designed));
      std::printf("  first %s last %s\n  why %s\n", now.first.ShortDebugString().c_str(),
                  now.last.ShortDebugString().c_str(),
                  now.plan.rounds().empty() ? "" : now.plan.rounds().rbegin()->why().c_str());
      std::fflush(stdout);
    }
  }
}

}  // namespace
}  // namespace glasswing::adaptive
