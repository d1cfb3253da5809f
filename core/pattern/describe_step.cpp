#include "core/pattern/describe_step.h"

#include <fmt/format.h>

#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

std::string describe(const v1::Stimulus& stimulus) {
  switch (kind_of(stimulus)) {
    case StimulusKind::kStripe:
      return fmt::format("stripe at {:g} deg, r {:.1f} px", stimulus.phi_deg(), stimulus.r_px());
    case StimulusKind::kSinusoid:
      return fmt::format("sinusoid at {:g} deg, period {:g} px, phase {:g} deg", stimulus.phi_deg(),
                         stimulus.period_px(), stimulus.phase_deg());
    case StimulusKind::kSquare:
      return fmt::format("{} bars of {:g} px{}",
                         stimulus.orient() == "vertical_bars" ? "vertical" : "horizontal",
                         stimulus.bar_width_px(), stimulus.inverse() ? ", inverse" : "");
    case StimulusKind::kPatch:
      return "id patch alone";
    default:
      return stimulus.name().empty() ? stimulus.kind()
                                     : fmt::format("{} {}", stimulus.kind(), stimulus.name());
  }
}

}  // namespace

std::string describe(const Step& step) {
  return fmt::format("{} {}, {:g} ms{}", step.stimulus.panel(), describe(step.stimulus), step.exposure_ms,
                     step.object ? "" : ", without the object");
}

std::string_view describe(v1::RetakeCause cause) {
  switch (cause) {
    case v1::RETAKE_CAUSE_NOT_SHOWN:
      return "not shown on all monitors";
    case v1::RETAKE_CAUSE_NO_FRAME:
      return "no frame";
    case v1::RETAKE_CAUSE_OUTSIDE_WINDOW:
      return "exposure outside the window";
    case v1::RETAKE_CAUSE_WRONG_ID:
      return "wrong id";
    case v1::RETAKE_CAUSE_ID_UNREADABLE:
      return "id patch not readable";
    case v1::RETAKE_CAUSE_TOO_LATE:
      return "frame too late";
    case v1::RETAKE_CAUSE_PATCH_UNSEEN:
      return "id patch not seen";
    default:
      return "unknown";
  }
}

}  // namespace glasswing
