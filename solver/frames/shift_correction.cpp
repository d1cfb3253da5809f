#include "solver/frames/shift_correction.h"

#include <algorithm>
#include <memory>
#include <string>

#include "core/base/status.h"
#include "solver/frames/shift_course.h"

namespace glasswing {
namespace {

constexpr double kMaxKnock_px = 4.0, kMaxStepLeft = 0.25;  // that is taken back; what may be left of it

// `corrections`, and frames from the knock on moved back.
std::shared_ptr<const FrameCorrections> moved_back(const FrameReport& report,
                                                   const FrameCorrections* corrections, const Knock& knock) {
  auto moved = std::make_shared<FrameCorrections>();
  if (corrections != nullptr) *moved = *corrections;
  moved->of_frame.resize(report.frames.size());
  for (auto f = std::ranges::find(report.order, knock.frame); f != report.order.end(); ++f) {
    moved->of_frame[static_cast<size_t>(*f)].dx_px = static_cast<float>(knock.dx_px);
    moved->of_frame[static_cast<size_t>(*f)].dy_px = static_cast<float>(knock.dy_px);
  }
  return moved;
}

}  // namespace

absl::Status correct_shifts(const v1::CaptureManifest& manifest, const std::vector<int>& frames,
                            const CorrectedReader& read, const FrameReport& report, FrameFaults& faults) {
  const ShiftCourse course = shift_course(report);
  if (course.warning.empty()) return absl::OkStatus();
  faults.warnings.push_back(course.warning);
  faults.disturbance.moved_px = course.moved_px;
  if (!course.knock) return absl::OkStatus();
  std::string& warning = faults.warnings.back();
  Knock knock = *course.knock;
  if (knock.size_px() < kMaxKnock_px && manifest.camera().mosaic().empty()) {
    const auto moved = moved_back(report, faults.corrections.get(), knock);
    GW_ASSIGN_OR_RETURN(const ComparedFrames compared, compare_frames(manifest, frames, read(moved), false));
    const FrameReport after = report_frames(manifest, compared, compared.beside, {.again = true});
    const Knock left = step_left(after, knock.frame);
    if (after.beside > 0 && left.size_px() < kMaxStepLeft * knock.size_px()) {
      knock.dx_px += left.dx_px;
      knock.dy_px += left.dy_px;
      faults.corrections = moved_back(report, faults.corrections.get(), knock);
      faults.disturbance = {};
      warning +=
          "; they were moved back, as if it had been the camera: capture again from there for full sharpness";
      return absl::OkStatus();
    }
  }
  warning += "; capture again from there";
  return absl::OkStatus();
}

}  // namespace glasswing
