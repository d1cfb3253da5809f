#include "solver/frames/frame_corrections.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "core/base/median.h"
#include "core/base/status.h"
#include "core/pattern/stimulus_kind.h"
#include "solver/frames/bad_pixels.h"
#include "solver/frames/frame_names.h"
#include "solver/frames/object_motion.h"
#include "solver/frames/shift_course.h"
#include "solver/method/exposure_merge.h"

namespace glasswing {
namespace {

constexpr double kScatter = 0.0015;              // of gains in a clean session, with what the model lacks
constexpr double kNoise = 2.0;                   // standard deviations of a gain that noise alone scatters by
constexpr double kOddGain = 0.008, kSure = 6.0;  // beyond which a frame is odd; standard deviations
constexpr double kMaxSd = 0.001;                 // of a gain that may be odd
constexpr double kGroups = 0.008;                // by which kinds of frames differ in clean sessions
constexpr double kOddOffset = 0.005;
constexpr size_t kMinMeasured = 8;
constexpr size_t kMinOdd = 5;              // frames: fewer do no harm
constexpr double kMaxBlindFlicker = 0.01;  // with frames whose gain is not known
constexpr double kMinSpread = 0.004,
                 kCourseExplained = 5.0;  // of a course, and over what it does not explain
constexpr double kFloor = 0.001;          // of a gain's error in that
constexpr double kWideCut = 4.0;
constexpr int kCourseRounds = 4;
constexpr size_t kStepGrid = 4;
constexpr double kMinSamePairs = 5.0;
constexpr double kSameFlicker = 0.5;
constexpr double kMaxKnock_px = 4.0, kMaxStepLeft = 0.25;  // that is taken back; what may be left of it
constexpr int kMaxRounds = 3;                              // of reports that find ghosts or flare
constexpr int kBeside = 2;                                 // frames each way that one is compared with
constexpr std::ptrdiff_t kMinCompared = 100;               // pixels
constexpr double kAlike = 0.3, kAlikeSds = 3.0;            // of quarters: of what is found, and errors

double sd_of(std::vector<double> values) {
  const double middle = median(values);
  for (double& value : values) value = std::abs(value - middle);
  return 1.4826 * median(values);
}

double median_size(std::vector<double> values) {
  for (double& value : values) value = std::abs(value);
  return median(values);
}

double mean_of(const std::array<double, kChannels>& values) {
  return (values[0] + values[1] + values[2]) / kChannels;
}

// A measured frame, in the order of time.
struct Step {
  int frame = 0;
  bool object = false, stripe = false;
  double gain = 1.0, sd = 0.0;
  bool same_kind(const Step& other) const { return object == other.object && stripe == other.stripe; }
};

enum class Course { kSteady, kFlicker, kDrift, kJump };

class GainCourse {
 public:
  GainCourse(const v1::CaptureManifest& manifest, const FrameReport& report)
      : manifest_(manifest), report_(report) {
    for (const int f : report.order) {
      const FrameMeasure& measure = report.frames[static_cast<size_t>(f)];
      if (!measure.measured) continue;
      steps_.push_back({.frame = f,
                        .object = manifest.frames(f).object(),
                        .stripe = kind_of(manifest.frames(f).stimulus()) == StimulusKind::kStripe,
                        .gain = mean_of(measure.gain),
                        .sd = measure.gain_sd});
    }
    if (steps_.size() < kMinMeasured) return;
    course_ = find_course();
    if (course_ == Course::kFlicker && pair_scatter() < kSameFlicker * roughness_) course_ = Course::kSteady;
    if (course_ == Course::kDrift || course_ == Course::kJump) {
      if (!is_explained()) course_ = Course::kSteady;
    }
    if (course_ != Course::kSteady) scale_ = find_scale();
  }

  Course course() const { return course_; }
  double scale() const { return scale_; }
  double roughness() const { return roughness_; }
  const std::vector<Step>& steps() const { return steps_; }

  // The gain of a frame on that scale: as measured, and where that says little, as of those beside it in time
  // that show pictures of the same kind.
  std::array<double, kChannels> gain(const Step& step) const {
    std::array<double, kChannels> gain{};
    const std::vector<const Step*> beside = steps_beside(step);
    const bool measured =
        std::ranges::any_of(steps_, [&](const Step& own) { return own.frame == step.frame; });
    for (size_t c = 0; c < kChannels; ++c) {
      const auto own = [&](const Step& other) {
        return report_.frames[static_cast<size_t>(other.frame)].gain[c];
      };
      double sum = 0.0, weight = 0.0;
      for (const Step* other : beside) {
        sum += own(*other) / (other->sd * other->sd);
        weight += 1.0 / (other->sd * other->sd);
      }
      const bool guessed = weight > 0.0 && (measured || course_ != Course::kFlicker);
      const double expected = guessed ? sum / weight : measured ? own(step) : scale_;
      const double trust =
          measured ? roughness_ * roughness_ / (roughness_ * roughness_ + step.sd * step.sd) : 0.0;
      gain[c] = (expected + trust * (measured ? own(step) - expected : 0.0)) / scale_;
    }
    return gain;
  }

  double middle(bool object, bool stripe) const {
    const std::vector<double> own = gains(object, stripe);
    return own.empty() ? NAN : median(own);
  }

 private:
  double usual_sd(bool object, bool stripe) const {
    std::vector<double> sds;
    for (const Step& step : steps_) {
      if (step.object == object && step.stripe == stripe) sds.push_back(step.sd);
    }
    return median(sds);
  }

  std::vector<double> gains(bool object, bool stripe) const {
    std::vector<double> gains;
    for (const Step& step : steps_) {
      if (step.object == object && step.stripe == stripe) gains.push_back(step.gain);
    }
    return gains;
  }

  size_t place(int frame) const {
    return static_cast<size_t>(std::ranges::find(report_.order, frame) - report_.order.begin());
  }

  std::vector<const Step*> steps_beside(const Step& step) const {
    std::vector<std::pair<size_t, const Step*>> near;
    const size_t own = place(step.frame);
    for (const Step& other : steps_) {
      if (other.frame == step.frame || !other.same_kind(step)) continue;
      const size_t at = place(other.frame);
      near.emplace_back(at > own ? at - own : own - at, &other);
    }
    std::ranges::sort(near);
    std::vector<const Step*> beside;
    for (size_t i = 0; i < std::min<size_t>(near.size(), 2 * kBeside); ++i) beside.push_back(near[i].second);
    return beside;
  }

  Course find_course() {
    std::vector<double> all, changes;
    bool odd = false;
    size_t odd_frames = 0;
    for (const bool object : {false, true}) {
      for (const bool stripe : {false, true}) {
        const std::vector<double> own = gains(object, stripe);
        if (own.size() < kMinMeasured) continue;
        const double usual = median(own);
        odd = odd || sd_of(own) > kScatter + kNoise * usual_sd(object, stripe);
        for (const Step& step : steps_) {
          if (step.object != object || step.stripe != stripe || step.sd > kMaxSd) continue;
          odd_frames += std::abs(step.gain - usual) > kOddGain + kSure * step.sd;
        }
      }
    }
    odd = odd || odd_frames >= kMinOdd;
    const double empty = middle(false, false), areas = middle(true, false), stripes = middle(true, true);
    for (const double other : {areas, stripes}) odd = odd || std::abs(other - empty) > kGroups;
    for (size_t i = 0; i < steps_.size(); ++i) {
      all.push_back(steps_[i].gain);
      if (i > 0 && steps_[i].same_kind(steps_[i - 1])) changes.push_back(steps_[i].gain - steps_[i - 1].gain);
    }
    roughness_ = std::max(1e-5, changes.size() < 2 ? 0.0 : sd_of(changes) / std::sqrt(2.0));
    if (!odd) return Course::kSteady;
    std::ranges::sort(all);
    const double spread = all[all.size() * 97 / 100] - all[all.size() * 3 / 100];
    if (roughness_ > 0.15 * spread) return Course::kFlicker;
    return largest_jump() > 0.4 * spread ? Course::kJump : Course::kDrift;
  }

  // By how much gains of the same pictures with and without the object differ, rms, over the root of 2: what
  // the model lacks is alike in both.
  double pair_scatter() const {
    std::map<std::string, std::array<const Step*, 2>> pairs;
    for (const Step& step : steps_) {
      if (!step.stripe)
        pairs[manifest_.frames(step.frame).stimulus().SerializeAsString()][step.object] = &step;
    }
    double squares = 0.0, count = 0.0;
    for (const auto& [stimulus, pair] : pairs) {
      if (pair[0] == nullptr || pair[1] == nullptr) continue;
      squares += (pair[1]->gain - pair[0]->gain) * (pair[1]->gain - pair[0]->gain);
      count += 1.0;
    }
    return count < kMinSamePairs ? 0.0 : std::sqrt(0.5 * squares / count);
  }

  // Whether a smooth course over time, one step, and one more gain for solids and bars with the object and
  // one for stripes, explain most of how gains differ. What the model lacks follows the pictures instead.
  bool is_explained() const {
    double spread = 0.0, rest = INFINITY;
    for (size_t at = 0; at <= steps_.size(); at += kStepGrid) {
      const auto [own_spread, own_rest] = explained_with_step(at);
      if (own_rest < rest) std::tie(spread, rest) = std::pair(own_spread, own_rest);
    }
    return spread > std::max(kMinSpread, kCourseExplained * rest);
  }

  // The spread of what is explained, and the scatter of the rest; with a step before steps_[at], or none at
  // 0.
  std::pair<double, double> explained_with_step(size_t at) const {
    using Basis = Eigen::Matrix<double, 7, 1>;
    const auto basis_of = [&](size_t i) {
      const double t =
          2.0 * static_cast<double>(place(steps_[i].frame)) / static_cast<double>(report_.order.size()) - 1.0;
      const Step& own = steps_[i];
      return Basis{1.0,
                   t,
                   t * t,
                   t * t * t,
                   own.object && !own.stripe ? 1.0 : 0.0,
                   own.stripe ? 1.0 : 0.0,
                   at > 0 && i >= at ? 1.0 : 0.0};
    };
    Basis fit = Basis::Zero();
    std::vector<double> rests(steps_.size(), 0.0);
    double scatter = INFINITY;
    for (int round = 0; round < kCourseRounds; ++round) {
      Eigen::Matrix<double, 7, 7> normal = 1e-6 * Eigen::Matrix<double, 7, 7>::Identity();
      Basis right = Basis::Zero();
      for (size_t i = 0; i < steps_.size(); ++i) {
        const double away = rests[i] / std::max(kWideCut * scatter, 1e-9),
                     part = std::max(0.0, 1.0 - away * away);
        const double weight = part * part / (kFloor * kFloor + steps_[i].sd * steps_[i].sd);
        const Basis basis = basis_of(i);
        normal += weight * basis * basis.transpose();
        right += weight * (steps_[i].gain - 1.0) * basis;
      }
      fit = normal.ldlt().solve(right);
      for (size_t i = 0; i < steps_.size(); ++i) rests[i] = steps_[i].gain - 1.0 - basis_of(i).dot(fit);
      scatter = 1.4826 * median_size(rests);
    }
    // Kinds of pictures differ in clean sessions, too.
    for (const Eigen::Index kind : {4, 5}) fit[kind] = std::abs(fit[kind]) < kGroups ? 0.0 : fit[kind];
    std::vector<double> courses;
    for (size_t i = 0; i < steps_.size(); ++i) courses.push_back(basis_of(i).dot(fit));
    std::ranges::sort(courses);
    const double spread = courses[courses.size() * 97 / 100] - courses[courses.size() * 3 / 100];
    return {spread, scatter};
  }

  double largest_jump() const {
    constexpr size_t kSide = 5;
    double jump = 0.0;
    const auto middle_from = [&](size_t first) {
      std::vector<double> own;
      for (size_t i = first; i < first + kSide; ++i) own.push_back(steps_[i].gain);
      return median(own);
    };
    for (size_t i = kSide; i + kSide <= steps_.size(); ++i)
      jump = std::max(jump, std::abs(middle_from(i) - middle_from(i - kSide)));
    return jump;
  }

  // Of the first frame, on a line through the first quarter.
  double gain_at_start() const {
    double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;
    for (const Step& step : steps_) {
      const auto at = static_cast<double>(place(step.frame));
      if (4.0 * at > static_cast<double>(report_.order.size()) || step.sd > kMaxSd) continue;
      n += 1.0;
      x += at;
      y += step.gain;
      xx += at * at;
      xy += at * step.gain;
    }
    const double determinant = n * xx - x * x;
    return determinant > 0.0 ? (xx * y - x * xy) / determinant : steps_.front().gain;
  }

  double find_scale() const {
    std::vector<double> all;
    for (const Step& step : steps_) all.push_back(step.gain);
    if (course_ == Course::kFlicker) return median(all);
    if (course_ == Course::kDrift) return gain_at_start();
    const double empty = middle(false, false), areas = middle(true, false), stripes = middle(true, true);
    const double apart = std::abs(stripes - empty);
    if (std::isnan(empty)) return median(all);
    const auto as_empty = std::ranges::count_if(steps_, [&](const Step& step) {
      return step.object && step.stripe && std::abs(step.gain - empty) < 0.2 * apart;
    });
    const bool solids_differ =
        std::abs(areas - empty) < 0.3 * apart && as_empty * 10 < std::ssize(gains(true, true));
    return solids_differ ? stripes : empty;
  }

  const v1::CaptureManifest& manifest_;
  const FrameReport& report_;
  std::vector<Step> steps_;
  Course course_ = Course::kSteady;
  double scale_ = 1.0;
  double roughness_ = 0.0;  // what frames differ by from those beside them
};

// What two corrections take off, one after the other. `then` sees light that `first` has corrected.
FrameCorrections both(const FrameCorrections& first, const FrameCorrections& then) {
  FrameCorrections both = first;
  for (size_t k = 0; k < kGhosts; ++k) both.ghost[k] += then.ghost[k];
  for (size_t f = 0; f < both.of_frame.size(); ++f) {
    FrameCorrection& own = both.of_frame[f];
    if (then.of_frame[f].grays.gray >= 0) own.grays = then.of_frame[f].grays;
    for (size_t c = 0; c < kChannels; ++c) {
      own.offset[c] += own.gain[c] * then.of_frame[f].offset[c];
      own.gain[c] *= then.of_frame[f].gain[c];
    }
  }
  return both;
}

bool is_alike(double own, double whole, double sd) {
  return std::abs(own - whole) < kAlike * std::abs(whole) + kAlikeSds * sd;
}

// What each quarter of the pixels beside the object says by itself. Measured when something is found.
class Quarters {
 public:
  Quarters(const v1::CaptureManifest& manifest, const ComparedFrames& compared, const Removed& removed)
      : manifest_(manifest), compared_(compared), removed_(removed) {}

  bool say_ghosts(const FrameReport& whole) const {
    return std::ranges::all_of(reports(), [&](const FrameReport& own) {
      return is_alike(own.ghost[0].value, whole.ghost[0].value, own.ghost[0].sd);
    });
  }

  bool say_flare(const FrameReport& whole) const {
    return std::ranges::all_of(reports(), [&](const FrameReport& own) {
      return is_alike(own.flare.value, whole.flare.value, own.flare.sd);
    });
  }

  // Whether gains differ from `scale` as `steps` do, in the sum over the frames that a quarter tells of.
  bool say_gains(const std::vector<Step>& steps, double scale) const {
    int voters = 0;
    for (const FrameReport& own : reports()) {
      double squares = 0.0, products = 0.0, variance = 0.0;
      size_t count = 0;
      for (const Step& step : steps) {
        const FrameMeasure& measure = own.frames[static_cast<size_t>(step.frame)];
        const double away = step.gain - scale;
        if (!measure.measured) continue;
        squares += away * away;
        products += away * (mean_of(measure.gain) - scale);
        variance += away * away * (measure.gain_sd * measure.gain_sd + step.sd * step.sd);
        ++count;
      }
      if (count < kMinOdd) continue;
      if (!is_alike(products / squares, 1.0, std::sqrt(variance) / squares)) return false;
      ++voters;
    }
    return voters > 1;
  }

  bool say_offset(int frame, double offset) const {
    return std::ranges::all_of(reports(), [&](const FrameReport& own) {
      const FrameMeasure& measure = own.frames[static_cast<size_t>(frame)];
      return !measure.dark || is_alike(mean_of(measure.offset), offset, measure.offset_sd);
    });
  }

 private:
  const std::vector<FrameReport>& reports() const {
    if (!reports_.empty()) return reports_;
    for (const std::vector<bool>& quarter : quarters_of(compared_.samples, compared_.beside))
      reports_.push_back(report_frames(manifest_, compared_, quarter, removed_));
    return reports_;
  }

  const v1::CaptureManifest& manifest_;
  const ComparedFrames& compared_;
  const Removed removed_;
  mutable std::vector<FrameReport> reports_;
};

class Judge {
 public:
  Judge(const v1::CaptureManifest& manifest, const FrameReport& report, const Quarters& quarters)
      : manifest_(manifest), report_(report), quarters_(quarters), gains_(manifest, report) {
    corrections_.of_frame.resize(report.frames.size());
    for (size_t f = 0; f < report.frames.size(); ++f) corrections_.of_frame[f].before = report.before[f];
  }

  // light' = (light - ghosts) / left, light'' = (light' - share mean') / (1 - share).
  FrameCorrections steady(const Removed& removed) {
    const auto left = static_cast<float>(removed.ghosts ? 1.0 - report_.ghost_share() : 1.0);
    const auto share = static_cast<float>(removed.flare ? report_.flare.value : 0.0);
    for (size_t k = 0; k < kGhosts && removed.ghosts; ++k)
      corrections_.ghost[k] = static_cast<float>(report_.ghost[k].value);
    for (size_t f = 0; f < report_.frames.size(); ++f) {
      FrameCorrection& own = corrections_.of_frame[f];
      for (size_t c = 0; c < kChannels; ++c) {
        own.offset[c] = left * share * static_cast<float>(report_.frames[f].mean[c]);
        own.gain[c] = left * (1.0f - share);
      }
    }
    return std::move(corrections_);
  }

  // Where white is over-exposed: whether gray pictures tell what pictures of solids and bars should be.
  bool take_grays(const std::vector<int>& frames, FrameCorrections& corrections) const {
    std::map<int, GrayFrames> grays;
    bool over_exposed = false;
    for (const int f : frames) {
      const StimulusKind kind = kind_of(manifest_.frames(f).stimulus());
      if (kind != StimulusKind::kSolid && kind != StimulusKind::kSquare) continue;
      const GrayFrames own = grays_for(f, frames);
      if (own.gray < 0 || own.black < 0) continue;
      grays[f] = own;
      over_exposed = over_exposed || report_.frames[static_cast<size_t>(f)].clipped;
    }
    if (!over_exposed) return false;
    for (const auto& [f, own] : grays) corrections.of_frame[static_cast<size_t>(f)].grays = own;
    return true;
  }

  FrameFaults changes() {
    if (report_.beside == 0) return {};
    correct_gains();
    correct_offsets();
    FrameFaults faults;
    faults.warnings = std::move(warnings_);
    if (changed_) faults.corrections = std::make_shared<const FrameCorrections>(std::move(corrections_));
    return faults;
  }

 private:
  void correct_gains() {
    if (gains_.course() == Course::kSteady || !quarters_.say_gains(gains_.steps(), gains_.scale())) return;
    if (gains_.course() == Course::kFlicker && gains_.roughness() > kMaxBlindFlicker &&
        std::ranges::any_of(report_.frames, &FrameMeasure::clipped)) {
      warnings_.push_back(
          fmt::format("the frames' light flickers by {:.1f} % (rms): a lamp, or the monitor's backlight "
                      "against the exposure; not "
                      "corrected, as over-exposed frames do not tell by how much: expose less",
                      100.0 * gains_.roughness()));
      return;
    }
    double low = INFINITY, high = -INFINITY;
    for (size_t f = 0; f < report_.frames.size(); ++f) {
      const v1::Frame& frame = manifest_.frames(static_cast<int>(f));
      const Step step{.frame = static_cast<int>(f),
                      .object = frame.object(),
                      .stripe = kind_of(frame.stimulus()) == StimulusKind::kStripe,
                      .gain = 1.0,
                      .sd = report_.frames[f].gain_sd};
      const std::array<double, kChannels> gain = gains_.gain(step);
      for (size_t c = 0; c < kChannels; ++c) corrections_.of_frame[f].gain[c] = static_cast<float>(gain[c]);
      if (!report_.frames[f].measured) continue;
      low = std::min(low, mean_of(gain));
      high = std::max(high, mean_of(gain));
    }
    changed_ = true;
    warnings_.push_back(text_of_gains(low, high));
  }

  std::string text_of_gains(double low, double high) const {
    switch (gains_.course()) {
      case Course::kFlicker:
        return fmt::format(
            "the frames' light flickers between {:.3f} and {:.3f} times the usual: a lamp, or the "
            "monitor's backlight against the exposure; corrected",
            low, high);
      case Course::kDrift: {
        const double last = gains_.steps().back().gain / gains_.scale();
        return fmt::format(
            "the frames' light {} by {:.1f} % from the first to the last, between {:.3f} and {:.3f}: "
            "the monitor warming up, or daylight; corrected to the first",
            last < 1.0 ? "falls" : "rises", 100.0 * std::abs(last - 1.0), low, high);
      }
      default: {
        std::vector<int> odd;
        for (const Step& step : gains_.steps()) {
          if (std::abs(step.gain / gains_.scale() - 1.0) > kGroups) odd.push_back(step.frame);
        }
        return fmt::format(
            "{} {} between {:.3f} and {:.3f} times as bright as the others: the camera's exposure or "
            "gain was changed, or the monitor's brightness; corrected",
            names_of(odd, report_.order), odd.size() == 1 ? "is" : "are", low, high);
      }
    }
  }

  void correct_offsets() {
    for (const bool object : {false, true}) {
      std::vector<double> all;
      std::vector<int> odd;
      for (size_t f = 0; f < report_.frames.size(); ++f) {
        if (report_.frames[f].dark && manifest_.frames(static_cast<int>(f)).object() == object)
          all.push_back(mean_of(report_.frames[f].offset));
      }
      if (all.size() < kMinMeasured) continue;
      const double usual = median(all);
      const double scatter = sd_of(all);
      double most = 0.0;
      for (const int f : report_.order) {
        const FrameMeasure& measure = report_.frames[static_cast<size_t>(f)];
        if (!(measure.dark || measure.measured) || manifest_.frames(f).object() != object) continue;
        const double own = mean_of(measure.offset) - usual;
        if (std::abs(own) < kOddOffset + kSure * std::hypot(measure.offset_sd, scatter)) continue;
        if (!measure.dark && std::abs(mean_of(measure.offset)) < kOddOffset) continue;  // not measured
        if (!quarters_.say_offset(f, mean_of(measure.offset))) continue;
        odd.push_back(f);
        if (std::abs(own) > std::abs(most)) most = own;
      }
      if (odd.size() < kMinOdd) continue;
      for (const int f : odd) {
        FrameCorrection& correction = corrections_.of_frame[static_cast<size_t>(f)];
        for (size_t c = 0; c < kChannels; ++c)
          correction.offset[c] = static_cast<float>(report_.frames[static_cast<size_t>(f)].offset[c] - usual);
      }
      changed_ = true;
      warnings_.push_back(
          fmt::format("{} are up to {:.3f} of full scale {} everywhere: a door or a lamp? Subtracted",
                      names_of(odd, report_.order), std::abs(most), most > 0.0 ? "brighter" : "darker"));
    }
  }

  // The brightest gray picture of the same monitor and exposure that is darker than this and not clipped.
  GrayFrames grays_for(int f, const std::vector<int>& frames) const {
    const v1::Frame& frame = manifest_.frames(f);
    GrayFrames grays;
    for (const int other : frames) {
      const v1::Frame& solid = manifest_.frames(other);
      if (kind_of(solid.stimulus()) != StimulusKind::kSolid || !is_pattern(solid) ||
          solid.object() != frame.object() || solid.exposure_ms() != frame.exposure_ms() ||
          solid.stimulus().panel() != frame.stimulus().panel())
        continue;
      const double level = gray_of(solid.stimulus()) / gray_of(frame.stimulus());
      if (level == 0.0) grays.black = other;
      if (!(level > 0.0 && level < 1.0) || report_.frames[static_cast<size_t>(other)].clipped) continue;
      if (grays.gray >= 0 && level < static_cast<double>(grays.level)) continue;
      grays.gray = other;
      grays.level = static_cast<float>(level);
    }
    return grays;
  }

  const v1::CaptureManifest& manifest_;
  const FrameReport& report_;
  const Quarters& quarters_;
  const GainCourse gains_;
  FrameCorrections corrections_;
  std::vector<std::string> warnings_;
  bool changed_ = false;
};

std::vector<std::string> texts_of(double ghost, double flare, bool grays) {
  std::vector<std::string> texts;
  if (grays)
    texts.push_back("white is over-exposed; what it should be is taken from the gray pictures: expose less");
  if (ghost != 0.0) {
    texts.push_back(fmt::format(
        "{:.1f} % of the picture before is left in every frame: the monitor had not settled when the camera "
        "exposed; removed (`glasswing calibrate sync` measures how long to wait)",
        100.0 * ghost));
  }
  if (flare != 0.0) {
    texts.push_back(fmt::format(
        "{:.1f} % of a picture's mean light lies over all of it: flare in the lens, or light back from the "
        "room; removed",
        100.0 * flare));
  }
  return texts;
}

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

// A knock is taken back if little of it is left then.
absl::Status correct_shifts(const v1::CaptureManifest& manifest, const std::vector<int>& frames,
                            const CorrectedReader& read, const FrameReport& report, FrameFaults& faults) {
  const ShiftCourse course = shift_course(report);
  if (course.warning.empty()) return absl::OkStatus();
  faults.warnings.push_back(course.warning);
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
      warning +=
          "; they were moved back, as if it had been the camera: capture again from there for full sharpness";
      return absl::OkStatus();
    }
  }
  warning += "; capture again from there";
  return absl::OkStatus();
}

// Ghosts, flare and over-exposed white, which blur what all else is compared with.
struct Steady {
  std::shared_ptr<const FrameCorrections> corrections;
  double ghost = 0.0, flare = 0.0;
  bool grays = false;
  int rounds = 0;  // in which some was found

  // Whether some of it was found, so that the frames are to be compared again without.
  bool add(const v1::CaptureManifest& manifest, const std::vector<int>& frames,
           const ComparedFrames& compared, const FrameReport& report, Removed removed) {
    const Quarters quarters(manifest, compared, removed);
    removed.ghosts = report.has_ghosts && quarters.say_ghosts(report);
    removed.flare = report.has_flare && quarters.say_flare(report);
    Judge judge(manifest, report, quarters);
    FrameCorrections own = judge.steady(removed);
    const bool over_exposed = judge.take_grays(frames, own);
    if (!removed.ghosts && !removed.flare && !over_exposed) return false;
    ++rounds;
    grays = grays || over_exposed;
    if (removed.ghosts) ghost += report.ghost_share();
    if (removed.flare) flare += report.flare.value;
    corrections =
        std::make_shared<const FrameCorrections>(corrections ? both(*corrections, own) : std::move(own));
    return true;
  }
};

// What changes from frame to frame, with what is steady.
absl::StatusOr<FrameFaults> find_changes(const v1::CaptureManifest& manifest, const std::vector<int>& frames,
                                         const CorrectedReader& read, const ComparedFrames& compared,
                                         const FrameReport& report, const Steady& steady) {
  const Quarters quarters(manifest, compared, {.ghosts = false, .flare = false});
  FrameFaults faults = Judge(manifest, report, quarters).changes();
  for (std::string& text : texts_of(steady.ghost, steady.flare, steady.grays))
    faults.warnings.push_back(std::move(text));
  for (const std::string& text : {report.black_warning, report.white_warning}) {
    if (!text.empty()) faults.warnings.push_back(text);
  }
  if (faults.corrections == nullptr) {
    faults.corrections = steady.corrections;
  } else if (steady.corrections != nullptr) {
    faults.corrections =
        std::make_shared<const FrameCorrections>(both(*steady.corrections, *faults.corrections));
  }
  const size_t said = faults.warnings.size();
  GW_RETURN_IF_ERROR(correct_shifts(manifest, frames, read, report, faults));
  if (faults.warnings.size() > said) return faults;
  if (std::string text = object_motion_warning(manifest, compared); !text.empty())
    faults.warnings.push_back(std::move(text));
  return faults;
}

}  // namespace

absl::StatusOr<FrameFaults> find_faults(const v1::CaptureManifest& manifest, const std::vector<int>& frames,
                                        const CorrectedReader& read) {
  Steady steady;
  FrameFaults faults;
  // The stage's map with sweeps serves the solve, too, if there is nothing to correct.
  for (bool sweeps = true;; sweeps = false) {
    GW_ASSIGN_OR_RETURN(ComparedFrames compared,
                        compare_frames(manifest, frames, read(steady.corrections), sweeps));
    bool more = false;
    if (std::ranges::count(compared.beside, true) >= kMinCompared) {
      const Removed removed{.again = steady.rounds > 0};
      FrameReport report = report_frames(manifest, compared, compared.beside, removed);
      Steady found = steady;
      more = steady.rounds < kMaxRounds && found.add(manifest, frames, compared, report, removed);
      if (!more && (report.has_ghosts || report.has_flare))
        report = report_frames(manifest, compared, compared.beside, {.ghosts = false, .flare = false});
      if (!more) {
        GW_ASSIGN_OR_RETURN(faults, find_changes(manifest, frames, read, compared, report, steady));
      }
      if (!sweeps) steady = std::move(found);
    }
    if (more || (sweeps && faults.corrections != nullptr)) continue;
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
