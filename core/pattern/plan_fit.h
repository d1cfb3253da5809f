// Plans that fit a rig: chosen for its monitors and its camera, and what of a given plan does not fit.
#pragma once

#include <absl/status/statusor.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/pattern/plan.h"
#include "glasswing/v1/camera_service.pb.h"

namespace glasswing {

// "draft": about a hundred images, wide stripes in three directions. "good": stripes of sigma
// 4 sqrt(longer side / 128) px in four directions, half a sigma apart. "best": half that sigma, and a second,
// shorter exposure for highlights.
enum class PlanQuality { kDraft, kGood, kBest };

// What is captured. "frosted": its footprints are wide, so stripes are twice as wide. "metal": a second,
// shorter exposure for highlights. "dark": a second, longer exposure, up to eight times.
enum class ObjectKind { kClear, kFrosted, kMetal, kDark };

// By the names that people use.
const std::map<std::string, PlanQuality>& plan_qualities();
const std::map<std::string, ObjectKind>& object_kinds();

struct RigLimits {
  std::vector<v1::Monitor> monitors;            // with sizes; a refresh rate of 0 is unknown
  std::optional<v1::GetCameraResponse> camera;  // empty: unknown
  double blur_px = 0.0;                         // sigma on the monitor (`glasswing blur`); 0: unknown
};

struct PlanWish {
  PlanQuality quality = PlanQuality::kGood;
  std::optional<int> images;  // at most so many with the object, at each exposure; chooses sigma
  ObjectKind object = ObjectKind::kClear;
};

// A plan of method "gaussian" for these monitors. Without a camera: 4 ms, two refreshes a step.
// INVALID_ARGUMENT: there is no monitor; even the widest stripes take more images than wished; or the camera
// is too slow.
absl::StatusOr<v1::Plan> make_plan(const PlanWish& wish, const RigLimits& rig);

// Sets the plan's exposure and hold_refreshes. INVALID_ARGUMENT: the camera is too slow.
absl::Status fit_to_camera(const RigLimits& rig, v1::Plan& plan);

// Steps with the object at one exposure. `plan` passes check_plan(), and `rig` has its monitors.
int images_of(const v1::Plan& plan, const RigLimits& rig);

// Readable text: what in the plan does not fit the rig, one sentence each, and what would fit. Monitors that
// the rig does not have are left out.
std::vector<std::string> misfits(const v1::Plan& plan, const RigLimits& rig);

// Rows of an id patch (glasswing-display --patch-rows) whose cells a camera that sees the whole monitor can
// tell apart: a 24th of the pattern's height, but at least six times the blur for each of the two cells.
// Even.
int patch_rows_for(const RigLimits& rig);

// The plan as a file, with comments. They advise an id patch if a monitor has none. `command`: the one that
// made it.
std::string plan_text(const v1::Plan& plan, const RigLimits& rig,
                      std::string_view command = "glasswing plan make");

}  // namespace glasswing
