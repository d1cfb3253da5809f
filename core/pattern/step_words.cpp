#include "core/pattern/step_words.h"

#include <fmt/format.h>

namespace glasswing {
namespace {

std::string describe(const v1::Stimulus& stimulus) {
  const std::string& kind = stimulus.kind();
  if (kind == "gauss_stripe")
    return fmt::format("stripe at {:g} deg, r {:.1f} px", stimulus.phi_deg(), stimulus.r_px());
  if (kind == "sinusoid") {
    return fmt::format("sinusoid at {:g} deg, period {:g} px, phase {:g} deg", stimulus.phi_deg(),
                       stimulus.period_px(), stimulus.phase_deg());
  }
  if (kind == "square") {
    return fmt::format("{} bars of {:g} px{}",
                       stimulus.orient() == "vertical_bars" ? "vertical" : "horizontal",
                       stimulus.bar_width_px(), stimulus.inverse() ? ", inverse" : "");
  }
  if (kind == "patch") return "id patch alone";
  return stimulus.name().empty() ? kind : fmt::format("{} {}", kind, stimulus.name());
}

}  // namespace

std::string describe(const Step& step) {
  return fmt::format("{} {}, {:g} ms{}", step.stimulus.panel(), describe(step.stimulus), step.exposure_ms,
                     step.object ? "" : ", without the object");
}

}  // namespace glasswing
