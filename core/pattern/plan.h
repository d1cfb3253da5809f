// A capture plan: read and checked, with file, line and value in every error, then expanded into the ordered
// list of steps that a session shows.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/plan.pb.h"

namespace glasswing {

inline constexpr int kDefaultHoldRefreshes = 2;
inline constexpr std::string_view kCalibrationMethod = "calibration";
inline constexpr int kDefaultRetries = 10;
inline constexpr double kDefaultExposureMs = 4.0;
inline constexpr double kDefaultTargetDb = 40.0;  // of adapting
inline constexpr int kDefaultAtMost = 200;
inline constexpr double kMaxStep_sigmas = 1.5;  // of a sweep, in sigmas: wider steps miss detail

// Parses and checks. INVALID_ARGUMENT: "plan.txtpb:12: sigma_px is 0; it must be in (0, 200]".
absl::StatusOr<v1::Plan> parse_plan(std::string_view text, const std::string& file_name);
absl::StatusOr<v1::Plan> read_plan(const std::filesystem::path& path);

// The same checks for a plan from the wire; errors name the field's path.
absl::Status check_plan(const v1::Plan& plan);

// One picture on the rig and one exposure of it.
struct Step {
  int number = 0;       // index in the program
  bool object = false;  // the object is on the stage
  int round = 0;        // of Plan.rounds, from 1; 0: the plan's own
  double exposure_ms = 0.0;
  v1::Stimulus stimulus;  // on its panel; the other monitors are black
};

// All steps, those without the object first, then by exposure; each such group starts with the patterns from
// which the id patches are learned. The steps of a video come last, in order; so do those of rounds; a
// further round does not change earlier steps. `rig` lists all monitors, from which the plan selects.
// INVALID_ARGUMENT: check_plan() refuses the plan, a monitor is missing from the rig or has another size,
// there are more than 20000 steps, or a video does not name one of several monitors.
absl::StatusOr<std::vector<Step>> expand(const v1::Plan& plan, const std::vector<v1::Monitor>& rig);

// The values, or their defaults.
int hold_refreshes_of(const v1::Plan& plan);
int retries_of(const v1::Plan& plan);
int ramp_frames_of(const v1::Ramp& ramp);
int empty_ramp_frames_of(const v1::Ramp& ramp);

// True if the plan records a video: with the object it shows only the ramp, and never repeats a frame.
bool is_video(const v1::Plan& plan);

}  // namespace glasswing
