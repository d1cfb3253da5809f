#include "core/pattern/plan.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <google/protobuf/io/tokenizer.h>
#include <google/protobuf/text_format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/file/file.h"
#include "core/method/methods.h"
#include "core/pattern/calibration_steps.h"
#include "core/pattern/id_patch.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

using google::protobuf::TextFormat;
constexpr int kMaxSteps = 20000;
constexpr int kMaxCameras = 16;
constexpr int kDefaultPhases = 4;
constexpr int kMaxFrames = 18000, kMaxEmptyFrames = 1000;  // of a ramp
constexpr int kUsualEmptyFrames = 16;

// The location of a message within the plan, so that errors can name the line (of a file) or the path (of a
// plan from the wire).
class Location {
 public:
  Location(std::string file_name, const TextFormat::ParseInfoTree* tree, std::string path)
      : file_name_(std::move(file_name)), tree_(tree), path_(std::move(path)) {}

  Location nested(const google::protobuf::Message& parent, const std::string& field, int index) const {
    const auto* descriptor = parent.GetDescriptor()->FindFieldByName(field);
    const TextFormat::ParseInfoTree* tree =
        tree_ == nullptr ? nullptr
                         : tree_->GetTreeForNested(descriptor, descriptor->is_repeated() ? index : -1);
    const std::string name = descriptor->is_repeated() ? fmt::format("{}[{}].", field, index) : field + ".";
    return {file_name_, tree, path_ + name};
  }

  // "plan.txtpb:12: sigma_px is 0; it must be in (0, 200]"
  template <typename Value>
  absl::Status bad(const google::protobuf::Message& message, const std::string& field, int index,
                   const Value& value, const std::string& accepted) const {
    const auto* descriptor = message.GetDescriptor()->FindFieldByName(field);
    std::string where = path_;
    if (!file_name_.empty()) {
      where = file_name_ + ":";
      if (tree_ != nullptr) {
        auto location = tree_->GetLocation(descriptor, descriptor->is_repeated() ? index : -1);
        // For a list in brackets only the first value has a location.
        if (location.line < 0 && descriptor->is_repeated()) location = tree_->GetLocation(descriptor, 0);
        if (location.line >= 0) where += fmt::format("{}:", location.line + 1);
      }
      where += " ";
    }
    return absl::InvalidArgumentError(
        fmt::format("{}{} is {}; it must be {}", where, field, value, accepted));
  }

 private:
  std::string file_name_;
  const TextFormat::ParseInfoTree* tree_;
  std::string path_;
};

class FirstError : public google::protobuf::io::ErrorCollector {
 public:
  void AddError(int line, int, const std::string& message) override {
    if (text.empty()) text = fmt::format("{}: {}", line + 1, message);
  }
  std::string text;
};

// False for NaN.
bool within(double value, double low, double high) {
  return value >= low && value <= high;
}

template <typename Message>
absl::Status check_colour(const Message& message, const Location& location) {
  if (message.colour_size() != 3)
    return location.bad(message, "colour", 0, fmt::format("{} numbers", message.colour_size()),
                        "3: red, green, blue");
  for (int i = 0; i < 3; ++i) {
    if (!within(message.colour(i), 0.0, 1.0))
      return location.bad(message, "colour", i, message.colour(i), "in [0, 1]");
  }
  return absl::OkStatus();
}

absl::Status check_sweep(const v1::Sweep& sweep, const Location& location) {
  if (!within(sweep.orientation_deg(), -180.0, 180.0)) {
    return location.bad(sweep, "orientation_deg", 0, sweep.orientation_deg(), "in [-180, 180]");
  }
  if (!(sweep.sigma_px() > 0.0 && sweep.sigma_px() <= 200.0)) {
    return location.bad(sweep, "sigma_px", 0, sweep.sigma_px(), "in (0, 200]");
  }
  if (sweep.has_step_px() &&
      !(sweep.step_px() >= 0.01 && sweep.step_px() <= kMaxStep_sigmas * sweep.sigma_px())) {
    return location.bad(sweep, "step_px", 0, sweep.step_px(),
                        fmt::format("in [0.01, {} sigma_px]", kMaxStep_sigmas));
  }
  if (sweep.has_margin_sigmas() && !within(sweep.margin_sigmas(), 0.0, 10.0)) {
    return location.bad(sweep, "margin_sigmas", 0, sweep.margin_sigmas(), "in [0, 10]");
  }
  if (sweep.has_peak() && !(sweep.peak() > 0.0 && sweep.peak() <= 1.0)) {
    return location.bad(sweep, "peak", 0, sweep.peak(), "in (0, 1]");
  }
  return absl::OkStatus();
}

absl::Status check_square_waves(const v1::SquareWaves& waves, const Location& location) {
  if (!within(waves.levels(), 1, 14)) return location.bad(waves, "levels", 0, waves.levels(), "1 to 14");
  if (waves.has_first_level() && !within(waves.first_level(), 1, waves.levels()))
    return location.bad(waves, "first_level", 0, waves.first_level(), fmt::format("1 to {}", waves.levels()));
  return absl::OkStatus();
}

absl::Status check_fringes(const v1::Fringes& fringes, const Location& location) {
  if (!within(fringes.orientation_deg(), -180.0, 180.0))
    return location.bad(fringes, "orientation_deg", 0, fringes.orientation_deg(), "in [-180, 180]");
  if (fringes.period_px().empty())
    return location.bad(fringes, "period_px", 0, "left out", "given at least once, in [2, 100000]");
  for (int i = 0; i < fringes.period_px_size(); ++i) {
    if (!within(fringes.period_px(i), 2.0, 100000.0))
      return location.bad(fringes, "period_px", i, fringes.period_px(i), "in [2, 100000]");
  }
  if (fringes.has_phases() && !within(fringes.phases(), 2, 32))
    return location.bad(fringes, "phases", 0, fringes.phases(), "2 to 32");
  return absl::OkStatus();
}

// The field `ramp` for any method, and the requirements of method "ramp" on the rest of the plan.
absl::Status check_ramp(const v1::Plan& plan, const Location& location) {
  const v1::Ramp& ramp = plan.ramp();
  const Location here = location.nested(plan, "ramp", 0);
  if (plan.method() != kRampMethod) {
    const std::string alone = "left out: only method \"ramp\" takes several";
    if (ramp.has_frames()) return here.bad(ramp, "frames", 0, ramp.frames(), alone);
    if (ramp.has_empty_frames()) return here.bad(ramp, "empty_frames", 0, ramp.empty_frames(), alone);
    return absl::OkStatus();
  }
  if (!plan.has_ramp())
    return location.bad(plan, "ramp", 0, "left out", "given with method \"ramp\", as ramp { frames: 300 }");
  if (ramp.has_frames() && !within(ramp.frames(), 1, kMaxFrames))
    return here.bad(ramp, "frames", 0, ramp.frames(), fmt::format("1 to {}", kMaxFrames));
  if (ramp.has_empty_frames() && !within(ramp.empty_frames(), 1, kMaxEmptyFrames))
    return here.bad(ramp, "empty_frames", 0, ramp.empty_frames(), fmt::format("1 to {}", kMaxEmptyFrames));
  if (plan.skip_empty_stage()) {
    return location.bad(plan, "skip_empty_stage", 0, "true",
                        "left out: method \"ramp\" finds the object by the stage without it");
  }
  if (!is_video(plan)) return absl::OkStatus();
  const std::string alone = "left out: while a video runs nothing but the ramp is shown";
  if (!plan.sweeps().empty()) return location.bad(plan, "sweeps", 0, "given", alone);
  if (!plan.photos().empty()) return location.bad(plan, "photos", 0, "given", alone);
  if (plan.has_white_every()) return location.bad(plan, "white_every", 0, plan.white_every(), alone);
  if (plan.monitors_size() > 1)
    return location.bad(plan, "monitors", 1, "a second one", "left out: a video is of one monitor");
  if (plan.exposure_ms_size() > 1)
    return location.bad(plan, "exposure_ms", 1, "a second one",
                        "left out: all frames of a video have the same");
  return absl::OkStatus();
}

absl::Status check_calibration(const v1::Plan& plan, bool shows_nothing, const Location& location) {
  if (plan.method() != kCalibrationMethod || !plan.has_calibration() || !shows_nothing ||
      plan.has_white_every()) {
    return location.bad(plan, "calibration", 0, plan.has_calibration() ? "given" : "left out",
                        fmt::format("given with method \"{}\", without anything else to show, and only then",
                                    kCalibrationMethod));
  }
  const v1::CalibrationFrames& frames = plan.calibration();
  const Location here = location.nested(plan, "calibration", 0);
  if (frames.of() != "camera" && frames.of() != "display")
    return here.bad(frames, "of", 0, fmt::format("\"{}\"", frames.of()), "\"camera\" or \"display\"");
  if (frames.has_takes() && !within(frames.takes(), 1, 100))
    return here.bad(frames, "takes", 0, frames.takes(), "1 to 100");
  if (frames.has_grays() && !within(frames.grays(), 6, 256))
    return here.bad(frames, "grays", 0, frames.grays(), "6 to 256");
  return absl::OkStatus();
}

absl::Status check_adapt(const v1::Plan& plan, const Location& location) {
  for (int i = 0; i < plan.rounds_size(); ++i) {
    const v1::Round& round = plan.rounds(i);
    const Location here = location.nested(plan, "rounds", i);
    for (int k = 0; k < round.fringes_size(); ++k)
      GW_RETURN_IF_ERROR(check_fringes(round.fringes(k), here.nested(round, "fringes", k)));
  }
  if (!plan.has_adapt()) return absl::OkStatus();
  if (plan.method() != "gaussian") {
    return location.bad(plan, "adapt", 0, "given",
                        fmt::format("left out with method \"{}\": only \"gaussian\" adapts", plan.method()));
  }
  const v1::Adapt& adapt = plan.adapt();
  const Location here = location.nested(plan, "adapt", 0);
  if (adapt.has_target_db() && !within(adapt.target_db(), 10.0, 80.0))
    return here.bad(adapt, "target_db", 0, adapt.target_db(), "in [10, 80]");
  if (adapt.has_target_px() && !within(adapt.target_px(), 0.001, 100.0))
    return here.bad(adapt, "target_px", 0, adapt.target_px(), "in [0.001, 100]");
  if (adapt.has_target_db() && adapt.has_target_px())
    return here.bad(adapt, "target_px", 0, adapt.target_px(), "left out where target_db is given");
  if (adapt.has_at_most() && !within(adapt.at_most(), 30, kMaxSteps))
    return here.bad(adapt, "at_most", 0, adapt.at_most(), fmt::format("30 to {}", kMaxSteps));
  if (!adapt.footprints().empty() && adapt.footprints() != "gaussian" && adapt.footprints() != "any")
    return here.bad(adapt, "footprints", 0, fmt::format("\"{}\"", adapt.footprints()),
                    "\"gaussian\" or \"any\"");
  return absl::OkStatus();
}

// Each of them shows a step at least.
absl::Status check_counts(const v1::Plan& plan) {
  for (const auto& [field, count] : {std::pair{"sweeps", plan.sweeps_size()},
                                     {"solids", plan.solids_size()},
                                     {"fringes", plan.fringes_size()},
                                     {"photos", plan.photos_size()},
                                     {"rounds", plan.rounds_size()}}) {
    if (count > kMaxSteps)
      return absl::InvalidArgumentError(
          fmt::format("the plan has {} {}; at most {} are shown in a session", count, field, kMaxSteps));
  }
  return absl::OkStatus();
}

absl::Status check_cameras(const v1::Plan& plan, const Location& location) {
  if (!plan.camera().empty() && !check_name("camera", plan.camera()).ok())
    return location.bad(plan, "camera", 0, plan.camera(), "a camera node's name, or nothing");
  if (plan.cameras().empty()) return absl::OkStatus();
  if (!plan.camera().empty())
    return location.bad(plan, "camera", 0, plan.camera(), "left out where cameras are given");
  if (plan.cameras_size() > kMaxCameras || plan.cameras_size() == 1) {
    return location.bad(plan, "cameras", 0, fmt::format("a list of {}", plan.cameras_size()),
                        fmt::format("2 to {} camera nodes; for one: camera", kMaxCameras));
  }
  std::set<std::string> names;
  for (int i = 0; i < plan.cameras_size(); ++i) {
    if (check_name("camera", plan.cameras(i)).ok() && names.insert(plan.cameras(i)).second) continue;
    return location.bad(plan, "cameras", i, fmt::format("\"{}\"", plan.cameras(i)),
                        "a camera node's name, each once");
  }
  return absl::OkStatus();
}

absl::Status check(const v1::Plan& plan, const Location& location) {
  if (plan.method() != kCalibrationMethod && !check_method(plan.method()).ok()) {
    return location.bad(
        plan, "method", 0, fmt::format("\"{}\"", plan.method()),
        fmt::format("\"{}\" or \"{}\"", fmt::join(method_names(), "\", \""), kCalibrationMethod));
  }
  std::set<std::string> names;
  for (int i = 0; i < plan.monitors_size(); ++i) {
    const v1::PlanMonitor& monitor = plan.monitors(i);
    const Location here = location.nested(plan, "monitors", i);
    if (!check_name("monitor", monitor.name()).ok() || !names.insert(monitor.name()).second) {
      return here.bad(monitor, "name", 0, fmt::format("\"{}\"", monitor.name()),
                      "a monitor's name, each once: 1 to 64 letters, digits, '.', '_' or '-'");
    }
    if (monitor.has_width_px() && !within(monitor.width_px(), 1, 16384)) {
      return here.bad(monitor, "width_px", 0, monitor.width_px(), "1 to 16384");
    }
    if (monitor.has_height_px() && !within(monitor.height_px(), 1, 16384)) {
      return here.bad(monitor, "height_px", 0, monitor.height_px(), "1 to 16384");
    }
  }
  GW_RETURN_IF_ERROR(check_counts(plan));
  for (int i = 0; i < plan.sweeps_size(); ++i) {
    GW_RETURN_IF_ERROR(check_sweep(plan.sweeps(i), location.nested(plan, "sweeps", i)));
  }
  for (int i = 0; i < plan.solids_size(); ++i) {
    GW_RETURN_IF_ERROR(check_colour(plan.solids(i), location.nested(plan, "solids", i)));
  }
  if (plan.has_square_waves()) {
    GW_RETURN_IF_ERROR(check_square_waves(plan.square_waves(), location.nested(plan, "square_waves", 0)));
  }
  for (int i = 0; i < plan.fringes_size(); ++i) {
    GW_RETURN_IF_ERROR(check_fringes(plan.fringes(i), location.nested(plan, "fringes", i)));
  }
  for (int i = 0; i < plan.photos_size(); ++i) {
    if (plan.photos(i).file().empty()) {
      return location.nested(plan, "photos", i)
          .bad(plan.photos(i), "file", 0, "\"\"", "the path of a picture");
    }
  }
  GW_RETURN_IF_ERROR(check_cameras(plan, location));
  if (plan.has_hold_refreshes() && !within(plan.hold_refreshes(), 2, 600)) {
    return location.bad(plan, "hold_refreshes", 0, plan.hold_refreshes(),
                        "2 to 600 (a screen needs one refresh to change and one to be seen)");
  }
  for (int i = 0; i < plan.exposure_ms_size(); ++i) {
    if (!within(plan.exposure_ms(i), 0.01, 10000.0)) {
      return location.bad(plan, "exposure_ms", i, plan.exposure_ms(i), "in [0.01, 10000]");
    }
  }
  if (plan.has_retries() && !within(plan.retries(), 0, 100)) {
    return location.bad(plan, "retries", 0, plan.retries(), "0 to 100");
  }
  if (plan.has_white_every() && !within(plan.white_every(), 2, 10000)) {
    return location.bad(plan, "white_every", 0, plan.white_every(), "2 to 10000");
  }
  const bool shows_nothing = plan.sweeps().empty() && plan.solids().empty() && !plan.has_square_waves() &&
                             !plan.has_ramp() && plan.fringes().empty() && plan.photos().empty();
  if (plan.has_calibration() || plan.method() == kCalibrationMethod) {
    return check_calibration(plan, shows_nothing, location);
  }
  GW_RETURN_IF_ERROR(check_ramp(plan, location));
  GW_RETURN_IF_ERROR(check_adapt(plan, location));
  if (shows_nothing) {
    return location.bad(plan, "sweeps", 0, "empty, and so is everything else",
                        "at least one sweep, solid, ramp, fringe or photo");
  }
  return absl::OkStatus();
}

v1::Stimulus stimulus_on(const std::string& panel, StimulusKind kind) {
  v1::Stimulus stimulus;
  stimulus.set_kind(std::string(name_of(kind)));
  stimulus.set_panel(panel);
  return stimulus;
}

// Adds stripes with peaks at k * step for every whole k within the monitor's extent along the sweep plus its
// margin.
void add_sweep(const v1::Sweep& sweep, const v1::Monitor& monitor, std::vector<v1::Stimulus>& out) {
  const double phi_rad = sweep.orientation_deg() * std::numbers::pi / 180.0;
  const double across_px = monitor.width_px() * std::cos(phi_rad);
  const double down_px = monitor.height_px() * std::sin(phi_rad);
  const double margin_px = (sweep.has_margin_sigmas() ? sweep.margin_sigmas() : 2.0) * sweep.sigma_px();
  const double step_px = sweep.has_step_px() ? sweep.step_px() : 0.5 * sweep.sigma_px();
  const double low_px = std::min(across_px, 0.0) + std::min(down_px, 0.0) - margin_px;
  const double high_px = std::max(across_px, 0.0) + std::max(down_px, 0.0) + margin_px;
  // Whether a peak exactly on the margin is included must not depend on the rounding of cos(90 deg).
  constexpr double kSlack = 1e-9;
  for (double k = std::ceil(low_px / step_px - kSlack); k <= std::floor(high_px / step_px + kSlack);
       k += 1.0) {
    v1::Stimulus stripe = stimulus_on(monitor.name(), StimulusKind::kStripe);
    stripe.set_phi_deg(sweep.orientation_deg());
    stripe.set_r_px(k * step_px);
    stripe.set_sigma_px(sweep.sigma_px());
    stripe.set_peak(sweep.has_peak() ? sweep.peak() : 1.0);
    for (int i = 0; i < 3; ++i) stripe.add_colour(1.0);
    out.push_back(std::move(stripe));
    if (out.size() > kMaxSteps) return;
  }
}

void add_fringes(const v1::Fringes& fringes, const v1::Monitor& monitor, std::vector<v1::Stimulus>& out) {
  const int phases = fringes.has_phases() ? fringes.phases() : kDefaultPhases;
  for (const double period_px : fringes.period_px()) {
    for (int k = 0; k < phases; ++k) {
      v1::Stimulus wave = stimulus_on(monitor.name(), StimulusKind::kSinusoid);
      wave.set_phi_deg(fringes.orientation_deg());
      wave.set_period_px(period_px);
      // Two opposite phases would determine a wave's cosine but not its sine.
      wave.set_phase_deg(phases == 2 ? 90.0 * k : 360.0 * k / phases);
      wave.set_peak(1.0);
      for (int i = 0; i < 3; ++i) wave.add_colour(1.0);
      out.push_back(std::move(wave));
    }
    if (out.size() > kMaxSteps) return;
  }
}

void add_square_waves(const v1::SquareWaves& waves, const v1::Monitor& monitor,
                      std::vector<v1::Stimulus>& out) {
  double period_px = 1.0;
  while (period_px < std::max(monitor.width_px(), monitor.height_px())) period_px *= 2.0;
  for (const char* orient : {"vertical_bars", "horizontal_bars"}) {
    for (int level = std::max(waves.first_level(), 1); level <= waves.levels(); ++level) {
      const double bar_px = period_px / std::exp2(level);
      if (bar_px < 1.0) break;  // finer than a pixel
      for (const bool inverse : {false, true}) {
        if (inverse && waves.without_complements()) continue;
        v1::Stimulus bars = stimulus_on(monitor.name(), StimulusKind::kSquare);
        bars.set_orient(orient);
        bars.set_level(level);
        bars.set_bar_width_px(bar_px);
        bars.set_inverse(inverse);
        for (int i = 0; i < 3; ++i) bars.add_colour(1.0);
        out.push_back(std::move(bars));
      }
    }
  }
}

void add_patch_learning(const v1::Monitor& monitor, std::vector<v1::Stimulus>& out) {
  if (monitor.patch_rows() == 0) return;
  for (const std::uint16_t id : patch_learning_ids()) {
    out.push_back(stimulus_on(monitor.name(), StimulusKind::kPatch));
    out.back().set_patch_id(id);
  }
}

// Inserts white and black at the start, after every `every` stimuli, and at the end.
std::vector<v1::Stimulus> with_white(std::vector<v1::Stimulus> stimuli, const v1::Monitor& monitor,
                                     int every) {
  std::vector<v1::Stimulus> out;
  const auto add = [&] {
    for (const double light : {1.0, 0.0}) {
      out.push_back(stimulus_on(monitor.name(), StimulusKind::kSolid));
      for (int c = 0; c < 3; ++c) out.back().add_colour(light);
    }
  };
  add();
  for (size_t i = 0; i < stimuli.size(); ++i) {
    out.push_back(std::move(stimuli[i]));
    if ((i + 1) % static_cast<size_t>(every) == 0 || i + 1 == stimuli.size()) add();
  }
  return out;
}

// The stimuli that one monitor shows in its turn.
std::vector<v1::Stimulus> stimuli_of(const v1::Plan& plan, const v1::Monitor& monitor, bool object) {
  std::vector<v1::Stimulus> out;
  if (plan.has_calibration()) {
    if (!object) out = calibration_stimuli(plan.calibration(), monitor);
    return out;
  }
  const auto add_ramp = [&](int count) {
    out.insert(out.end(), static_cast<size_t>(count), stimulus_on(monitor.name(), StimulusKind::kRamp));
  };
  if (object && is_video(plan)) {
    add_ramp(ramp_frames_of(plan.ramp()));
    return out;
  }
  for (const v1::Solid& solid : plan.solids()) {
    v1::Stimulus stimulus = stimulus_on(monitor.name(), StimulusKind::kSolid);
    *stimulus.mutable_colour() = solid.colour();
    out.push_back(std::move(stimulus));
  }
  if (plan.has_square_waves()) add_square_waves(plan.square_waves(), monitor, out);
  if (plan.has_ramp()) add_ramp(object ? ramp_frames_of(plan.ramp()) : empty_ramp_frames_of(plan.ramp()));
  for (const v1::Fringes& fringes : plan.fringes()) {
    if (object || !fringes.object_only()) add_fringes(fringes, monitor, out);
  }
  if (object) {
    for (const v1::Sweep& sweep : plan.sweeps()) add_sweep(sweep, monitor, out);
  }
  if (plan.has_white_every()) out = with_white(std::move(out), monitor, plan.white_every());
  return out;
}

std::vector<double> exposures_of(const v1::Plan& plan) {
  if (plan.exposure_ms().empty()) return {kDefaultExposureMs};
  return {plan.exposure_ms().begin(), plan.exposure_ms().end()};
}

// Those of the rig that the plan uses.
absl::StatusOr<std::vector<v1::Monitor>> monitors_of(const v1::Plan& plan,
                                                     const std::vector<v1::Monitor>& rig) {
  std::vector<v1::Monitor> used;
  for (const v1::PlanMonitor& wanted : plan.monitors()) {
    const auto found =
        std::find_if(rig.begin(), rig.end(), [&](const v1::Monitor& m) { return m.name() == wanted.name(); });
    if (found == rig.end()) {
      std::string names;
      for (const v1::Monitor& monitor : rig) names += (names.empty() ? "" : ", ") + monitor.name();
      return absl::InvalidArgumentError(
          fmt::format("the plan uses monitor \"{}\"; the rig has: {}", wanted.name(), names));
    }
    const int width = wanted.has_width_px() ? wanted.width_px() : found->width_px();
    const int height = wanted.has_height_px() ? wanted.height_px() : found->height_px();
    if (width != found->width_px() || height != found->height_px()) {
      return absl::InvalidArgumentError(fmt::format("the plan says monitor \"{}\" is {}x{}; it is {}x{}",
                                                    wanted.name(), width, height, found->width_px(),
                                                    found->height_px()));
    }
    used.push_back(*found);
  }
  if (plan.monitors().empty()) used = rig;
  if (used.empty()) return absl::InvalidArgumentError("the rig has no monitor");
  if (is_video(plan) && used.size() > 1) {
    return absl::InvalidArgumentError(fmt::format(
        "a video is of one monitor; the rig has {}: name one in the plan, monitors {{ name: \"{}\" }}",
        used.size(), used.front().name()));
  }
  return used;
}

}  // namespace

absl::StatusOr<v1::Plan> parse_plan(std::string_view text, const std::string& file_name) {
  if (!is_utf8(text)) {
    return absl::InvalidArgumentError(
        fmt::format("{}: it is no text; a plan is a text file, as glasswing plan make writes it", file_name));
  }
  v1::Plan plan;
  TextFormat::ParseInfoTree tree;
  FirstError error;
  TextFormat::Parser parser;
  parser.WriteLocationsTo(&tree);
  parser.RecordErrorsTo(&error);
  if (!parser.ParseFromString(std::string(text), &plan)) {
    return absl::InvalidArgumentError(fmt::format("{}:{}", file_name, error.text));
  }
  GW_RETURN_IF_ERROR(check(plan, Location(file_name, &tree, "")));
  return plan;
}

absl::StatusOr<v1::Plan> read_plan(const std::filesystem::path& path) {
  GW_ASSIGN_OR_RETURN(const std::string text, read_file(path));
  return parse_plan(text, path.string());
}

absl::Status check_plan(const v1::Plan& plan) {
  return check(plan, Location("", nullptr, "plan."));
}

int hold_refreshes_of(const v1::Plan& plan) {
  return plan.has_hold_refreshes() ? plan.hold_refreshes() : kDefaultHoldRefreshes;
}

int retries_of(const v1::Plan& plan) {
  return plan.has_retries() ? plan.retries() : kDefaultRetries;
}

int ramp_frames_of(const v1::Ramp& ramp) {
  return ramp.has_frames() ? ramp.frames() : 1;
}

int empty_ramp_frames_of(const v1::Ramp& ramp) {
  return ramp.has_empty_frames() ? ramp.empty_frames() : std::min(ramp_frames_of(ramp), kUsualEmptyFrames);
}

bool is_video(const v1::Plan& plan) {
  return plan.method() == kRampMethod && ramp_frames_of(plan.ramp()) > 1;
}

absl::StatusOr<std::vector<Step>> expand(const v1::Plan& plan, const std::vector<v1::Monitor>& rig) {
  GW_RETURN_IF_ERROR(check_plan(plan));
  const absl::Status too_many = absl::InvalidArgumentError(
      fmt::format("the plan has more than {} steps; use wider sweeps or larger step_px", kMaxSteps));
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Monitor> used, monitors_of(plan, rig));
  const std::vector<double> exposures_ms = exposures_of(plan);
  std::vector<Step> steps;
  const auto add_steps = [&](const std::vector<v1::Stimulus>& stimuli, bool object, int round) {
    for (const double exposure_ms : exposures_ms) {
      for (const v1::Stimulus& stimulus : stimuli) {
        if (steps.size() >= kMaxSteps) return false;
        steps.push_back({.number = static_cast<int>(steps.size()),
                         .object = object,
                         .round = round,
                         .exposure_ms = exposure_ms,
                         .stimulus = stimulus});
      }
    }
    return true;
  };
  for (const bool object : {false, true}) {
    if (!object && plan.skip_empty_stage()) continue;
    std::vector<v1::Stimulus> stimuli;
    // Not in calibrations: their exposures may be too dark or too bright for a patch.
    for (const v1::Monitor& monitor : used) {
      if (!plan.has_calibration()) add_patch_learning(monitor, stimuli);
    }
    for (const v1::Monitor& monitor : used) {
      for (v1::Stimulus& stimulus : stimuli_of(plan, monitor, object)) stimuli.push_back(std::move(stimulus));
      if (stimuli.size() > kMaxSteps) return too_many;
    }
    for (const v1::Photo& photo : plan.photos()) {
      if (!object) break;
      v1::Stimulus stimulus = stimulus_on(used.front().name(), StimulusKind::kPhoto);
      stimulus.set_image(photo.file());
      stimulus.set_name(photo.name().empty() ? std::filesystem::path(photo.file()).stem().string()
                                             : photo.name());
      stimulus.set_reference(true);
      stimuli.push_back(std::move(stimulus));
    }
    if (!add_steps(stimuli, object, 0)) return too_many;
  }
  for (int round = 0; round < plan.rounds_size(); ++round) {
    std::vector<v1::Stimulus> stimuli;
    for (const v1::Monitor& monitor : used) {
      for (const v1::Fringes& fringes : plan.rounds(round).fringes()) add_fringes(fringes, monitor, stimuli);
      if (stimuli.size() > kMaxSteps) return too_many;
    }
    if (!add_steps(stimuli, true, round + 1)) return too_many;
  }
  return steps;
}

}  // namespace glasswing
