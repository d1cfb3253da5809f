#include "core/import/response_estimate.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>

#include "core/base/median.h"
#include "core/image/image_file.h"

namespace glasswing {
namespace {

constexpr double kNoise = 1.0 / 255.0;  // of a sample: from quantisation and the camera
constexpr double kSaturated = 0.98;
constexpr double kMinDifference = 5.0;  // of a pixel's sum between G = 1 and G = 2, standard deviations
constexpr double kHuber = 2.0;          // standard deviations; beyond it the cost is linear
constexpr double kMinGamma = 0.4, kMaxGamma = 3.0, kStep = 0.05;
constexpr size_t kParts = 4;       // of the pictures, estimated separately
constexpr size_t kMinPixels = 60;  // in a part
constexpr size_t kMinEstimates = 4;
constexpr size_t kMaxRelations = 48;
constexpr double kMaxError = 0.2;
constexpr double kLinear = 0.1;        // from 1: the effect of a black level of a few codes
constexpr double kMinCurvature = 4.0;  // of the cost, for G by 1

// sum of weight f(frame) = 0 at every pixel.
struct Term {
  int frame = 0;
  double weight = 1.0;
};
using Relation = std::vector<Term>;

// Frames whose light can be added: the same monitor, exposure and stage.
using Setting = std::tuple<std::string, double, bool>;

double level_of(const v1::Stimulus& stimulus) {
  if (stimulus.colour().empty()) return 1.0;
  return std::ranges::all_of(stimulus.colour(), [&](double c) { return c == stimulus.colour(0); })
             ? stimulus.colour(0)
             : -1.0;
}

Setting setting_of(const v1::Frame& frame) {
  return {frame.stimulus().panel(), frame.exposure_ms(), frame.object()};
}

// What a frame shows, as text without the complement mark, and the mark: 0 or 1; none if it has no
// complement.
struct Half {
  std::string key;
  size_t side = 0;
};
std::optional<Half> half_of(const v1::Stimulus& stimulus) {
  if (level_of(stimulus) != 1.0) return std::nullopt;
  if (stimulus.kind() == "square") {
    return Half{
        .key = fmt::format("{} {} {}", stimulus.orient(), stimulus.bar_width_px(), stimulus.offset_px()),
        .side = stimulus.inverse() ? 1u : 0u};
  }
  if (stimulus.kind() == "sinusoid" && stimulus.peak() == 1.0) {
    const double phase_deg = std::fmod(std::fmod(stimulus.phase_deg(), 360.0) + 360.0, 360.0);
    return Half{.key = fmt::format("{} {} {:.4f}", stimulus.phi_deg(), stimulus.period_px(),
                                   std::fmod(phase_deg + 1e-6, 180.0)),
                .side = phase_deg + 1e-6 < 180.0 ? 0u : 1u};
  }
  return std::nullopt;
}

struct Shown {
  std::map<std::string, std::array<int, 2>> halves;  // -1: no such frame
  std::vector<std::pair<double, int>> solids;        // level, frame
};

void add_relations(const Shown& shown, std::vector<Relation>& relations) {
  std::optional<int> white, black;
  for (const auto& [level, frame] : shown.solids) {
    if (level == 1.0) white = frame;
    if (level == 0.0) black = frame;
  }
  std::vector<std::array<int, 2>> pairs;
  if (white && black) pairs.push_back({*white, *black});
  for (const auto& [key, frames] : shown.halves) {
    if (frames[0] >= 0 && frames[1] >= 0) pairs.push_back(frames);
  }
  for (size_t i = 1; i < pairs.size(); ++i) {
    relations.push_back({{pairs[i][0], 1.0}, {pairs[i][1], 1.0}, {pairs[0][0], -1.0}, {pairs[0][1], -1.0}});
  }
  if (!white || !black) return;
  for (const auto& [level, frame] : shown.solids) {
    if (level > 0.0 && level < 1.0)
      relations.push_back({{frame, 1.0}, {*white, -level}, {*black, level - 1.0}});
  }
}

std::vector<Relation> relations_of(const v1::CaptureManifest& manifest) {
  std::map<Setting, Shown> settings;
  std::map<std::string, std::vector<int>> alike;  // by stage and stimulus
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    if (!frame.also_lit().empty() || frame.stimulus().reference()) continue;
    Shown& shown = settings[setting_of(frame)];
    if (const std::optional<Half> half = half_of(frame.stimulus()))
      shown.halves.try_emplace(half->key, std::array{-1, -1}).first->second[half->side] = i;
    if (frame.stimulus().kind() == "solid") shown.solids.emplace_back(level_of(frame.stimulus()), i);
    if (frame.exposure_ms() > 0.0)
      alike[std::to_string(frame.object()) + frame.stimulus().SerializeAsString()].push_back(i);
  }
  std::vector<Relation> relations;
  for (const auto& [setting, shown] : settings) add_relations(shown, relations);
  for (const auto& [stimulus, frames] : alike) {
    for (size_t i = 1; i < frames.size(); ++i) {
      const double one_ms = manifest.frames(frames[i - 1]).exposure_ms();
      const double other_ms = manifest.frames(frames[i]).exposure_ms();
      if (one_ms != other_ms) relations.push_back({{frames[i - 1], 1.0}, {frames[i], -one_ms / other_ms}});
    }
  }
  const size_t every = (relations.size() + kMaxRelations - 1) / kMaxRelations;
  if (every < 2) return relations;
  std::vector<Relation> some;
  for (size_t i = 0; i < relations.size(); i += every) some.push_back(relations[i]);
  return some;
}

// Light and its slope by code, for one curve.
struct Curve {
  std::vector<double> light, slope;
};

template <typename Function>
Curve curve_of(double black, Function light_of) {
  constexpr size_t kCodes = 1024;
  Curve curve;
  for (size_t i = 0; i <= kCodes; ++i) {
    const double u = (static_cast<double>(i) / kCodes - black) / (1.0 - black);
    curve.light.push_back(light_of(std::max(u, 0.0)));
    curve.slope.push_back((light_of(std::max(u, 0.0) + kNoise) - light_of(std::max(u - kNoise, 0.0))) /
                          (2.0 * kNoise * (1.0 - black)));
  }
  return curve;
}

size_t index_of(const Curve& curve, float code) {
  return static_cast<size_t>(std::lround(std::clamp(static_cast<double>(code), 0.0, 1.0) *
                                         static_cast<double>(curve.light.size() - 1)));
}

using Codes = std::vector<std::vector<float>>;

// A relation's sum at a pixel, in standard deviations of its noise.
double sum_of(const Relation& relation, const Codes& codes, size_t pixel, const Curve& curve) {
  double sum = 0.0, variance = 0.0;
  for (const Term& term : relation) {
    const size_t index = index_of(curve, codes[term.frame][pixel]);
    sum += term.weight * curve.light[index];
    variance += std::pow(term.weight * curve.slope[index] * kNoise, 2);
  }
  return sum / std::sqrt(std::max(variance, 1e-12));
}

double cost_of(const Relation& relation, const Codes& codes, const std::vector<size_t>& pixels,
               const Curve& curve) {
  double cost = 0.0;
  for (const size_t pixel : pixels) {
    const double off = std::abs(sum_of(relation, codes, pixel, curve));
    cost += off < kHuber ? 0.5 * off * off : kHuber * off - 0.5 * kHuber * kHuber;
  }
  return cost / static_cast<double>(pixels.size());
}

// One G for each relation and part that determines one.
struct Estimates {
  std::vector<double> gammas;
  double power_cost = 0.0, srgb_cost = 0.0;
};

// Where the parabola through the lowest cost and its neighbours is lowest; none if the cost hardly depends on
// G. A cost that decreases up to the end of the range is lowest there: such a relation contradicts others.
std::optional<double> lowest_at(const std::vector<double>& costs, size_t best) {
  const double gamma = kMinGamma + static_cast<double>(best) * kStep;
  if (best == 0 || best + 1 == costs.size()) {
    const double next = best == 0 ? costs[1] : costs[best - 1];
    return next - costs[best] > 0.5 * kMinCurvature * kStep * kStep ? std::optional(gamma) : std::nullopt;
  }
  const double left = costs[best - 1], right = costs[best + 1], bend = left - 2.0 * costs[best] + right;
  if (bend < kMinCurvature * kStep * kStep) return std::nullopt;
  return gamma + 0.5 * (left - right) / bend * kStep;
}

class Estimator {
 public:
  explicit Estimator(double black) {
    for (double gamma = kMinGamma; gamma < kMaxGamma + 0.5 * kStep; gamma += kStep)
      powers_.push_back(curve_of(black, [gamma](double u) { return std::pow(u, gamma); }));
    linear_ = curve_of(black, [](double u) { return u; });
    square_ = curve_of(black, [](double u) { return u * u; });
    srgb_ = curve_of(black, [](double u) {
      return static_cast<double>(linear_of_srgb(static_cast<float>(std::min(u, 1.0))));
    });
  }

  void add(const Relation& relation, const Codes& codes, Estimates& estimates) const {
    for (size_t part = 0; part < kParts; ++part) {
      const std::vector<size_t> pixels = telling_pixels(relation, codes, part);
      if (pixels.size() < kMinPixels) continue;
      std::vector<double> costs;
      for (const Curve& curve : powers_) costs.push_back(cost_of(relation, codes, pixels, curve));
      const size_t best = std::ranges::min_element(costs) - costs.begin();
      const std::optional<double> gamma = lowest_at(costs, best);
      if (!gamma) continue;
      estimates.gammas.push_back(*gamma);
      estimates.power_cost += costs[best];
      estimates.srgb_cost += cost_of(relation, codes, pixels, srgb_);
    }
  }

 private:
  // The pixels of a part whose sum depends on the curve: white and black ones would only add noise.
  std::vector<size_t> telling_pixels(const Relation& relation, const Codes& codes, size_t part) const {
    const size_t count = codes.front().size();
    std::vector<size_t> pixels;
    for (size_t i = part * count / kParts; i < (part + 1) * count / kParts; ++i) {
      const bool saturated =
          std::ranges::any_of(relation, [&](const Term& term) { return codes[term.frame][i] > kSaturated; });
      if (saturated) continue;
      const double straight = sum_of(relation, codes, i, linear_), bent = sum_of(relation, codes, i, square_);
      if (std::abs(straight - bent) > kMinDifference) pixels.push_back(i);
    }
    return pixels;
  }

  std::vector<Curve> powers_;
  Curve linear_, square_;
  Curve srgb_;
};

}  // namespace

ResponseEstimate estimate_response(const v1::CaptureManifest& manifest, const Codes& codes, double black) {
  ResponseEstimate result;
  const std::vector<Relation> relations = relations_of(manifest);
  if (relations.empty()) {
    result.reason = "there are no complements, gray levels or several exposures";
    return result;
  }
  const Estimator estimator(black);
  Estimates estimates;
  for (const Relation& relation : relations) estimator.add(relation, codes, estimates);
  if (estimates.gammas.size() < kMinEstimates) {
    result.reason = "too few pixels have codes between dark and light";
    return result;
  }
  result.gamma = median(estimates.gammas);
  std::vector<double> off;
  for (const double gamma : estimates.gammas) off.push_back(std::abs(gamma - result.gamma));
  result.error = 1.4826 * median(off);
  result.reason = fmt::format("gamma {:.2f} +- {:.2f} from {} sums of photographs", result.gamma,
                              result.error, relations.size());
  if (result.error > kMaxError) {
    result.reason += fmt::format(": they differ by more than {}", kMaxError);
  } else if (std::abs(result.gamma - 1.0) <= std::max(kLinear, result.error)) {
    result.response = "linear";
  } else if (estimates.srgb_cost < estimates.power_cost) {
    result.response = "srgb";
  } else {
    result.response = fmt::format("gamma:{:.2f}", result.gamma);
  }
  return result;
}

}  // namespace glasswing
