#include "solver/corrections/shift_correction.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>

#include "core/base/status.h"
#include "solver/corrections/knock_date.h"
#include "solver/corrections/shift_course.h"

namespace glasswing {
namespace {

constexpr int kRoundsBack = 2;                             // a turn blurs the first
constexpr double kMaxKnock_px = 4.0, kMaxStepLeft = 0.25;  // that is removed; what may remain of it

// `corrections`, and frames from the knock on moved back.
std::shared_ptr<const FrameCorrections> moved_back(const v1::CaptureManifest& manifest,
                                                   const FrameReport& report,
                                                   const FrameCorrections* corrections, const Knock& knock) {
  auto moved = std::make_shared<FrameCorrections>();
  if (corrections != nullptr) *moved = *corrections;
  moved->of_frame.resize(report.frames.size());
  const double middle_x_px = 0.5 * (manifest.camera().width_px() - 1),
               middle_y_px = 0.5 * (manifest.camera().height_px() - 1);
  for (auto f = std::ranges::find(report.order, knock.frame); f != report.order.end(); ++f) {
    FrameCorrection& own = moved->of_frame[*f];
    own.dx_px = static_cast<float>(knock.dx_px + knock.turn_rad * middle_y_px);
    own.dy_px = static_cast<float>(knock.dy_px - knock.turn_rad * middle_x_px);
    own.turn_rad = static_cast<float>(knock.turn_rad);
  }
  return moved;
}

// " (83.2 s after the first)"; empty if frames have no times.
std::string time_of(const v1::CaptureManifest& manifest, const FrameReport& report, int frame) {
  const std::int64_t first_ns = manifest.frames(report.order.front()).exposure_start_ns(),
                     own_ns = manifest.frames(frame).exposure_start_ns();
  if (first_ns <= 0 || own_ns <= first_ns) return "";
  return fmt::format(" ({:.1f} s after the first)", 1e-9 * static_cast<double>(own_ns - first_ns));
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
  const double size_px = knock.size_px(report.radius_px);
  const FrameCorrections* const still = faults.corrections.get();
  const bool can_move = size_px < kMaxKnock_px && manifest.camera().mosaic().empty();
  if (can_move) {
    Knock of_all = knock;
    of_all.frame = report.order.front();
    GW_ASSIGN_OR_RETURN(knock.frame,
                        knock_date(manifest, report.order, frames, knock.frame, read(faults.corrections),
                                   read(moved_back(manifest, report, still, of_all))));
  }
  warning = text_of(knock, time_of(manifest, report, knock.frame));
  for (int round = 0; can_move && round < kRoundsBack; ++round) {
    const auto moved = moved_back(manifest, report, still, knock);
    GW_ASSIGN_OR_RETURN(const ComparedFrames compared, compare_frames(manifest, frames, read(moved), false));
    const FrameReport after = report_frames(manifest, compared, compared.beside, {.again = true});
    Knock left = step_left(after, knock.frame);
    if (knock.turn_rad == 0.0) left.turn_rad = 0.0;
    if (after.beside == 0) break;
    knock.dx_px += left.dx_px;
    knock.dy_px += left.dy_px;
    knock.turn_rad += left.turn_rad;
    if (left.size_px(report.radius_px) >= kMaxStepLeft * size_px) continue;
    warning = text_of(knock, time_of(manifest, report, knock.frame)) +
              "; they were moved back, as if the camera had moved: recapture from there for full sharpness";
    faults.corrections = moved_back(manifest, report, still, knock);
    faults.disturbance = {};
    return absl::OkStatus();
  }
  warning += "; capture again from there";
  return absl::OkStatus();
}

}  // namespace glasswing
