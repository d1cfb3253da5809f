#include "server/sessions/verdict.h"

#include <fmt/format.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/base/median.h"
#include "server/sessions/series.h"

namespace glasswing {
namespace {

constexpr double kSigmas = 5.0;         // how far from the median an outlier is, at least
constexpr double kSigmaOfMad = 1.4826;  // of normal values

struct Measure {
  const char* what;
  bool is_share;
  double least;     // a difference below this is never unusual, whatever the spread
  bool both_sides;  // little is as unusual as much
  // Absent: the session has no such figure.
  std::optional<double> (*of)(const v1::Session& session, const MatteQuality* quality);  // null: unknown
};

bool is_solved(const v1::Session& session) {
  return session.state() == v1::SESSION_STATE_DONE && session.matte_ready() && session.pixel_count() > 0;
}
std::optional<double> of_steps(const v1::Session& session, int count) {
  // Imported frames were not taken by a camera of ours.
  if (session.frames_taken() == 0 || session.step_count() == 0) return std::nullopt;
  return static_cast<double>(count) / session.step_count();
}
std::optional<double> of_pixels(const v1::Session& session, std::int64_t count, std::int64_t all) {
  if (!is_solved(session) || all == 0) return std::nullopt;
  return static_cast<double>(count) / static_cast<double>(all);
}

std::optional<double> of_quality(const MatteQuality* quality, double MatteQuality::*figure) {
  return quality == nullptr ? std::nullopt : std::optional(quality->*figure);
}
std::optional<double> known(std::optional<double> figure) {
  return figure && *figure > 0.0 ? figure : std::nullopt;
}

constexpr Measure kMeasures[] = {
    {"of the steps shown again", true, 0.05, false,
     [](const v1::Session& s, const MatteQuality*) { return of_steps(s, s.retaken_count()); }},
    {"of the steps' frames rejected for their pixels", true, 0.01, false,
     [](const v1::Session& s, const MatteQuality*) { return of_steps(s, s.refused_count()); }},
    {"of the steps proven by time alone", true, 0.01, false,
     [](const v1::Session& s, const MatteQuality*) { return of_steps(s, s.time_proven_count()); }},
    {"s of capture for a step", false, 0.05, false,
     [](const v1::Session& s, const MatteQuality*) -> std::optional<double> {
       const std::optional<double> any = of_steps(s, 1);
       return any ? std::optional(*any * s.capture_seconds()) : std::nullopt;
     }},
    {"changes of the rig", false, 0.5, false,
     [](const v1::Session& s, const MatteQuality*) -> std::optional<double> {
       if (s.frames_taken() == 0) return std::nullopt;
       return static_cast<double>(s.rig_changes_size());
     }},
    {"of the pixels show the object", true, 0.02, true,
     [](const v1::Session& s, const MatteQuality*) {
       return of_pixels(s, s.object_pixel_count(), s.pixel_count());
     }},
    {"of the object's pixels flagged", true, 0.02, false,
     [](const v1::Session& s, const MatteQuality*) {
       return of_pixels(s, s.flagged_pixel_count(), s.object_pixel_count());
     }},
    {"of the object's pixels fitted worse than their noise", true, 0.02, false,
     [](const v1::Session&, const MatteQuality* q) { return of_quality(q, &MatteQuality::poor_fit); }},
    {"px of predicted error of the footprints", false, 0.01, false,
     [](const v1::Session&, const MatteQuality* q) { return known(of_quality(q, &MatteQuality::error_px)); }},
    {"px of blur of the footprints", false, 0.25, false,
     [](const v1::Session&, const MatteQuality* q) { return known(of_quality(q, &MatteQuality::width_px)); }},
    {"of the pixels not solved", true, 0.01, false,
     [](const v1::Session& s, const MatteQuality*) {
       return of_pixels(s, s.unsolved_pixel_count(), s.pixel_count());
     }},
    {"warnings of the matte", false, 0.5, false,
     [](const v1::Session& s, const MatteQuality*) -> std::optional<double> {
       if (!is_solved(s)) return std::nullopt;
       return static_cast<double>(s.matte_warnings_size());
     }},
    {"of the object's pixels not known as well as the plan asks", true, 0.02, false,
     [](const v1::Session& s, const MatteQuality*) -> std::optional<double> {
       if (s.adapted().empty()) return std::nullopt;
       return 1.0 - s.adapted().rbegin()->known_share();
     }},
};

// Series and plan.
std::string key_of(const v1::Session& session) {
  std::string bytes = series_of(session) + "\n";
  google::protobuf::io::StringOutputStream stream(&bytes);
  google::protobuf::io::CodedOutputStream coded(&stream);
  coded.SetSerializationDeterministic(true);
  session.plan().SerializeToCodedStream(&coded);
  coded.Trim();
  return bytes;
}

std::string text_of(const Measure& measure, double value) {
  return measure.is_share ? fmt::format("{:.3g} %", 100.0 * value) : fmt::format("{:.3g}", value);
}

v1::QualityMeasure compare(const Measure& measure, double value, std::vector<double> others) {
  v1::QualityMeasure compared;
  compared.set_what(measure.what);
  compared.set_value(value);
  if (others.empty()) return compared;
  const bool enough = others.size() >= Verdicts::kFewest;
  const double usual = median(others);
  for (double& other : others) other = std::abs(other - usual);
  const double spread = kSigmaOfMad * median(others);
  compared.set_median(usual);
  compared.set_spread(spread);
  const double away = measure.both_sides ? std::abs(value - usual) : value - usual;
  compared.set_outlier(enough && away > std::max(kSigmas * spread, measure.least));
  return compared;
}

}  // namespace

bool Verdicts::judges(const v1::Session& session) {
  return !session.plan().has_calibration() &&
         (session.state() == v1::SESSION_STATE_CAPTURED || session.state() == v1::SESSION_STATE_SOLVING ||
          session.state() == v1::SESSION_STATE_DONE);
}

Verdicts::Verdicts(std::span<const v1::Session> sessions, std::map<std::string, MatteQuality> qualities)
    : qualities_(std::move(qualities)) {
  for (const v1::Session& session : sessions) {
    if (judges(session)) series_[key_of(session)].push_back(session);
  }
}

const MatteQuality* Verdicts::quality_of(const v1::Session& session) const {
  const auto known = qualities_.find(session.name());
  return known == qualities_.end() || !is_solved(session) ? nullptr : &known->second;
}

v1::SessionVerdict Verdicts::of(const v1::Session& session) const {
  v1::SessionVerdict verdict;
  if (!judges(session)) return verdict;
  const auto series = series_.find(key_of(session));
  std::vector<const v1::Session*> others;
  if (series != series_.end()) {
    for (const v1::Session& other : series->second) {
      if (other.name() != session.name()) others.push_back(&other);
    }
  }
  verdict.set_others(static_cast<int>(others.size()));
  std::string text;
  for (const Measure& measure : kMeasures) {
    const std::optional<double> value = measure.of(session, quality_of(session));
    if (!value) continue;
    std::vector<double> values;
    for (const v1::Session* other : others) {
      if (const std::optional<double> its = measure.of(*other, quality_of(*other))) values.push_back(*its);
    }
    const v1::QualityMeasure& compared = *verdict.add_measures() =
        compare(measure, *value, std::move(values));
    if (!compared.outlier()) continue;
    verdict.set_outlier(true);
    text += fmt::format("{}{} {}, usually {}", text.empty() ? "" : "; ", text_of(measure, *value),
                        measure.what, text_of(measure, compared.median()));
  }
  verdict.set_text(
      verdict.outlier() ? text
      : others.size() < kFewest
          ? fmt::format("too few others with this plan in series {} to compare it with", series_of(session))
          : fmt::format("like the {} others of series {}", others.size(), series_of(session)));
  return verdict;
}

}  // namespace glasswing
