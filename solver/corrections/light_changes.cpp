#include "solver/corrections/light_changes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/median.h"
#include "solver/corrections/gain_course.h"
#include "solver/frames/frame_names.h"
#include "solver/frames/frame_statistics.h"

namespace glasswing {
namespace {

constexpr double kOddOffset = 0.005,
                 kSureOffset = 6.0;  // beyond which a frame is an outlier; standard deviations
constexpr size_t kMinDark = 8;
constexpr size_t kMinOddOffsets = 5;       // frames: fewer are harmless
constexpr double kMaxBlindFlicker = 0.01;  // with frames whose gain is unknown

std::string text_of_gains(const GainCourse& course, const std::vector<int>& order, double low, double high) {
  switch (course.kind) {
    case GainCourse::Kind::kFlicker:
      return fmt::format(
          "the frames' light flickers between {:.3f} and {:.3f} times the typical: a lamp, or the monitor's "
          "backlight against the exposure; corrected",
          low, high);
    case GainCourse::Kind::kDrift: {
      const double last = course.steps.back().gain / course.scale;
      return fmt::format(
          "the frames' light {} by {:.1f} % from the first to the last, between {:.3f} and {:.3f}: "
          "the monitor warming up, or daylight; corrected to the first",
          last < 1.0 ? "falls" : "rises", 100.0 * std::abs(last - 1.0), low, high);
    }
    default: {
      std::vector<int> odd;
      for (const GainStep& step : course.steps) {
        if (std::abs(step.gain / course.scale - 1.0) > kKindsDiffer) odd.push_back(step.frame);
      }
      return fmt::format(
          "{} {} between {:.3f} and {:.3f} times as bright as the others: the camera's exposure or "
          "gain was changed, or the monitor's brightness; corrected",
          names_of(odd, order), odd.size() == 1 ? "is" : "are", low, high);
    }
  }
}

class ChangeFinder {
 public:
  ChangeFinder(const v1::CaptureManifest& manifest, const FrameReport& report, const Quarters& quarters)
      : manifest_(manifest), report_(report), quarters_(quarters), corrections_(no_corrections(report)) {
    correct_gains();
    correct_offsets();
  }

  LightChanges changes() && {
    LightChanges changes{.corrections = {}, .warnings = std::move(warnings_)};
    if (changed_) changes.corrections = std::move(corrections_);
    return changes;
  }

 private:
  void correct_gains() {
    const GainCourse course = gain_course(manifest_, report_);
    if (course.kind == GainCourse::Kind::kSteady || !quarters_.say_gains(course.steps, course.scale)) return;
    if (course.kind == GainCourse::Kind::kFlicker && course.roughness > kMaxBlindFlicker &&
        std::ranges::any_of(report_.frames, &FrameMeasure::clipped)) {
      warnings_.push_back(
          fmt::format("the frames' light flickers by {:.1f} % (rms): a lamp, or the monitor's backlight "
                      "against the exposure; not corrected, because over-exposed frames do not show by how "
                      "much: reduce the exposure",
                      100.0 * course.roughness));
      return;
    }
    double low = INFINITY, high = -INFINITY;
    for (size_t f = 0; f < report_.frames.size(); ++f) {
      const std::array<double, kChannels>& gain = course.gains[f];
      for (size_t c = 0; c < kChannels; ++c) corrections_.of_frame[f].gain[c] = static_cast<float>(gain[c]);
      if (!report_.frames[f].measured) continue;
      low = std::min(low, mean_of(gain));
      high = std::max(high, mean_of(gain));
    }
    changed_ = true;
    warnings_.push_back(text_of_gains(course, report_.order, low, high));
  }

  void correct_offsets() {
    for (const bool object : {false, true}) {
      std::vector<double> all;
      std::vector<int> odd;
      for (size_t f = 0; f < report_.frames.size(); ++f) {
        if (report_.frames[f].dark && manifest_.frames(static_cast<int>(f)).object() == object)
          all.push_back(mean_of(report_.frames[f].offset));
      }
      if (all.size() < kMinDark) continue;
      const double usual = median(all);
      const double scatter = sd_of(all);
      double most = 0.0;
      for (const int f : report_.order) {
        const FrameMeasure& measure = report_.frames[f];
        if (!(measure.dark || measure.measured) || manifest_.frames(f).object() != object) continue;
        const double own = mean_of(measure.offset) - usual;
        if (std::abs(own) < kOddOffset + kSureOffset * std::hypot(measure.offset_sd, scatter)) continue;
        if (!measure.dark && std::abs(mean_of(measure.offset)) < kOddOffset) continue;  // not measured
        if (!quarters_.say_offset(f, mean_of(measure.offset))) continue;
        odd.push_back(f);
        if (std::abs(own) > std::abs(most)) most = own;
      }
      if (odd.size() < kMinOddOffsets) continue;
      for (const int f : odd) {
        FrameCorrection& correction = corrections_.of_frame[f];
        for (size_t c = 0; c < kChannels; ++c)
          correction.offset[c] = static_cast<float>(report_.frames[f].offset[c] - usual);
      }
      changed_ = true;
      warnings_.push_back(
          fmt::format("{} are up to {:.3f} of full scale {} everywhere: a door or a lamp? Subtracted",
                      names_of(odd, report_.order), std::abs(most), most > 0.0 ? "brighter" : "darker"));
    }
  }

  const v1::CaptureManifest& manifest_;
  const FrameReport& report_;
  const Quarters& quarters_;
  FrameCorrections corrections_;
  std::vector<std::string> warnings_;
  bool changed_ = false;
};

}  // namespace

FrameCorrections no_corrections(const FrameReport& report) {
  FrameCorrections corrections;
  corrections.of_frame.resize(report.frames.size());
  for (size_t f = 0; f < report.frames.size(); ++f) corrections.of_frame[f].before = report.before[f];
  return corrections;
}

LightChanges light_changes(const v1::CaptureManifest& manifest, const FrameReport& report,
                           const Quarters& quarters) {
  if (report.beside == 0) return {};
  return ChangeFinder(manifest, report, quarters).changes();
}

}  // namespace glasswing
