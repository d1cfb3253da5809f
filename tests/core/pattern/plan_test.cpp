#include "core/pattern/plan.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <set>

#include "core/pattern/id_patch.h"
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

TEST(Plan, ComplaintsNameFileLineValueAndWhatIsAccepted) {
  struct Case {
    const char* text;
    const char* message;
  };
  for (const Case& each : {
           Case{"method: \"gaussian\"\nsweeps {\n  orientation_deg: 0\n  sigma_px: 0\n}",
                "p.txtpb:4: sigma_px is 0; it must be in (0, 200]"},
           {"method: \"magic\"\nsolids { colour: [0, 0, 0] }",
            "p.txtpb:1: method is \"magic\"; it must be \"gaussian\", \"hierarchical\""},
           {"method: \"gaussian\"\nsolids { colour: [0, 2, 0] }",
            "p.txtpb:2: colour is 2; it must be in [0, 1]"},
           {"method: \"gaussian\"\nhold_refreshes: 1\nramp {}",
            "p.txtpb:2: hold_refreshes is 1; it must be 2 to 600"},
           {"method: \"gaussian\"\nexposure_ms: [4, -1]\nramp {}", "p.txtpb:2: exposure_ms is -1"},
           {"method: \"gaussian\"\nsweeps { sigma_px: nan }", "p.txtpb:2: sigma_px is nan"},
           {"method: \"gaussian\"\nsweps { }", "p.txtpb:2: "},
           {"method: \"gaussian\"", "must be at least one sweep"},
           {"method: \"gaussian\"\nsweeps { sigma_px: 4 step_px: 6.1 }",
            "p.txtpb:2: step_px is 6.1; it must be in [0.01, 1.5 sigma_px]"},
           {"method: \"fringe\"\nfringes { period_px: 1 }",
            "p.txtpb:2: period_px is 1; it must be in [2, 100000]"},
           {"method: \"fringe\"\nfringes { phases: 4 }", "period_px is left out"},
           {"method: \"fringe\"\nfringes {\n  period_px: 64\n  phases: 1\n}", "p.txtpb:4: phases is 1"},
           {"method: \"ramp\"\nsolids { colour: [0, 0, 0] }",
            "ramp is left out; it must be given with method"},
           {"method: \"ramp\"\nramp { frames: 0 }", "p.txtpb:2: frames is 0; it must be 1 to 18000"},
           {"method: \"ramp\"\nramp {\n  frames: 9\n  empty_frames: 1001\n}",
            "p.txtpb:4: empty_frames is 1001; it must be 1 to 1000"},
           {"method: \"ramp\"\nramp {}\nskip_empty_stage: true", "p.txtpb:3: skip_empty_stage is true"},
           {"method: \"ramp\"\nramp { frames: 9 }\nsweeps { sigma_px: 4 }", "p.txtpb:3: sweeps is given"},
           {"method: \"ramp\"\nramp { frames: 9 }\nexposure_ms: [1, 4]",
            "p.txtpb:3: exposure_ms is a second one"},
           {"method: \"ramp\"\nramp { frames: 9 }\nmonitors { name: \"a\" }\nmonitors { name: \"b\" }",
            "p.txtpb:4: monitors is a second one"},
           {"method: \"gaussian\"\nramp { frames: 9 }", "p.txtpb:2: frames is 9; it must be left out"},
           {"method: \"hierarchical\"\nsquare_waves { levels: 4 first_level: 5 }",
            "p.txtpb:2: first_level is 5; it must be 1 to 4"},
           {"method: \"fringe\"\nfringes { period_px: 64 }\nadapt {}",
            "p.txtpb:3: adapt is given; it must be left out with method \"fringe\""},
           {"method: \"gaussian\"\nfringes { period_px: 64 }\nadapt {\n  target_db: 90\n}",
            "p.txtpb:4: target_db is 90; it must be in [10, 80]"},
           {"method: \"gaussian\"\nfringes { period_px: 64 }\nadapt { target_db: 40 target_px: 1 }",
            "p.txtpb:3: target_px is 1; it must be left out where target_db is given"},
           {"method: \"gaussian\"\nfringes { period_px: 64 }\nadapt { at_most: 20 }",
            "p.txtpb:3: at_most is 20; it must be 30 to 20000"},
           {"method: \"gaussian\"\nfringes { period_px: 64 }\nadapt { footprints: \"ring\" }",
            "p.txtpb:3: footprints is \"ring\"; it must be \"gaussian\" or \"any\""},
           {"method: \"gaussian\"\nfringes { period_px: 64 }\nrounds {\n  fringes { period_px: 1 }\n}",
            "p.txtpb:4: period_px is 1; it must be in [2, 100000]"},
       }) {
    const absl::Status status = parse_plan(each.text, "p.txtpb").status();
    EXPECT_TRUE(absl::IsInvalidArgument(status));
    EXPECT_NE(std::string(status.message()).find(each.message), std::string::npos) << status;
  }
}

TEST(Plan, FromTheWireComplaintsNameTheField) {
  v1::Plan plan;
  plan.set_method("gaussian");
  plan.add_sweeps()->set_sigma_px(4);
  plan.add_sweeps()->set_sigma_px(-4);
  const absl::Status status = check_plan(plan);
  EXPECT_NE(std::string(status.message()).find("plan.sweeps[1].sigma_px is -4"), std::string::npos) << status;
}

std::vector<v1::Stimulus> shown(const v1::Plan& plan) {
  std::vector<v1::Stimulus> stimuli;
  const std::vector<Step> steps = expand(plan, {monitor("back", 128, 96)}).value();
  for (const Step& step : steps) {
    if (step.object) stimuli.push_back(step.stimulus);
  }
  return stimuli;
}

TEST(Plan, FringesShowEveryPeriodAtEqualPhases) {
  const std::vector<v1::Stimulus> stimuli = shown(
      parse_plan("method: \"fringe\" fringes { orientation_deg: 90 period_px: [128, 16] phases: 3 }", "p")
          .value());
  ASSERT_EQ(stimuli.size(), 6u);
  for (size_t i = 0; i < stimuli.size(); ++i) {
    EXPECT_EQ(stimuli[i].kind(), "sinusoid");
    EXPECT_EQ(stimuli[i].phi_deg(), 90.0);
    EXPECT_EQ(stimuli[i].period_px(), i < 3 ? 128.0 : 16.0);
    EXPECT_EQ(stimuli[i].phase_deg(), 120.0 * static_cast<double>(i % 3));
  }
}

// A frame's step number must mean the same picture whatever is chosen later.
TEST(Plan, ARoundComesLastAndChangesNoStepBefore) {
  v1::Plan plan = parse_plan(R"(
    method: "gaussian"
    fringes { period_px: [64, 16] object_only: true }
    solids { colour: [0, 0, 0] }
    photos { file: "a.png" }
    exposure_ms: [1, 4]
    adapt {})",
                             "p.txtpb")
                      .value();
  const std::vector<v1::Monitor> rig{monitor("back", 128, 96), monitor("left", 128, 96)};
  std::vector<Step> before = expand(plan, rig).value();
  for (const double period_px : {9.0, 7.0}) {
    v1::Fringes& fringes = *plan.add_rounds()->add_fringes();
    fringes.add_period_px(period_px);
    fringes.set_phases(2);
    const std::vector<Step> after = expand(plan, rig).value();
    // Two phases on two monitors at two exposures.
    ASSERT_EQ(after.size(), before.size() + 8);
    for (size_t i = 0; i < after.size(); ++i) {
      EXPECT_EQ(after[i].number, static_cast<int>(i));
      if (i < before.size()) {
        EXPECT_EQ(after[i].stimulus.SerializeAsString(), before[i].stimulus.SerializeAsString());
        EXPECT_EQ(after[i].exposure_ms, before[i].exposure_ms);
        continue;
      }
      EXPECT_EQ(after[i].round, plan.rounds_size());
      EXPECT_TRUE(after[i].object);
      EXPECT_EQ(after[i].stimulus.period_px(), period_px);
    }
    before = after;
  }
}

TEST(Plan, SquareWavesLeaveOutWhatTheyAreTold) {
  const std::vector<v1::Stimulus> stimuli = shown(
      parse_plan("method: \"gaussian\" square_waves { levels: 3 first_level: 2 without_complements: true }",
                 "p")
          .value());
  ASSERT_EQ(stimuli.size(), 4u);
  for (const v1::Stimulus& bars : stimuli) {
    EXPECT_FALSE(bars.inverse());
    EXPECT_TRUE(bars.bar_width_px() == 32.0 || bars.bar_width_px() == 16.0);
  }
}

TEST(Plan, AVideoShowsTheRampAloneAfterTheEmptyStage) {
  const v1::Plan plan =
      parse_plan(
          "method: \"ramp\" ramp { frames: 300 } solids { colour: [0, 0, 0] } square_waves { "
          "levels: 2 } monitors { name: \"back\" }",
          "p")
          .value();
  ASSERT_TRUE(is_video(plan));
  std::vector<v1::Monitor> rig{monitor("back", 128, 96), monitor("left", 8, 8)};
  rig[0].set_patch_rows(8);
  const std::vector<Step> steps = expand(plan, rig).value();
  std::map<std::pair<bool, std::string>, int> count;
  for (const Step& step : steps) {
    ++count[{step.object, step.stimulus.kind()}];
    EXPECT_EQ(step.stimulus.panel(), "back");
  }
  const int learning = static_cast<int>(patch_learning_ids().size());
  const std::map<std::pair<bool, std::string>, int> expected{
      {{false, "patch"}, learning}, {{false, "solid"}, 1},       {{false, "square"}, 8},
      {{false, "ramp"}, 16},        {{true, "patch"}, learning}, {{true, "ramp"}, 300}};
  EXPECT_EQ(count, expected);

  v1::Plan unnamed = plan;
  unnamed.clear_monitors();
  EXPECT_OK(expand(unnamed, {rig[0]}));
  const absl::Status status = expand(unnamed, rig).status();
  EXPECT_NE(std::string(status.message()).find("a video is of one monitor; the rig has 2"), std::string::npos)
      << status;
}

TEST(Plan, AStillOfTheRampIsLikeAnyOtherFrame) {
  const v1::Plan plan =
      parse_plan("method: \"ramp\" ramp { empty_frames: 5 } solids { colour: [0, 0, 0] }", "p").value();
  EXPECT_FALSE(is_video(plan));
  int empty = 0, with = 0;
  const std::vector<Step> steps = expand(plan, {monitor("back", 8, 8)}).value();
  for (const Step& step : steps) {
    if (step.stimulus.kind() == "ramp") ++(step.object ? with : empty);
  }
  EXPECT_EQ(empty, 5);
  EXPECT_EQ(with, 1);
}

TEST(Plan, SweepsCoverTheMonitorWithEvenSteps) {
  const v1::Plan plan =
      parse_plan(
          "method: \"gaussian\" skip_empty_stage: true "
          "sweeps { orientation_deg: 90 sigma_px: 4 } sweeps { orientation_deg: -45 sigma_px: 4 step_px: 1 }",
          "p")
          .value();
  const std::vector<Step> steps = expand(plan, {monitor("back", 128, 96)}).value();
  std::map<double, std::vector<double>> peaks;
  for (const Step& step : steps) {
    EXPECT_TRUE(step.object);
    peaks[step.stimulus.phi_deg()].push_back(step.stimulus.r_px());
  }
  // Down: y from 0 to 96, two sigmas past each edge. Up and right: x cos 45 - y sin 45 from -96 to 128 over
  // sqrt 2.
  const std::map<double, std::array<double, 3>> expected{
      {90.0, {-8.0, 104.0, 2.0}}, {-45.0, {-96 / std::sqrt(2.0) - 8, 128 / std::sqrt(2.0) + 8, 1.0}}};
  for (const auto& [phi, extent] : expected) {
    const std::vector<double>& r = peaks.at(phi);
    EXPECT_GE(r.front(), extent[0] - 1e-6);
    EXPECT_LT(r.front(), extent[0] + extent[2]);
    EXPECT_LE(r.back(), extent[1] + 1e-6);
    EXPECT_GT(r.back(), extent[1] - extent[2]);
    for (size_t i = 1; i < r.size(); ++i) EXPECT_NEAR(r[i] - r[i - 1], extent[2], 1e-9);
  }
}

TEST(Plan, EveryPatternWithoutTheObjectIsTakenWithItToo) {
  const v1::Plan plan = parse_plan(
                            "method: \"gaussian\" exposure_ms: [1, 4] ramp {} solids { colour: [0, 0, 0] } "
                            "square_waves { levels: 3 } "
                            "sweeps { sigma_px: 8 } photos { file: \"0123\" name: \"p\" }",
                            "p")
                            .value();
  const std::vector<Step> steps = expand(plan, {monitor("back", 32, 20), monitor("left", 20, 20)}).value();
  std::set<std::string> with;
  std::multiset<std::string> all;
  for (size_t i = 0; i < steps.size(); ++i) {
    EXPECT_EQ(steps[i].number, static_cast<int>(i));
    EXPECT_LE(i > 0 && steps[i - 1].object, steps[i].object);  // without the object first
    const std::string key = steps[i].stimulus.SerializeAsString() + std::to_string(steps[i].exposure_ms);
    if (steps[i].object) with.insert(key);
    all.insert(key + (steps[i].object ? "o" : "e"));
  }
  for (const std::string& key : all) EXPECT_EQ(all.count(key), 1u);  // no duplicates
  for (const Step& step : steps) {
    const std::string key = step.stimulus.SerializeAsString() + std::to_string(step.exposure_ms);
    EXPECT_TRUE(step.object || with.contains(key));
    EXPECT_EQ(step.stimulus.kind() == "photo", step.stimulus.reference() && step.object);
  }
}

TEST(Plan, TheRigMustHaveWhatThePlanNames) {
  const v1::Plan plan =
      parse_plan("method: \"gaussian\" ramp {} monitors { name: \"left\" width_px: 9 }", "p").value();
  absl::Status status = expand(plan, {monitor("back", 8, 8)}).status();
  EXPECT_NE(std::string(status.message()).find("the rig has: back"), std::string::npos) << status;
  status = expand(plan, {monitor("left", 8, 8)}).status();
  EXPECT_NE(std::string(status.message()).find("it is 8x8"), std::string::npos) << status;
}

TEST(Plan, APlanHasNoMorePartsThanASessionHasSteps) {
  v1::Plan plan;
  plan.set_method("gaussian");
  for (int i = 0; i <= 20000; ++i) plan.add_solids();
  const absl::Status status = check_plan(plan);
  EXPECT_EQ(std::string(status.message()), "the plan has 20001 solids; at most 20000 are shown in a session");
}

TEST(Plan, FewBytesAskForNoMoreThanAProgram) {
  // 500,000 periods of 32 phases fit into one message.
  v1::Plan plan;
  plan.set_method("fringe");
  v1::Fringes& fringes = *plan.add_fringes();
  fringes.set_phases(32);
  fringes.mutable_period_px()->Resize(500000, 8.0);
  absl::Status status = expand(plan, {monitor("back", 8, 8)}).status();
  EXPECT_NE(std::string(status.message()).find("more than 20000 steps"), std::string::npos) << status;
  // Plans of archives are unchecked.
  plan.Clear();
  plan.set_method("ramp");
  plan.mutable_ramp()->set_frames(2);
  plan.mutable_ramp()->set_empty_frames(-1);
  status = expand(plan, {monitor("back", 8, 8)}).status();
  EXPECT_NE(std::string(status.message()).find("empty_frames is -1"), std::string::npos) << status;
}

TEST(Plan, ACalibrationShowsCodesWithoutTheObjectAndTeachesNoPatch) {
  std::vector<v1::Monitor> rig{monitor("back", 128, 96), monitor("left", 64, 96)};
  for (v1::Monitor& each : rig) {
    each.set_patch_rows(8);
    each.set_bits(10);
  }
  const v1::Plan camera =
      parse_plan("method: \"calibration\" calibration { of: \"camera\" takes: 3 } exposure_ms: [1, 4]", "p")
          .value();
  std::map<std::tuple<std::string, double, std::string>, int> count;
  const std::vector<Step> camera_steps = expand(camera, rig).value();
  for (const Step& step : camera_steps) {
    EXPECT_FALSE(step.object);
    EXPECT_TRUE(step.stimulus.codes());
    v1::Stimulus picture = step.stimulus;
    ++count[{picture.panel(), step.exposure_ms, picture.SerializeAsString()}];
  }
  EXPECT_EQ(count.size(), 2u * 2u * 3u);  // monitors x exposures x (stripe, black, white)
  for (const auto& [what, times] : count) EXPECT_EQ(times, 3);

  const v1::Plan display =
      parse_plan("method: \"calibration\" calibration { of: \"display\" takes: 1 grays: 17 }", "p").value();
  std::map<std::string, std::array<std::set<double>, 3>> grays;
  std::map<std::string, int> whites;
  int since_white = 0;
  const std::vector<Step> display_steps = expand(display, rig).value();
  for (const Step& step : display_steps) {
    const v1::Stimulus& shown = step.stimulus;
    EXPECT_FALSE(step.object);
    EXPECT_TRUE(shown.codes());
    int lit = 0;
    for (int c = 0; c < 3; ++c) {
      const double code = 1023.0 * shown.colour(c);
      EXPECT_NEAR(code, std::round(code), 1e-9);  // 10 bits
      lit += code > 0.0 ? 1 : 0;
    }
    since_white = lit == 1 ? since_white + 1 : 0;
    EXPECT_LE(since_white, 8);
    if (lit == 3 && shown.kind() == "solid") ++whites[shown.panel()];
    for (int c = 0; c < 3 && lit == 1; ++c) {
      if (shown.colour(c) > 0.0) grays[shown.panel()][c].insert(shown.colour(c));
    }
  }
  for (const v1::Monitor& each : rig) {
    EXPECT_GE(whites[each.name()], 2);
    for (const std::set<double>& primary : grays[each.name()]) EXPECT_EQ(primary.size(), 16u);
  }
}

TEST(Plan, ACalibrationTakesNothingElse) {
  for (const char* text : {"method: \"calibration\"", "method: \"gaussian\" calibration { of: \"camera\" }",
                           "method: \"calibration\" calibration { of: \"camera\" } ramp {}",
                           "method: \"calibration\" calibration { of: \"camera\" } white_every: 9"}) {
    const absl::Status status = parse_plan(text, "p").status();
    EXPECT_NE(std::string(status.message()).find("calibration"), std::string::npos) << text << status;
  }
  for (const char* inside : {"of: \"lamp\"", "of: \"camera\" takes: 0", "of: \"display\" grays: 5"}) {
    const std::string text = std::string("method: \"calibration\" calibration { ") + inside + " }";
    EXPECT_TRUE(absl::IsInvalidArgument(parse_plan(text, "p").status())) << text;
  }
}

TEST(Plan, WhiteAndBlackComeFirstAgainAndLast) {
  const v1::Plan plan =
      parse_plan("method: \"gaussian\" sweeps { sigma_px: 8 } white_every: 10 skip_empty_stage: true", "p")
          .value();
  const std::vector<Step> steps = expand(plan, {monitor("back", 128, 96)}).value();
  const auto light = [&](size_t i) {
    return steps[i].stimulus.kind() == "solid" ? steps[i].stimulus.colour(0) : -1.0;
  };
  int stripes = 0;
  for (size_t i = 0; i < steps.size(); ++i) {
    const bool due = stripes == 10 || i == 0 || i + 2 == steps.size();
    EXPECT_EQ(light(i) == 1.0, due) << i;
    if (light(i) == 1.0) {
      EXPECT_EQ(light(++i), 0.0);
      stripes = 0;
    } else {
      ++stripes;
    }
  }
}

TEST(Plan, EveryGroupOfStepsStartsWithThePatchOfEachMonitorThatHasOne) {
  const v1::Plan plan =
      parse_plan(
          "method: \"gaussian\" exposure_ms: [1, 4] solids { colour: [1, 1, 1] } sweeps { sigma_px: 8 }", "p")
          .value();
  std::vector<v1::Monitor> rig{monitor("back", 128, 96), monitor("left", 64, 96)};
  const size_t without = expand(plan, rig)->size();
  rig[1].set_patch_rows(8);
  const std::vector<Step> steps = expand(plan, rig).value();
  const std::span<const std::uint16_t> ids = patch_learning_ids();
  EXPECT_EQ(steps.size(), without + 4 * ids.size());
  std::set<std::pair<bool, double>> begun;
  for (size_t i = 0; i < steps.size(); ++i) {
    if (!begun.emplace(steps[i].object, steps[i].exposure_ms).second) continue;
    for (size_t k = 0; k < ids.size(); ++k) {
      EXPECT_EQ(steps[i + k].stimulus.kind(), "patch");
      EXPECT_EQ(steps[i + k].stimulus.panel(), "left");
      EXPECT_EQ(steps[i + k].stimulus.patch_id(), ids[k]);
    }
    EXPECT_NE(steps[i + ids.size()].stimulus.kind(), "patch");
  }
  EXPECT_EQ(begun.size(), 4u);
}

}  // namespace
}  // namespace glasswing
