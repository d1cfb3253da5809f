#include "solver/corrections/gain_course.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <tuple>
#include <utility>

#include "core/base/median.h"
#include "core/pattern/stimulus_kind.h"
#include "solver/frames/frame_statistics.h"

namespace glasswing {
namespace {

using Kind = GainCourse::Kind;

constexpr double kScatter = 0.0015;              // of gains in a clean session, including errors of the model
constexpr double kNoise = 2.0;                   // standard deviations of a gain due to noise alone
constexpr double kOddGain = 0.008, kSure = 6.0;  // beyond which a frame is odd; standard deviations
constexpr double kMaxSd = 0.001;                 // of a gain that may be odd
constexpr size_t kMinMeasured = 8;
constexpr size_t kMinOdd = 5;  // frames: fewer are harmless
constexpr double kMinSpread = 0.004,
                 kCourseExplained = 5.0;  // of a course, and over what it does not explain
constexpr double kFloor = 0.001;          // of a gain's error in that
constexpr double kWideCut = 4.0;
constexpr int kCourseRounds = 4;
constexpr size_t kStepGrid = 4;
constexpr double kMinSamePairs = 5.0;
constexpr double kSameFlicker = 0.5;
constexpr int kBeside = 2;  // frames each way with which one is compared

double median_size(std::vector<double> values) {
  for (double& value : values) value = std::abs(value);
  return median(values);
}

class CourseFinder {
 public:
  CourseFinder(const v1::CaptureManifest& manifest, const FrameReport& report)
      : manifest_(manifest), report_(report) {
    for (const int f : report.order) {
      const FrameMeasure& measure = report.frames[f];
      if (!measure.measured) continue;
      steps_.push_back({.frame = f,
                        .object = manifest.frames(f).object(),
                        .stripe = kind_of(manifest.frames(f).stimulus()) == StimulusKind::kStripe,
                        .gain = mean_of(measure.gain),
                        .sd = measure.gain_sd});
    }
    if (steps_.size() < kMinMeasured) return;
    course_ = find_course();
    if (course_ == Kind::kFlicker && pair_scatter() < kSameFlicker * roughness_) course_ = Kind::kSteady;
    if (course_ == Kind::kDrift || course_ == Kind::kJump) {
      if (!is_explained()) course_ = Kind::kSteady;
    }
    if (course_ != Kind::kSteady) scale_ = find_scale();
  }

  GainCourse course() const {
    GainCourse course{
        .kind = course_, .steps = steps_, .scale = scale_, .roughness = roughness_, .gains = {}};
    for (size_t f = 0; course_ != Kind::kSteady && f < report_.frames.size(); ++f) {
      const v1::Frame& frame = manifest_.frames(static_cast<int>(f));
      course.gains.push_back(gain({.frame = static_cast<int>(f),
                                   .object = frame.object(),
                                   .stripe = kind_of(frame.stimulus()) == StimulusKind::kStripe,
                                   .gain = 1.0,
                                   .sd = report_.frames[f].gain_sd}));
    }
    return course;
  }

 private:
  // The gain of a frame on that scale: as measured, or, if that is unreliable, that of its neighbours in time
  // that show pictures of the same kind.
  std::array<double, kChannels> gain(const GainStep& step) const {
    std::array<double, kChannels> gain{};
    const std::vector<const GainStep*> beside = steps_beside(step);
    const bool measured =
        std::ranges::any_of(steps_, [&](const GainStep& own) { return own.frame == step.frame; });
    for (size_t c = 0; c < kChannels; ++c) {
      const auto own = [&](const GainStep& other) { return report_.frames[other.frame].gain[c]; };
      double sum = 0.0, weight = 0.0;
      for (const GainStep* other : beside) {
        sum += own(*other) / (other->sd * other->sd);
        weight += 1.0 / (other->sd * other->sd);
      }
      const bool guessed = weight > 0.0 && (measured || course_ != Kind::kFlicker);
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

  double usual_sd(bool object, bool stripe) const {
    std::vector<double> sds;
    for (const GainStep& step : steps_) {
      if (step.object == object && step.stripe == stripe) sds.push_back(step.sd);
    }
    return median(sds);
  }

  std::vector<double> gains(bool object, bool stripe) const {
    std::vector<double> gains;
    for (const GainStep& step : steps_) {
      if (step.object == object && step.stripe == stripe) gains.push_back(step.gain);
    }
    return gains;
  }

  size_t place(int frame) const {
    return static_cast<size_t>(std::ranges::find(report_.order, frame) - report_.order.begin());
  }

  std::vector<const GainStep*> steps_beside(const GainStep& step) const {
    std::vector<std::pair<size_t, const GainStep*>> near;
    const size_t own = place(step.frame);
    for (const GainStep& other : steps_) {
      if (other.frame == step.frame || !other.same_kind(step)) continue;
      const size_t at = place(other.frame);
      near.emplace_back(at > own ? at - own : own - at, &other);
    }
    std::ranges::sort(near);
    std::vector<const GainStep*> beside;
    for (size_t i = 0; i < std::min<size_t>(near.size(), 2 * kBeside); ++i) beside.push_back(near[i].second);
    return beside;
  }

  Kind find_course() {
    std::vector<double> all, changes;
    bool odd = false;
    size_t odd_frames = 0;
    for (const bool object : {false, true}) {
      for (const bool stripe : {false, true}) {
        const std::vector<double> own = gains(object, stripe);
        if (own.size() < kMinMeasured) continue;
        const double usual = median(own);
        odd = odd || sd_of(own) > kScatter + kNoise * usual_sd(object, stripe);
        for (const GainStep& step : steps_) {
          if (step.object != object || step.stripe != stripe || step.sd > kMaxSd) continue;
          odd_frames += std::abs(step.gain - usual) > kOddGain + kSure * step.sd;
        }
      }
    }
    odd = odd || odd_frames >= kMinOdd;
    const double empty = middle(false, false), areas = middle(true, false), stripes = middle(true, true);
    for (const double other : {areas, stripes}) odd = odd || std::abs(other - empty) > kKindsDiffer;
    for (size_t i = 0; i < steps_.size(); ++i) {
      all.push_back(steps_[i].gain);
      if (i > 0 && steps_[i].same_kind(steps_[i - 1])) changes.push_back(steps_[i].gain - steps_[i - 1].gain);
    }
    roughness_ = std::max(1e-5, changes.size() < 2 ? 0.0 : sd_of(changes) / std::sqrt(2.0));
    if (!odd) return Kind::kSteady;
    std::ranges::sort(all);
    const double spread = all[all.size() * 97 / 100] - all[all.size() * 3 / 100];
    if (roughness_ > 0.15 * spread) return Kind::kFlicker;
    return largest_jump() > 0.4 * spread ? Kind::kJump : Kind::kDrift;
  }

  // By how much gains of the same pictures with and without the object differ, rms, over the root of 2:
  // errors of the model are the same in both.
  double pair_scatter() const {
    std::map<std::string, std::array<const GainStep*, 2>> pairs;
    for (const GainStep& step : steps_) {
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
  // one for stripes, explain most of the differences between gains. Otherwise errors of the model follow the
  // pictures.
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
      const GainStep& own = steps_[i];
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
    for (const Eigen::Index kind : {4, 5}) fit[kind] = std::abs(fit[kind]) < kKindsDiffer ? 0.0 : fit[kind];
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
    for (const GainStep& step : steps_) {
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
    for (const GainStep& step : steps_) all.push_back(step.gain);
    if (course_ == Kind::kFlicker) return median(all);
    if (course_ == Kind::kDrift) return gain_at_start();
    const double empty = middle(false, false), areas = middle(true, false), stripes = middle(true, true);
    const double apart = std::abs(stripes - empty);
    if (std::isnan(empty)) return median(all);
    const auto as_empty = std::ranges::count_if(steps_, [&](const GainStep& step) {
      return step.object && step.stripe && std::abs(step.gain - empty) < 0.2 * apart;
    });
    const bool solids_differ =
        std::abs(areas - empty) < 0.3 * apart && as_empty * 10 < std::ssize(gains(true, true));
    return solids_differ ? stripes : empty;
  }

  const v1::CaptureManifest& manifest_;
  const FrameReport& report_;
  std::vector<GainStep> steps_;
  Kind course_ = Kind::kSteady;
  double scale_ = 1.0;
  double roughness_ = 0.0;  // what frames differ by from those beside them
};

}  // namespace

GainCourse gain_course(const v1::CaptureManifest& manifest, const FrameReport& report) {
  return CourseFinder(manifest, report).course();
}

}  // namespace glasswing
