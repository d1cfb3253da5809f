#include "solver/corrections/shift_course.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <span>
#include <vector>

#include "core/base/median.h"

namespace glasswing {
namespace {

constexpr double kMoved_px = 0.1;
// In errors of one frame's shift. Noise that the camera clipped at black moves the fits of one direction
// equally, by up to six of them in rendered scenes with 2 % of noise.
constexpr double kMovedErrors = 10.0;
constexpr double kSurePlace_px = 0.02;   // of a stretch's place, a standard deviation, along both axes
constexpr size_t kStretch = 12;          // frames
constexpr double kMinPrecision = 100.0;  // px^-2: 0.1 px
constexpr double kExplains = 20.0;       // a step over the scatter that it leaves
constexpr double kBetter = 0.5;          // residual of a step, relative to that of an even movement
constexpr double kSameCreep = 0.7;  // cosine of a creep and of the offset of the last frames from the first

struct Place {
  double x_px = 0.0, y_px = 0.0, sd_px = INFINITY;
};

struct Placed {
  int frame = 0;
  double part = 0.0;  // of the session's time
  const FrameMeasure* measure = nullptr;
};

// The normal equations of a place, from shifts with their precision.
struct Sums {
  double xx = 0.0, xy = 0.0, yy = 0.0, x = 0.0, y = 0.0;

  void add(const FrameMeasure& own) {
    // Model errors are the same in all frames: none counts for more than 0.01 px.
    const double cap = std::min(1.0, 1e4 / std::max(own.xx + own.yy, 1.0));
    xx += cap * own.xx;
    xy += cap * own.xy;
    yy += cap * own.yy;
    x += cap * (own.xx * own.dx_px + own.xy * own.dy_px);
    y += cap * (own.xy * own.dx_px + own.yy * own.dy_px);
  }
  // The reduction of chi-square by the best place.
  double explained() const {
    const double a = xx + 1.0, c = yy + 1.0;  // a direction that nothing was seen of stays where it was
    return (c * x * x - 2.0 * xy * x * y + a * y * y) / (a * c - xy * xy);
  }
};

Place place_of(const Sums& sums) {
  const double determinant = sums.xx * sums.yy - sums.xy * sums.xy;
  if (!(determinant > 0.0)) return {};
  return {.x_px = (sums.yy * sums.x - sums.xy * sums.y) / determinant,
          .y_px = (sums.xx * sums.y - sums.xy * sums.x) / determinant,
          .sd_px = std::sqrt((sums.xx + sums.yy) / determinant)};
}

Place place_of(const std::vector<Placed>& frames, size_t first, size_t last) {
  Sums sums;
  for (size_t i = first; i < last; ++i) sums.add(*frames[i].measure);
  return place_of(sums);
}

double angle_of(const FrameMeasure& measure) {
  return 0.5 * std::atan2(2.0 * measure.xy, measure.xx - measure.yy);
}

// Of eight.
int direction_of(const FrameMeasure& measure) {
  return (static_cast<int>(std::lround(angle_of(measure) * 8.0 / std::numbers::pi)) + 8) % 8;
}

// Of one frame's shift.
double usual_error_px(const std::vector<Placed>& frames) {
  std::vector<double> errors_px;
  for (const Placed& frame : frames)
    errors_px.push_back(1.0 / std::sqrt(frame.measure->xx + frame.measure->yy));
  return median(errors_px);
}

std::string words_of(double dx_px, double dy_px) {
  std::vector<std::string> parts;
  if (std::abs(dx_px) >= 0.03)
    parts.push_back(fmt::format("{:.2f} px to the {}", std::abs(dx_px), dx_px > 0.0 ? "right" : "left"));
  if (std::abs(dy_px) >= 0.03)
    parts.push_back(fmt::format("{:.2f} px {}", std::abs(dy_px), dy_px > 0.0 ? "down" : "up"));
  return fmt::format("{}", fmt::join(parts, " and "));
}

// Frames that show by how much the picture is turned.
struct Turned {
  int frame = 0;
  std::ptrdiff_t place = 0;  // in the order of time
  double turn_rad = 0.0, precision = 0.0;
};

std::vector<Turned> turned(const FrameReport& report) {
  std::vector<Turned> frames;
  // Model errors are the same in all frames: none counts for more than 0.01 px at the corners.
  const double least_sd_rad = 0.01 / std::max(report.radius_px, 1.0);
  for (std::ptrdiff_t i = 0; i < std::ssize(report.order); ++i) {
    const FrameMeasure& measure = report.frames[report.order[i]];
    if (!measure.measured || !(measure.turn_sd_rad > 0.0)) continue;
    const double sd_rad = std::max(measure.turn_sd_rad, least_sd_rad);
    frames.push_back({.frame = report.order[i],
                      .place = i,
                      .turn_rad = measure.turn_rad,
                      .precision = 1.0 / (sd_rad * sd_rad)});
  }
  return frames;
}

double turn_of(std::span<const Turned> frames) {
  double sum = 0.0, precision = 0.0;
  for (const Turned& own : frames) {
    sum += own.precision * own.turn_rad;
    precision += own.precision;
  }
  return sum / precision;
}

// By how much frames deviate from such a step, a standard deviation.
double scatter_of(std::span<const Turned> before, std::span<const Turned> after) {
  std::vector<double> rests;
  for (const std::span<const Turned> side : {before, after}) {
    const double turn_rad = turn_of(side);
    for (const Turned& own : side) rests.push_back(std::abs(own.turn_rad - turn_rad));
  }
  return 1.4826 * median(rests);
}

// The turn from the frames before this place in time to the others; 0 if it is uncertain.
double turn_at(const FrameReport& report, const std::vector<Turned>& frames, size_t at) {
  if (at < kStretch || at + kStretch > frames.size()) return 0.0;
  const std::span<const Turned> before = std::span(frames).first(at), after = std::span(frames).subspan(at);
  const double turn_rad = turn_of(after) - turn_of(before);
  const double least_rad = std::max(kMoved_px / report.radius_px, kMovedErrors * scatter_of(before, after));
  return std::abs(turn_rad) > least_rad ? turn_rad : 0.0;
}

size_t count_before(const FrameReport& report, const std::vector<Turned>& frames, int frame) {
  const auto place = std::ranges::find(report.order, frame) - report.order.begin();
  return static_cast<size_t>(
      std::ranges::count_if(frames, [&](const Turned& own) { return own.place < place; }));
}

// The step that explains most of the turns.
std::optional<Knock> turn_of_session(const FrameReport& report) {
  const std::vector<Turned> frames = turned(report);
  if (frames.size() < 4 * kStretch) return std::nullopt;
  double sum = 0.0, precision = 0.0, best = 0.0;
  for (const Turned& own : frames) {
    sum += own.precision * own.turn_rad;
    precision += own.precision;
  }
  size_t at = 0;
  double sum_before = 0.0, precision_before = 0.0;
  for (size_t i = 1; i < frames.size(); ++i) {
    sum_before += frames[i - 1].precision * frames[i - 1].turn_rad;
    precision_before += frames[i - 1].precision;
    const double sum_after = sum - sum_before, precision_after = precision - precision_before;
    const double explained =
        sum_before * sum_before / precision_before + sum_after * sum_after / precision_after;
    if (explained > best) {
      best = explained;
      at = i;
    }
  }
  const double turn_rad = turn_at(report, frames, at);
  if (turn_rad == 0.0) return std::nullopt;
  return Knock{.frame = frames[at].frame, .turn_rad = turn_rad};
}

// By how much frames that show the same direction differ from those beside them, px, rms.
double tremble_px(const std::vector<Placed>& frames) {
  std::vector<double> changes;
  for (size_t i = 1; i < frames.size(); ++i) {
    const FrameMeasure &a = *frames[i - 1].measure, &b = *frames[i].measure;
    const double angle = angle_of(b), before = angle_of(a);
    if (std::abs(std::sin(angle - before)) > 0.1) continue;
    changes.push_back(
        std::abs(std::cos(angle) * (b.dx_px - a.dx_px) + std::sin(angle) * (b.dy_px - a.dy_px)));
  }
  return changes.size() < kStretch ? 0.0 : 1.4826 * median(changes) / std::sqrt(2.0);
}

// The frame before which a step explains most.
size_t step_at(const std::vector<Placed>& frames) {
  std::vector<double> explained(frames.size(), 0.0);
  Sums before, after;
  for (size_t i = 0; i < frames.size(); ++i) {
    explained[i] += before.explained();
    before.add(*frames[i].measure);
  }
  for (size_t i = frames.size(); i-- > 0;) {
    after.add(*frames[i].measure);
    explained[i] += after.explained();
  }
  return static_cast<size_t>(std::ranges::max_element(explained) - explained.begin());
}

std::vector<Placed> placed(const FrameReport& report) {
  std::vector<Placed> frames;
  for (size_t i = 0; i < report.order.size(); ++i) {
    const FrameMeasure& measure = report.frames[report.order[i]];
    if (!measure.measured || measure.xx + measure.yy < kMinPrecision) continue;
    frames.push_back({.frame = report.order[i],
                      .part = static_cast<double>(i) / static_cast<double>(report.order.size()),
                      .measure = &measure});
  }
  return frames;
}

// By how much the place moves over the session, from what frames that show the same direction differ by: for
// two directions separately, the errors of the model may differ.
Place creep_of(const std::vector<Placed>& frames) {
  std::map<int, std::vector<const Placed*>> directions;
  for (const Placed& frame : frames) directions[direction_of(*frame.measure)].push_back(&frame);
  Sums creep;
  for (const auto& [direction, alike] : directions) {
    Sums all;
    double part = 0.0;
    for (const Placed* const frame : alike) {
      all.add(*frame->measure);
      part += frame->part / static_cast<double>(alike.size());
    }
    const double share = 1.0 / static_cast<double>(alike.size());
    for (const Placed* const frame : alike) {
      Sums own;
      own.add(*frame->measure);
      const double away = frame->part - part;
      creep.xx += away * away * own.xx;
      creep.xy += away * away * own.xy;
      creep.yy += away * away * own.yy;
      creep.x += away * (own.x - share * all.x);
      creep.y += away * (own.y - share * all.y);
    }
  }
  return place_of(creep);
}

// Least squares of a place that moves evenly over time.
std::function<Place(size_t)> even_course(const std::vector<Placed>& frames) {
  Eigen::Matrix4d normal = Eigen::Matrix4d::Identity();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  for (const Placed& frame : frames) {
    Sums own;
    own.add(*frame.measure);
    const Eigen::Matrix2d precision{{own.xx, own.xy}, {own.xy, own.yy}};
    const Eigen::Vector2d seen(own.x, own.y);
    normal.topLeftCorner<2, 2>() += precision;
    normal.topRightCorner<2, 2>() += frame.part * precision;
    normal.bottomLeftCorner<2, 2>() += frame.part * precision;
    normal.bottomRightCorner<2, 2>() += frame.part * frame.part * precision;
    right.head<2>() += seen;
    right.tail<2>() += frame.part * seen;
  }
  const Eigen::Vector4d at = normal.ldlt().solve(right);
  return [at, &frames](size_t i) {
    return Place{.x_px = at[0] + frames[i].part * at[2], .y_px = at[1] + frames[i].part * at[3]};
  };
}

// By how much frames deviate from a course in the direction that they show, a standard deviation.
double scatter_px(const std::vector<Placed>& frames, const std::function<Place(size_t)>& course) {
  std::vector<double> rests_px;
  for (size_t i = 0; i < frames.size(); ++i) {
    const FrameMeasure& own = *frames[i].measure;
    const double angle = angle_of(own);
    const Place expected = course(i);
    rests_px.push_back(std::abs(std::cos(angle) * (own.dx_px - expected.x_px) +
                                std::sin(angle) * (own.dy_px - expected.y_px)));
  }
  return 1.4826 * median(rests_px);
}

ShiftCourse course_of_shifts(const FrameReport& report) {
  const std::vector<Placed> frames = placed(report);
  if (frames.size() < 4 * kStretch) return {};
  const double moved_px = std::max(kMoved_px, kMovedErrors * usual_error_px(frames));
  if (const double rms_px = tremble_px(frames); rms_px > moved_px) {
    return {.warning = fmt::format(
                "the picture trembles by {:.2f} px from frame to frame: the camera, the monitor or the table "
                "vibrates; recapture on firmer ground",
                rms_px),
            .knock = std::nullopt,
            .trembles = true,
            .moved_px = 2.0 * rms_px};
  }
  std::vector<Place> places;
  // Ranges grow until they include both directions.
  for (size_t first = 0, last = kStretch; last <= frames.size(); ++last) {
    const Place place = place_of(frames, first, last);
    if (last - first < kStretch || place.sd_px > kSurePlace_px) continue;
    places.push_back(place);
    first = last;
  }
  if (places.size() < 2) return {};
  const Place &early = places.front(), &late = places.back();
  const double x = late.x_px - early.x_px, y = late.y_px - early.y_px, size = std::hypot(x, y);
  if (size < moved_px) return {};
  const size_t at = step_at(frames);
  const Place before = place_of(frames, 0, at), after = place_of(frames, at, frames.size());
  const Knock knock{
      .frame = frames[at].frame, .dx_px = after.x_px - before.x_px, .dy_px = after.y_px - before.y_px};
  const auto course = [&](size_t i) { return i < at ? before : after; };
  const bool known = before.sd_px < kSurePlace_px && after.sd_px < kSurePlace_px;
  // Errors of the model follow the pictures, not time.
  const double rest_px = scatter_px(frames, course);
  if (known && knock.shift_px() > std::max(0.8 * size, kExplains * rest_px) &&
      rest_px < kBetter * scatter_px(frames, even_course(frames)))
    return {.warning = text_of(knock), .knock = knock, .trembles = false, .moved_px = knock.shift_px()};
  const Place creep = creep_of(frames);
  const double length_px = std::hypot(creep.x_px, creep.y_px);
  const bool alike = creep.x_px * x + creep.y_px * y > kSameCreep * length_px * size;
  if (!alike || length_px < size || length_px < kMovedErrors * creep.sd_px) return {};
  return {.warning = fmt::format(
              "the picture moves by at least {} from frame {} to frame {}: the camera or its stand sinks, or "
              "was touched; recapture",
              words_of(x, y), frames.front().frame, frames.back().frame),
          .knock = std::nullopt,
          .trembles = false,
          .moved_px = length_px};
}

}  // namespace

std::string text_of(const Knock& knock, const std::string& when) {
  std::vector<std::string> parts;
  if (const std::string shift = words_of(knock.dx_px, knock.dy_px); !shift.empty())
    parts.push_back("lies " + shift);
  if (knock.turn_rad != 0.0) {
    parts.push_back(fmt::format("is turned by {:.2g}° {}",
                                std::abs(knock.turn_rad) * 180.0 / std::numbers::pi,
                                knock.turn_rad > 0.0 ? "clockwise" : "counter-clockwise"));
  }
  return fmt::format("from frame {}{} on everything {}: the camera, the monitor or the table was touched",
                     knock.frame, when, fmt::join(parts, " and "));
}

ShiftCourse shift_course(const FrameReport& report) {
  ShiftCourse course = course_of_shifts(report);
  if (course.knock) {
    const std::vector<Turned> frames = turned(report);
    course.knock->turn_rad = turn_at(report, frames, count_before(report, frames, course.knock->frame));
  } else if (!course.trembles) {  // what turns about another place creeps, of two sweeps
    course.knock = turn_of_session(report);
  }
  if (!course.knock) return course;
  course.warning = text_of(*course.knock);
  course.moved_px = course.knock->size_px(report.radius_px);
  return course;
}

Knock step_left(const FrameReport& report, int frame) {
  const std::vector<Placed> frames = placed(report);
  const auto place_in_time = [&](int own) {
    return std::ranges::find(report.order, own) - report.order.begin();
  };
  const size_t at = std::ranges::count_if(
      frames, [&](const Placed& own) { return place_in_time(own.frame) < place_in_time(frame); });
  const Place before = place_of(frames, 0, at), after = place_of(frames, at, frames.size());
  Knock left{.frame = frame, .dx_px = after.x_px - before.x_px, .dy_px = after.y_px - before.y_px};
  const std::vector<Turned> turns = turned(report);
  if (const size_t first = count_before(report, turns, frame); first > 0 && first < turns.size())
    left.turn_rad = turn_of(std::span(turns).subspan(first)) - turn_of(std::span(turns).first(first));
  return left;
}

}  // namespace glasswing
