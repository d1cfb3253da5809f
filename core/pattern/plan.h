// A capture plan: read and checked with file, line and value in every complaint, then expanded into the
// ordered list of steps that a session shows.
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
inline constexpr std::string_view kRampMethod = "ramp";
// What frames can be solved by.
inline constexpr std::array<std::string_view, 5> kMethods{"gaussian", "hierarchical", "fringe", "alpha",
                                                          "ramp"};
inline constexpr int kDefaultRetries = 10;
inline constexpr double kDefaultExposureMs = 4.0;

// Parses and checks. INVALID_ARGUMENT: "plan.txtpb:12: sigma_px is 0; it must be in (0, 200]".
absl::StatusOr<v1::Plan> parse_plan(std::string_view text, const std::string& file_name);
absl::StatusOr<v1::Plan> read_plan(const std::filesystem::path& path);

// The same checks on a plan that came over the wire; the message then names the field's path.
absl::Status check_plan(const v1::Plan& plan);

// One picture on the rig and one exposure of it.
struct Step {
  int number = 0;       // place in the program
  bool object = false;  // the object is on the stage
  double exposure_ms = 0.0;
  v1::Stimulus stimulus;  // on its panel; the other monitors are black
};

// All steps, those without the object first, then by exposure; each such group starts with what teaches the
// camera where it sees the id patches. A video's come last, in their order. `rig` is every monitor there is;
// the plan picks from it. INVALID_ARGUMENT: a plan that check_plan() refuses, a monitor that the rig lacks,
// of another size, a program past 20000 steps, or a video that does not say which of several monitors it is
// of.
absl::StatusOr<std::vector<Step>> expand(const v1::Plan& plan, const std::vector<v1::Monitor>& rig);

// INVALID_ARGUMENT lists kMethods.
absl::Status check_method(std::string_view name);

// Defaults filled in.
int hold_refreshes_of(const v1::Plan& plan);
int retries_of(const v1::Plan& plan);
int ramp_frames_of(const v1::Ramp& ramp);
int empty_ramp_frames_of(const v1::Ramp& ramp);

// The plan records a video: with the object it shows the ramp and nothing else, and none of it twice.
bool is_video(const v1::Plan& plan);

}  // namespace glasswing
