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
#include "tests/solver/any/shape_scene.h"

namespace glasswing::adaptive {
namespace {

using gate::Scene;

using any_shape::kMonitor;

constexpr double kNoise_sd = 0.005;
constexpr int kPixels = 10;  // in each row that see the object

// Two rows of pixels, all but the ends of which see the object: the first `rings` of each rings, the others
// Gaussians, each elsewhere.
Scene scene_of(int rings, double radius_px = 12.0) {
  Scene scene = any_shape::two_rows("adaptive", kPixels + 2);
  const any_shape::Shape ring = [&](double x, double y) {
    return std::exp(-0.5 * std::pow(std::hypot(x, y) - radius_px, 2));
  };
  std::mt19937 random(9);
  const auto in = [&](double low, double high) { return low + (high - low) * gate::uniform(random); };
  const int count = scene.camera.width_px * scene.camera.height_px;
  for (int i = 0; i < count; ++i) {
    const int x = i % scene.camera.width_px;
    if (x == 0 || x > kPixels) continue;
    const double x_px = in(26, 102), y_px = in(26, 70);
    const gate::Shares shares =
        x <= rings ? any_shape::shares_of(ring, x_px, y_px)
                   : gate::shares_of(gate::gaussian({x_px, y_px, in(1.0, 4.0), in(0.7, 3.0), in(0.0, 180.0)}),
                                     kMonitor);
    any_shape::put(scene, i, shares);
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
  return any_shape::solved(scene, text, kNoise_sd, options);
}

const std::map<std::string, std::string> kAny{{"footprints", "any"}};

// A capture that begins with 50 images and may have `at_most`; its drafts are solved with these options.
struct Grown {
  std::map<int, v1::Plan> plans;  // by images
  std::map<int, Matte> mattes;
  v1::AdaptedRound first, last;
};
Grown grown(const Scene& scene, const std::map<std::string, std::string>& options, int at_most,
            double target_db = 80.0) {
  Grown grown;
  v1::Plan plan = designed(50, false);
  plan.mutable_adapt()->set_target_db(target_db);
  plan.mutable_adapt()->set_at_most(at_most);
  while (true) {
    Matte matte = solved(scene, plan, options);
    JudgedView view;
    view.camera.set_read_sd(kNoise_sd);
    add_pixels_of_object(matte, 0, 1, 1, view.pixels);
    Adaptation adaptation = adapt({std::move(view)}, plan, monitors()).value();
    grown.last = adaptation.found.front();
    if (grown.plans.empty()) grown.first = grown.last;
    grown.plans[grown.last.image_count()] = plan;
    grown.mattes[grown.last.image_count()] = std::move(matte);
    if (!adaptation.next) return grown;
    *plan.add_rounds() = *std::move(adaptation.next);
  }
}

// A picture such as photographs are: amplitudes of waves fall with their frequency, and most of it is light
// or dark with edges between.
RadianceImage photograph_like(unsigned seed) {
  std::mt19937 random(seed);
  RadianceImage picture(kMonitor.width_px, kMonitor.height_px);
  for (int c = 0; c < kChannels; ++c) {
    std::vector<std::array<double, 4>> waves;
    for (int i = 0; i < 60; ++i) {
      const double f = 0.008 * std::pow(30.0, gate::uniform(random)),
                   turn = std::numbers::pi * gate::uniform(random),
                   phase = 2.0 * std::numbers::pi * gate::uniform(random);
      waves.push_back({2.0 * std::numbers::pi * f * std::cos(turn),
                       2.0 * std::numbers::pi * f * std::sin(turn), phase, 0.0064 / f});
    }
    for (int y = 0; y < kMonitor.height_px; ++y) {
      for (int x = 0; x < kMonitor.width_px; ++x) {
        double sum = 0.0;
        for (const auto& [u, v, phase, amplitude] : waves) sum += amplitude * std::sin(u * x + v * y + phase);
        picture.at(x, y, c) = static_cast<float>(0.5 + 0.5 * std::tanh(sum));
      }
    }
  }
  return picture;
}

// The mean of three pictures' errors.
double psnr_of(const Scene& scene, const Matte& matte) {
  double squares = 0.0;
  for (const unsigned seed : {21u, 22u, 23u}) {
    const std::vector<RadianceImage> shown{photograph_like(seed)};
    const double db =
        gate::psnr(scene, composite(matte, shown).value(), gate::photograph(scene, true, shown));
    squares += std::pow(10.0, -db / 10.0) / 3.0;
  }
  return -10.0 * std::log10(squares);
}

int round_directions(const v1::Plan& plan) {
  std::set<double> found;
  for (const v1::Round& round : plan.rounds()) {
    for (const v1::Fringes& fringes : round.fringes()) found.insert(fringes.orientation_deg());
  }
  return static_cast<int>(found.size());
}

// As many images as a plan that was designed for any footprint, after one round and after two. A decibel is
// what the first round loses to the first 50, which were chosen for Gaussians.
TEST(AdaptiveAny, RingsAreShownAsByAPlanForAnyFootprint) {
  const Scene scene = scene_of(kPixels);
  const Grown any = grown(scene, kAny, 200), gaussian = grown(scene, {}, 200);
  EXPECT_EQ(any.last.any_shape().share(), 1.0);
  for (const int images : {100, 200}) {
    const double adapted = psnr_of(scene, any.mattes.at(images)),
                 usual = psnr_of(scene, solved(scene, gaussian.plans.at(images), kAny)),
                 designed_any = psnr_of(scene, solved(scene, designed(images, true), kAny)),
                 designed_usual = psnr_of(scene, solved(scene, designed(images, false), kAny));
    std::printf(
        "rings, %d images: %.1f dB in %d directions, rounds for Gaussians %.1f; designed for any footprint "
        "%.1f, for Gaussians %.1f\n",
        images, adapted, round_directions(any.plans.at(images)), usual, designed_any, designed_usual);
    if (images == 100) {  // after the second round designed plans are better by more (docs/adaptive.md)
      EXPECT_GE(adapted, designed_any - 1.0);
    }
    EXPECT_GT(adapted, usual) << images;
  }
}

// Drafts with footprints=any show the same images if Gaussians explain every pixel.
TEST(AdaptiveAny, GaussiansAreShownWhatTheyAreWithout) {
  const Scene scene = scene_of(0);
  const Grown any = grown(scene, kAny, 80), gaussian = grown(scene, {}, 80);
  ASSERT_FALSE(any.first.has_any_shape());
  ASSERT_EQ(any.last.image_count(), gaussian.last.image_count());
  EXPECT_EQ(any.plans.at(80).rounds(0).SerializeAsString(),
            gaussian.plans.at(80).rounds(0).SerializeAsString());
}

}  // namespace
}  // namespace glasswing::adaptive
