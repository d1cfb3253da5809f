// Plans, as text and from the wire, and their expansion to steps.
#include <google/protobuf/stubs/logging.h>
#include <google/protobuf/text_format.h>

#include "core/pattern/pattern.h"
#include "core/pattern/plan.h"
#include "tests/fuzz/fuzz_target.h"

namespace glasswing::fuzz {
namespace {

constexpr size_t kMaxSteps = 20000;

const std::vector<v1::Monitor>& rig() {
  static const std::vector<v1::Monitor> rig = [] {
    std::vector<v1::Monitor> monitors(2);
    monitors[0].set_name("back");
    monitors[0].set_width_px(64);
    monitors[0].set_height_px(48);
    monitors[0].set_patch_rows(4);
    monitors[1].set_name("left");
    monitors[1].set_width_px(5);
    monitors[1].set_height_px(7);
    return monitors;
  }();
  return rig;
}

// For an unchecked plan.
void try_steps(const v1::Plan& plan) {
  const absl::StatusOr<std::vector<Step>> steps = expand(plan, rig());
  if (!steps.ok()) {
    FUZZ_CHECK(!steps.status().message().empty());
    return;
  }
  FUZZ_CHECK(check_plan(plan).ok());
  FUZZ_CHECK(steps->size() <= kMaxSteps);
  bool object = false;
  for (size_t i = 0; i < steps->size(); ++i) {
    const Step& step = (*steps)[i];
    FUZZ_CHECK(step.number == static_cast<int>(i));
    FUZZ_CHECK(step.exposure_ms >= 0.01 && step.exposure_ms <= 10000.0);
    FUZZ_CHECK(step.object || !object);
    object = step.object;
    const std::string& kind = step.stimulus.kind();
    const bool back = step.stimulus.panel() == rig()[0].name();
    FUZZ_CHECK(back || step.stimulus.panel() == rig()[1].name());
    const v1::Monitor& monitor = rig()[back ? 0 : 1];
    FUZZ_CHECK(kind == "photo" || kind == "patch" ||
               Pattern::create(step.stimulus, {monitor.width_px(), monitor.height_px()}).ok());
  }
}

}  // namespace

std::vector<std::string> seeds() {
  const std::vector<std::string> texts = {
      R"(method: "gaussian"
monitors { name: "back" width_px: 64 height_px: 48 }
monitors { name: "left" }
sweeps { orientation_deg: 45 sigma_px: 4 step_px: 2 margin_sigmas: 3 peak: 0.5 }
sweeps { orientation_deg: -90 sigma_px: 2 }
solids { colour: [0, 0.5, 1] }
square_waves { levels: 6 first_level: 2 without_complements: true }
photos { file: "stone.png" name: "stone" }
hold_refreshes: 4 exposure_ms: [4, 8] retries: 3 white_every: 5)",
      R"(method: "fringe" fringes { orientation_deg: 30 period_px: [8, 64] phases: 4 } skip_empty_stage: true)",
      R"(method: "ramp" monitors { name: "back" } ramp { frames: 300 empty_frames: 20 })",
      R"(method: "calibration" calibration { of: "display" takes: 2 grays: 9 })",
      R"(method: "calibration" calibration { of: "camera" } exposure_ms: [1, 2, 4])"};
  std::vector<std::string> seeds = texts;
  for (const std::string& text : texts) {
    v1::Plan plan;
    FUZZ_CHECK(google::protobuf::TextFormat::ParseFromString(text, &plan));
    seeds.push_back(plan.SerializeAsString());
  }
  // Few bytes that expand to many steps.
  v1::Plan plan;
  plan.set_method("fringe");
  for (int i = 0; i < 4000; ++i) {
    if (i % 1000 == 0) plan.add_fringes()->set_phases(32);
    plan.mutable_fringes()->rbegin()->add_period_px(4.0);
  }
  seeds.push_back(plan.SerializeAsString());
  plan.Clear();
  plan.set_method("ramp");
  plan.mutable_ramp()->set_frames(2000000000);
  plan.mutable_ramp()->set_empty_frames(-1);
  seeds.push_back(plan.SerializeAsString());
  return seeds;
}

void try_input(std::string_view input) {
  static const google::protobuf::LogSilencer silent;  // silences complaints about strings that are not UTF-8
  v1::Plan plan;
  if (plan.ParseFromArray(input.data(), static_cast<int>(input.size()))) try_steps(plan);
  const absl::StatusOr<v1::Plan> written = parse_plan(input, "plan.txtpb");
  if (!written.ok()) {
    FUZZ_CHECK(written.status().message().find("plan.txtpb:") == 0);
    return;
  }
  FUZZ_CHECK(check_plan(*written).ok());
  try_steps(*written);
}

}  // namespace glasswing::fuzz
