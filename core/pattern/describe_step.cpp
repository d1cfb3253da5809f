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

}  // namespace glasswing
