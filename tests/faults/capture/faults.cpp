// The suite `capture` of tests/faults/run: sessions on rigs with one fault each. Every kept frame is judged
// from its pixels.
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <regex>

#include "core/frame/archive.h"
#include "core/service/service.h"
#include "core/telemetry/logs.h"
#include "tests/faults/capture/decoder.h"
#include "tests/faults/capture/rig.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr double kSigma_px = 3.0;
constexpr int kLevels = 5;

struct Trial {
  RigFaults faults;
  int hold_refreshes = 2;
  bool may_end_unproven = false;  // retries cannot help, but no frame may be mislabelled
  bool is_seen = false;           // the fault costs showings of steps, which prove that it struck
};

std::vector<Trial> trials() {
  return {
      {{.name = "none"}},
      {{.name = "display jitter to 1 ms", .display = {.jitter = milliseconds(1)}}},
      {{.name = "missed flips, 10 %", .display = {.missed_flips = 0.1}}},
      {{.name = "repeated frames, 5 %, unsaid", .repeat = 0.05}, 2, false, true},
      {{.name = "dropped frames, 30 %", .drop = 0.3}, 2, false, true},
      {{.name = "duplicated frames, 70 %", .duplicate = 0.7}, 2, false, true},
      {{.name = "late frames to 80 ms", .late = milliseconds(80)}},
      {{.name = "stamp jitter to 0.4 ms", .stamp_jitter = microseconds(400)}},
      {{.name = "camera clock 40 min off", .clock_offset = std::chrono::minutes(-40)}},
      {{.name = "camera clock drifts 200 ppm", .clock_drift_ppm = 200.0}},
      {{.name = "network delay to 50 ms", .frame_rate_hz = 250.0, .network_delay = milliseconds(50)}, 8},
      {{.name = "camera node started again", .restart_camera = true}},
      {{.name = "display node started again", .restart_display = true}},
      {{.name = "stamps 2 ms off, unsaid", .stamp_shift = milliseconds(2)}, 2, true, true},
  };
}

Trial all_at_once() {
  return {{.name = "many at once",
           .display = {.missed_flips = 0.05, .jitter = microseconds(300)},
           .repeat = 0.02,
           .drop = 0.1,
           .duplicate = 0.3,
           .late = milliseconds(20),
           .stamp_jitter = microseconds(50),
           .clock_offset = seconds(5),
           .clock_drift_ppm = -150.0,
           .network_delay = milliseconds(2),
           .restart_camera = true},
          4};
}

struct Settings {
  int steps = 2000;
  std::uint64_t seed = 1;
  int patch_rows = 16;
  bool verbose = false;
};

// A plan of four sweeps with at least `steps` steps, and of the stimuli for the object mask.
v1::Plan plan_of(const Settings& settings, int hold_refreshes, double& step_px) {
  v1::Plan plan;
  plan.set_method("gaussian");
  const double width = FaultyRig::kWidth_px, height = FaultyRig::kHeight_px - settings.patch_rows;
  const double travel_px = width + height + std::numbers::sqrt2 * (width + height) + 4 * 4 * kSigma_px;
  step_px = std::min(travel_px / settings.steps, kSigma_px);
  for (const double orientation_deg : {0.0, 90.0, 45.0, -45.0}) {
    v1::Sweep& sweep = *plan.add_sweeps();
    sweep.set_orientation_deg(orientation_deg);
    sweep.set_sigma_px(kSigma_px);
    sweep.set_step_px(step_px);
  }
  for (const auto& colour : {std::array{0.0, 0.0, 0.0}, {1.0, 1.0, 1.0}, {0.8, 0.2, 0.1}}) {
    v1::Solid& solid = *plan.add_solids();
    for (const double value : colour) solid.add_colour(value);
  }
  plan.mutable_square_waves()->set_levels(kLevels);
  plan.set_hold_refreshes(hold_refreshes);
  plan.add_exposure_ms(FaultyRig::kExposure_ms);
  plan.set_retries(100);
  return plan;
}

// Runs the session to its end. Restarts a node, if wanted, when a third of the steps is proven.
v1::Session run(FaultyRig& rig, const RigFaults& faults, const v1::Plan& plan) {
  if (const grpc::Status status = rig.create(plan); !status.ok()) {
    v1::Session none;
    none.set_reason(status.error_message());
    return none;
  }
  bool restarted = !faults.restart_camera && !faults.restart_display;
  v1::Session session = rig.watch([&](const v1::Session& now) {
    if (restarted || now.proven_count() < now.step_count() / 3 || now.proven_count() == 0) return;
    restarted = true;
    if (faults.restart_camera) rig.restart_camera();
    if (faults.restart_display) rig.restart_display();
  });
  if (!restarted) session.set_step_count(0);  // the restart was never tried
  return session;
}

struct Judged {
  int kept = 0, mislabelled = 0;
};
absl::StatusOr<Judged> judge(const fs::path& directory, const View& view, bool verbose) {
  absl::StatusOr<std::unique_ptr<Archive>> archive = Archive::open(directory);
  if (!archive.ok()) return archive.status();
  Judged judged;
  const v1::CaptureManifest manifest = (*archive)->manifest();
  for (const v1::Frame& frame : manifest.frames()) {
    const absl::StatusOr<std::string> bytes = (*archive)->read_frame_bytes(frame.file());
    if (!bytes.ok()) return bytes.status();
    const absl::StatusOr<Image16> image = decode_tiff(*bytes);
    if (!image.ok()) return image.status();
    ++judged.kept;
    const std::optional<std::string> wrong = mismatch(*image, frame.stimulus(), view);
    if (!wrong) continue;
    ++judged.mislabelled;
    if (verbose) fmt::print("  step {} ({}): {}\n", frame.step(), frame.stimulus().kind(), *wrong);
  }
  return judged;
}

// Returns false if a frame is mislabelled (capture.labels), a step has no proof, or the fault did not strike.
bool attempt(const Trial& trial, const Settings& settings, const fs::path& data) {
  double step_px = 0.0;
  v1::Plan plan = plan_of(settings, trial.hold_refreshes, step_px);
  if (trial.may_end_unproven) plan.set_retries(5);  // each shows all steps again
  const nanoseconds began = monotonic_now();
  v1::Session session;
  fs::path archive;
  {
    FaultyRig rig(trial.faults, settings.seed, settings.patch_rows, data);
    session = run(rig, trial.faults, plan);
    archive = rig.archive("s");
  }
  const double took_s = std::chrono::duration<double>(monotonic_now() - began).count();
  const absl::StatusOr<Judged> judged = judge(archive,
                                              {.pattern_rows = FaultyRig::kHeight_px - settings.patch_rows,
                                               .step_px = step_px,
                                               .noise_sd = FaultyRig::kMaxNoise},
                                              settings.verbose);
  if (!judged.ok()) {
    fmt::print("{:<30} {} {}\n", trial.faults.name, judged.status().ToString(), session.reason());
    return false;
  }
  const int unproven = session.step_count() - session.proven_count();
  fmt::print("{:<30} {:>6} {:>6} {:>6} {:>8} {:>7} {:>8} {:>8.1f}{}{}\n", trial.faults.name,
             session.step_count(), judged->kept, judged->mislabelled, session.refused_count(),
             session.retaken_count(), unproven, took_s, session.reason().empty() ? "" : "  ",
             session.reason().substr(0, 60));
  if (!session.warning().empty()) fmt::print("  warning: {}\n", session.warning());
  std::fflush(stdout);
  const bool complete = session.step_count() > 0 && unproven == 0 && judged->kept == session.step_count();
  const bool struck = !trial.is_seen || session.refused_count() + session.retaken_count() > 0;
  if (!struck) fmt::print("  the fault did not strike: every step was proven when it was first shown\n");
  return judged->mislabelled == 0 && (complete || trial.may_end_unproven) && struck;
}

int run_all(int argc, char** argv) {
  CLI::App app{
      "Runs sessions on simulated rigs with one fault each, and judges every kept frame from its pixels.\n"
      "Fails if a frame is mislabelled, or if a step ends without proof.\n\n"
      "Example:  build/release/bin/glasswing-faults --only 'frames|clock' --seed 7"};
  Settings settings;
  std::string only = ".*", level = "off";
  bool together = false;
  app.add_option("--steps", settings.steps, "minimum number of steps of a session")
      ->check(CLI::Range(50, 15000))
      ->capture_default_str();
  app.add_option("--seed", settings.seed, "seed of all faults and noise")->capture_default_str();
  app.add_option("--only", only, "only faults whose names match this regular expression");
  app.add_option("--patch-rows", settings.patch_rows,
                 "height of the id patch in px; 0: frames are proven by time alone")
      ->check(CLI::Range(0, 64))
      ->capture_default_str();
  app.add_flag("--together", together,
               "one session with many faults at once, instead of one session for each");
  app.add_flag("--verbose", settings.verbose, "print what each mislabelled frame shows");
  app.add_option("--log-level", level, "log level of the daemons: debug, info, warn, error or off")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  start_logging("glasswing-faults", LogOptions{.level = level});
  fmt::print("{:<30} {:>6} {:>6} {:>6} {:>8} {:>7} {:>8} {:>8}\n", "fault", "steps", "kept", "wrong",
             "refused", "retaken", "unproven", "seconds");
  const fs::path data = fs::temp_directory_path() / fmt::format("glasswing-faults.{}", ::getpid());
  int tried = 0, survived = 0;
  for (const Trial& trial : together ? std::vector{all_at_once()} : trials()) {
    if (!std::regex_search(trial.faults.name, std::regex(only))) continue;
    ++tried;
    survived += attempt(trial, settings, data);
    fs::remove_all(data);
  }
  fmt::print("{} cases, {} survived\n", tried, survived);
  return tried > 0 && survived == tried ? 0 : 1;
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  return glasswing::run_all(argc, argv);
}
