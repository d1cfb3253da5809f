// The rounds of captures with several cameras, and of those with pixels of any shape.
#include "core/design/adaptation.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "core/design/plan_design.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

const std::vector<v1::Monitor>& monitors() {
  static const std::vector<v1::Monitor> monitors = [] {
    v1::Monitor back;
    back.set_name("back");
    back.set_width_px(128);
    back.set_height_px(96);
    back.set_refresh_hz(60.0);
    return std::vector<v1::Monitor>{back};
  }();
  return monitors;
}

v1::Plan plan(double target_db) {
  DesignWish wish;
  wish.images = 30;
  v1::Plan plan = design_plan(wish, {.monitors = monitors(), .camera = {}, .blur_px = 0.0}).value().plan;
  plan.mutable_adapt()->set_target_db(target_db);
  return plan;
}

// An object that shows the monitor through footprints of this width, more or less, seen with this noise.
JudgedView view_of(double sigma_px, double read_sd) {
  JudgedView view;
  view.camera.set_read_sd(read_sd);
  for (int i = 0; i < 30; ++i) {
    JudgedPixel& pixel = view.pixels.emplace_back(1);
    const double xx_px2 = sigma_px * sigma_px * (1.0 + 0.01 * i);
    pixel.front().modes.push_back({.weight = 0.8,
                                   .x_px = 30.0 + 2.0 * i,
                                   .y_px = 20.0 + 1.7 * i,
                                   .xx_px2 = xx_px2,
                                   .xy_px2 = 0.0,
                                   .yy_px2 = xx_px2});
  }
  return view;
}

Adaptation adapted(std::vector<JudgedView> views, const v1::Plan& plan) {
  return adapt(std::move(views), plan, monitors()).value();
}
std::string fringes(const Adaptation& adaptation) {
  v1::Round waves = adaptation.next.value();
  waves.clear_why();
  return waves.SerializeAsString();
}

TEST(Adaptation, CamerasThatSeeTheSameChooseWhatOneChooses) {
  const v1::Plan first = plan(48.0);
  const Adaptation one = adapted({view_of(1.0, 0.005)}, first);
  const Adaptation two = adapted({view_of(1.0, 0.005), view_of(1.0, 0.005)}, first);
  EXPECT_EQ(fringes(two), fringes(one));
  ASSERT_EQ(two.found.size(), 2u);
  for (const v1::AdaptedRound& found : two.found)
    EXPECT_EQ(found.SerializeAsString(), one.found.front().SerializeAsString());
}

TEST(Adaptation, OnlyCamerasThatKnowTooLittleChoose) {
  const v1::Plan first = plan(48.0);
  const JudgedView noisy = view_of(1.0, 0.005), clear = view_of(1.0, 0.0001);
  const Adaptation both = adapted({clear, noisy}, first);
  EXPECT_GE(both.found[0].known_share(), 0.95);
  EXPECT_LT(both.found[1].known_share(), 0.95);
  EXPECT_EQ(fringes(both), fringes(adapted({noisy}, first)));
  EXPECT_FALSE(adapted({clear, clear}, first).next);
}

// Wide footprints need other waves than narrow ones.
TEST(Adaptation, RoundsEndWhenEveryCameraKnowsEnough) {
  v1::Plan grown = plan(40.0);
  const std::vector<JudgedView> views{view_of(0.5, 0.005), view_of(3.0, 0.005)};
  const Adaptation first = adapted(views, grown);
  const double finest_px = std::min(first.found[0].error_px(), first.found[1].error_px());
  grown.mutable_adapt()->clear_target_db();
  grown.mutable_adapt()->set_target_px(0.6 * finest_px);
  grown.mutable_adapt()->set_at_most(2000);
  Adaptation adaptation = adapted(views, grown);
  EXPECT_NE(fringes(adaptation), fringes(adapted({views[0]}, grown)));
  EXPECT_NE(fringes(adaptation), fringes(adapted({views[1]}, grown)));
  for (int round = 0; adaptation.next && round < 6; ++round) {
    *grown.add_rounds() = *adaptation.next;
    adaptation = adapted(views, grown);
  }
  EXPECT_FALSE(adaptation.next);
  for (const v1::AdaptedRound& found : adaptation.found) EXPECT_GE(found.known_share(), 0.95);
}

// The first `shapes` of them are of any shape.
JudgedView with_shapes(int shapes) {
  JudgedView view = view_of(1.0, 0.005);
  for (int i = 0; i < shapes; ++i) {
    KnownPixel& pixel = view.pixels[i].front();
    pixel.any_shape = true;
    pixel.modes[0].xx_px2 = pixel.modes[0].yy_px2 = 64.0;
  }
  return view;
}

// Waves in directions that Gaussians do not ask for.
int other_waves(const Adaptation& adaptation) {
  int count = 0;
  const v1::Round& round = adaptation.next.value();
  for (const v1::Fringes& fringes : round.fringes())
    count += std::remainder(fringes.orientation_deg(), 22.5) != 0.0 ? fringes.period_px_size() : 0;
  return count;
}

// As recorded before there were shapes.
TEST(Adaptation, GaussiansChooseWhatTheyWouldWithoutShapes) {
  std::string chosen;
  const Adaptation adaptation = adapted({with_shapes(0)}, plan(48.0));
  for (const v1::Fringes& fringes : adaptation.next->fringes()) {
    for (const double period_px : fringes.period_px())
      chosen += fmt::format("{}:{} ", fringes.orientation_deg(), period_px);
  }
  EXPECT_FALSE(adaptation.found.front().has_any_shape());
  EXPECT_EQ(chosen, "0:6 45:6 67.5:6 90:6 135:6 157.5:6 ");
}

// The error of the first pixel once the round was shown.
double error_after(const Adaptation& adaptation, v1::Plan plan, const JudgedView& view) {
  *plan.add_rounds() = adaptation.next.value();
  KnownPixel pixel = view.pixels.front().front();
  pixel.noise = noise_of(view.camera);
  const PatternAnswers shown(shown_by(plan, monitors().front()).value(), extent_of(monitors().front()));
  return errors_of(shown, std::array{pixel}).front().composite;
}

TEST(Adaptation, TheMorePixelsOfAnyShapeTheBetterTheyAreKnown) {
  const v1::Plan first = plan(48.0);
  const JudgedView all = with_shapes(30);
  double before = error_after(adapted({with_shapes(0)}, first), first, all);
  for (const int shapes : {6, 30}) {
    const Adaptation adaptation = adapted({with_shapes(shapes)}, first);
    const v1::AdaptedRound& found = adaptation.found.front();
    EXPECT_DOUBLE_EQ(found.any_shape().share(), shapes / 30.0);
    EXPECT_NE(adaptation.next->why().find("any shape"), std::string::npos) << adaptation.next->why();
    EXPECT_GT(other_waves(adaptation), 0);
    const double error = error_after(adaptation, first, all);
    EXPECT_LT(error, before);
    before = error;
  }
}

TEST(Adaptation, PositionsAreThoseOfGaussians) {
  v1::Plan positions = plan(48.0);
  positions.mutable_adapt()->clear_target_db();
  positions.mutable_adapt()->set_target_px(0.001);
  const Adaptation adaptation = adapted({with_shapes(10)}, positions);
  EXPECT_FALSE(adaptation.found.front().has_any_shape());
  EXPECT_EQ(other_waves(adaptation), 0);
}

}  // namespace
}  // namespace glasswing
