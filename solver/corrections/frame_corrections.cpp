#include "solver/corrections/frame_corrections.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "core/base/status.h"
#include "core/pattern/stimulus_kind.h"
#include "solver/corrections/bad_pixels.h"
#include "solver/corrections/bar_sums.h"
#include "solver/corrections/light_changes.h"
#include "solver/corrections/object_motion.h"
#include "solver/corrections/quarters.h"
#include "solver/corrections/second_step.h"
#include "solver/corrections/shift_correction.h"
#include "solver/corrections/shift_course.h"
#include "solver/corrections/steady_light.h"

namespace glasswing {
namespace {

constexpr std::ptrdiff_t kMinCompared = 100;  // pixels
constexpr double kObjectMoves_px = 1.0;       // if it moves: its rim shows that, but not by how much

// Without frames that do not measure the light: bars whose edges moved, and shaky ones.
FrameReport without_moved(const v1::CaptureManifest& manifest, FrameReport report) {
  const ShiftCourse course = shift_course(report);
  if (course.moved_px == 0.0) return report;
  for (size_t f = 0; f < report.frames.size(); ++f) {
    if (!course.trembles && kind_of(manifest.frames(static_cast<int>(f)).stimulus()) != StimulusKind::kSquare)
      continue;
    report.frames[f].measured = report.frames[f].dark = false;
  }
  return report;
}

// The quantities that change from frame to frame, together with the constant ones.
absl::StatusOr<FrameFaults> find_changes(const v1::CaptureManifest& manifest, const std::vector<int>& frames,
                                         const CorrectedReader& read, const ComparedFrames& compared,
                                         const FrameReport& report, const SteadyLight& steady) {
  const Quarters quarters(manifest, compared, {.ghosts = false, .flare = false});
  const FrameReport still = without_moved(manifest, report);
  LightChanges changes = light_changes(manifest, still, quarters);
  FrameFaults faults;
  faults.warnings = std::move(changes.warnings);
  for (std::string& text : warnings_of(steady)) faults.warnings.push_back(std::move(text));
  for (const std::string& text : {report.black_warning, report.white_warning}) {
    if (!text.empty()) faults.warnings.push_back(text);
  }
  faults.corrections = steady.corrections;
  if (changes.corrections) {
    faults.corrections = std::make_shared<const FrameCorrections>(
        steady.corrections ? both(*steady.corrections, *changes.corrections) : *changes.corrections);
  }
  const size_t said = faults.warnings.size();
  GW_RETURN_IF_ERROR(correct_shifts(manifest, frames, read, report, faults));
  if (faults.warnings.size() > said) return faults;
  if (std::string text = object_motion_warning(manifest, compared, report.order,
                                               changes.corrections ? &*changes.corrections : nullptr);
      !text.empty()) {
    faults.warnings.push_back(std::move(text));
    faults.disturbance = {.moved_px = kObjectMoves_px, .object_only = true};
  }
  return faults;
}

}  // namespace

absl::StatusOr<FrameFaults> find_faults(const v1::CaptureManifest& manifest, const std::vector<int>& frames,
                                        const CorrectedReader& read) {
  SteadyLight steady;
  FrameFaults faults;
  // The stage's map with sweeps is also used by the solve if there is nothing to correct.
  for (bool sweeps = true;; sweeps = false) {
    GW_ASSIGN_OR_RETURN(ComparedFrames compared,
                        compare_frames(manifest, frames, read(steady.corrections), sweeps));
    bool more = false;
    const std::ptrdiff_t beside = std::ranges::count(compared.beside, true);
    if (beside >= kMinCompared) {
      const Removed removed{.again = steady.rounds > 0};
      FrameReport report = report_frames(manifest, compared, compared.beside, removed);
      const std::optional<SteadyLight> found = more_steady_light(manifest, frames, compared, report, steady);
      more = found.has_value();
      if (!more) {
        if (report.has_ghosts || report.has_flare)
          report = report_frames(manifest, compared, compared.beside, {.ghosts = false, .flare = false});
        GW_ASSIGN_OR_RETURN(faults, find_changes(manifest, frames, read, compared, report, steady));
        faults.compared = static_cast<size_t>(beside);
      } else if (!sweeps) {
        steady = *found;
      }
    } else if (std::string text = bar_sums_warning(manifest, compared); !text.empty()) {
      faults.warnings.assign(1, std::move(text));
    }
    if (more || (sweeps && faults.corrections != nullptr)) continue;
    for (std::string& text : second_step_warnings(manifest, compared))
      faults.warnings.push_back(std::move(text));
    if (sweeps) faults.maps = std::make_shared<const StageMaps>(std::move(compared.maps));
    break;
  }
  GW_ASSIGN_OR_RETURN(faults.bad_pixels, find_bad_pixels(manifest, frames, read(faults.corrections)));
  if (!faults.bad_pixels.empty()) {
    faults.warnings.push_back(
        fmt::format("{} pixels of the camera are dead, stuck or noisy; they are filled from their neighbours",
                    faults.bad_pixels.size()));
  }
  return faults;
}

}  // namespace glasswing
