#include "core/pattern/draft_stages.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "tests/support/status.h"

namespace glasswing {
namespace {

v1::Monitor monitor(const std::string& name, int width, int height) {
  v1::Monitor m;
  m.set_name(name);
  m.set_width_px(width);
  m.set_height_px(height);
  return m;
}

constexpr const char* kCrystal = R"(
  method: "gaussian"
  sweeps { orientation_deg: 0   sigma_px: 4 step_px: 2 }
  sweeps { orientation_deg: 90  sigma_px: 4 step_px: 2 }
  sweeps { orientation_deg: 45  sigma_px: 4 step_px: 2 }
  sweeps { orientation_deg: -45 sigma_px: 4 step_px: 2 }
  solids { colour: [0, 0, 0] }
  solids { colour: [1, 1, 1] }
  square_waves { levels: 7 }
)";

std::vector<Step> steps_of(const v1::Plan& plan, const std::vector<v1::Monitor>& monitors) {
  const absl::StatusOr<std::vector<Step>> steps = expand(plan, monitors);
  EXPECT_OK(steps);
  return steps.value_or(std::vector<Step>());
}

v1::Plan plan_of(const std::string& text) {
  const absl::StatusOr<v1::Plan> plan = parse_plan(text, "p");
  EXPECT_OK(plan);
  return plan.value_or(v1::Plan());
}

bool is_stripe(const Step& step) {
  return step.stimulus.kind() == "gauss_stripe";
}

TEST(DraftStages, OnlyStripesMoveAndEachStaysWithItsMonitor) {
  v1::Plan plan = plan_of(kCrystal);
  plan.set_white_every(20);
  plan.add_exposure_ms(2.0);
  plan.add_exposure_ms(8.0);
  const std::vector<Step> steps = steps_of(plan, {monitor("back", 128, 96), monitor("left", 96, 64)});
  const std::vector<Step> shown = in_order_of_showing(steps);
  ASSERT_EQ(shown.size(), steps.size());
  std::set<int> numbers;
  for (size_t i = 0; i < steps.size(); ++i) {
    numbers.insert(shown[i].number);
    ASSERT_EQ(is_stripe(shown[i]), is_stripe(steps[i])) << i;
    EXPECT_EQ(shown[i].stimulus.panel(), steps[i].stimulus.panel()) << i;
    EXPECT_EQ(shown[i].exposure_ms, steps[i].exposure_ms) << i;
    EXPECT_EQ(shown[i].object, steps[i].object) << i;
    if (!is_stripe(steps[i])) {
      EXPECT_EQ(shown[i].number, steps[i].number);
    }
  }
  EXPECT_EQ(numbers.size(), steps.size());
}

TEST(DraftStages, CoarseStripesComeFirstAndAreAtMostOneAndAHalfSigmasApart) {
  const std::vector<Step> shown =
      in_order_of_showing(steps_of(plan_of(kCrystal), {monitor("back", 128, 96)}));
  std::vector<Step> stripes;
  std::ranges::copy_if(shown, std::back_inserter(stripes), is_stripe);
  // Up to the first stripe between two that were shown before it, all are coarse.
  std::map<double, std::vector<double>> coarse;
  size_t i = 0;
  for (; i < stripes.size(); ++i) {
    std::vector<double>& before = coarse[stripes[i].stimulus.phi_deg()];
    if (!before.empty() && stripes[i].stimulus.r_px() < before.back()) break;
    before.push_back(stripes[i].stimulus.r_px());
  }
  ASSERT_EQ(coarse.size(), 4u);
  EXPECT_LT(i, stripes.size() * 2 / 5);  // a third
  for (const auto& [phi_deg, r_px] : coarse) {
    for (size_t k = 1; k < r_px.size(); ++k) EXPECT_NEAR(r_px[k] - r_px[k - 1], 6.0, 1e-9);
    // Both ends of the sweep, which goes 8 px beyond the monitor, lose at most a sigma.
    const double phi_rad = phi_deg * std::acos(-1.0) / 180.0;
    const double across = 128 * std::cos(phi_rad), down = 96 * std::sin(phi_rad);
    EXPECT_LE(r_px.front(), std::min(across, 0.0) + std::min(down, 0.0) - 4.0 + 1e-6) << phi_deg;
    EXPECT_GE(r_px.back(), std::max(across, 0.0) + std::max(down, 0.0) + 4.0 - 1e-6) << phi_deg;
  }
}

TEST(DraftStages, SweepsThatAreCoarseAlreadyStayAsTheyAre) {
  const v1::Plan plan = plan_of(R"(
    method: "gaussian"
    sweeps { orientation_deg: 0 sigma_px: 5 step_px: 5.5 }
    sweeps { orientation_deg: 90 sigma_px: 5 step_px: 5.5 })");
  const std::vector<Step> steps = steps_of(plan, {monitor("back", 128, 96)});
  const std::vector<Step> shown = in_order_of_showing(steps);
  for (size_t i = 0; i < steps.size(); ++i) EXPECT_EQ(shown[i].number, steps[i].number);
}

// The directions of a monitor of which `shown` has stripes all over it, at most 1.5 sigma apart.
int covered_directions(std::span<const Step> shown, const std::string& panel) {
  std::map<double, std::set<double>> r_px;
  for (const Step& step : shown) {
    if (is_stripe(step) && step.stimulus.panel() == panel)
      r_px[step.stimulus.phi_deg()].insert(step.stimulus.r_px());
  }
  int covered = 0;
  for (const auto& [phi_deg, all] : r_px) {
    double widest = 0.0;
    for (auto r = std::next(all.begin()); r != all.end(); ++r) widest = std::max(widest, *r - *std::prev(r));
    if (all.size() >= 5 && widest <= 6.0 + 1e-9) ++covered;
  }
  return covered;
}

TEST(DraftStages, TheFirstStageOfAFullSessionComesWithinThreeTenths) {
  const v1::Plan plan = plan_of(kCrystal);
  const std::vector<Step> steps = steps_of(plan, {monitor("back", 640, 472)});
  const std::vector<Step> shown = in_order_of_showing(steps);
  const std::vector<DraftStage> stages = draft_stages(plan, shown);
  ASSERT_GE(stages.size(), 3u);
  EXPECT_LE(stages.front().step_count, 0.3 * static_cast<double>(steps.size()));
  EXPECT_EQ(stages.front().sweep_count, 3);
  EXPECT_EQ(stages[1].sweep_count, 4);
  EXPECT_EQ(count_sweeps(steps), 4);
  int before = 0;
  for (const DraftStage& stage : stages) {
    EXPECT_GT(stage.step_count, before);
    before = stage.step_count;
    EXPECT_EQ(covered_directions(std::span(shown).first(stage.step_count), "back"), stage.sweep_count);
  }
  EXPECT_LE(before, 0.9 * static_cast<double>(steps.size()));
}

TEST(DraftStages, AMonitorIsPartOfADraftOnceItWasSweptInThreeDirections) {
  const v1::Plan plan = plan_of(kCrystal);
  const std::vector<Step> shown =
      in_order_of_showing(steps_of(plan, {monitor("back", 128, 96), monitor("left", 128, 96)}));
  const std::vector<DraftStage> stages = draft_stages(plan, shown);
  ASSERT_FALSE(stages.empty());
  bool with_both = false;
  for (const DraftStage& stage : stages) {
    const auto part = std::span(shown).first(stage.step_count);
    EXPECT_GE(covered_directions(part, "back"), 3);
    const int left = covered_directions(part, "left");
    EXPECT_TRUE(left == 0 || left >= 3) << left;
    with_both = with_both || left > 0;
  }
  EXPECT_TRUE(with_both);
}

TEST(DraftStages, OfAPlanThatAdaptsEachRoundEndsOne) {
  v1::Plan plan = plan_of(kCrystal);
  plan.mutable_adapt();
  const std::vector<v1::Monitor> rig{monitor("back", 128, 96)};
  const size_t own = steps_of(plan, rig).size();
  for (const double period_px : {9.0, 7.0}) {
    v1::Fringes& fringes = *plan.add_rounds()->add_fringes();
    fringes.add_period_px(period_px);
    fringes.set_phases(2);
  }
  const std::vector<DraftStage> stages = draft_stages(plan, in_order_of_showing(steps_of(plan, rig)));
  ASSERT_EQ(stages.size(), 3u);
  for (size_t i = 0; i < stages.size(); ++i)
    EXPECT_EQ(static_cast<size_t>(stages[i].step_count), own + 2 * i);
}

TEST(DraftStages, OtherMethodsHaveNone) {
  v1::Plan plan = plan_of(kCrystal);
  const std::vector<Step> shown = in_order_of_showing(steps_of(plan, {monitor("back", 128, 96)}));
  plan.set_method("hierarchical");
  EXPECT_TRUE(draft_stages(plan, shown).empty());
}

}  // namespace
}  // namespace glasswing
