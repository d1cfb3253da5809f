#include "core/timing/clock_model.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace glasswing {
namespace {

constexpr size_t kMaxExchanges = 64;

double ns(nanoseconds time) {
  return static_cast<double>(time.count());
}

// The maximum of a unimodal function (ternary search).
template <typename F>
double top_of(F f, double low, double high) {
  for (int i = 0; i < 60; ++i) {
    const double a = low + (high - low) / 3.0, b = high - (high - low) / 3.0;
    (f(a) < f(b) ? low : high) = f(a) < f(b) ? a : b;
  }
  return 0.5 * (low + high);
}

}  // namespace

double ClockModel::highest(double at, double skew) const {
  double bound = std::numeric_limits<double>::infinity();
  for (const Cut& cut : cuts_) bound = std::min(bound, cut.max + skew * (at - cut.max_at));
  return bound;
}

double ClockModel::lowest(double at, double skew) const {
  double bound = -std::numeric_limits<double>::infinity();
  for (const Cut& cut : cuts_) bound = std::max(bound, cut.min + skew * (at - cut.min_at));
  return bound;
}

// The skews that all cuts allow. They are an interval, since the gap between the bounds is concave in the
// skew.
bool ClockModel::find_skews() {
  const auto room = [this](double skew) { return highest(0.0, skew) - lowest(0.0, skew); };
  const double best = top_of(room, -kMaxSkew, kMaxSkew);
  if (room(best) < 0.0) return false;
  const auto edge = [&](double outside) {
    if (room(outside) >= 0.0) return outside;
    double inside = best;
    for (int i = 0; i < 50; ++i) {
      const double middle = 0.5 * (inside + outside);
      (room(middle) >= 0.0 ? inside : outside) = middle;
    }
    return outside;
  };
  min_skew_ = edge(-kMaxSkew);
  max_skew_ = edge(kMaxSkew);
  return true;
}

void ClockModel::add(const ClockExchange& exchange) {
  // A clock was set during the exchange: discard it.
  if (exchange.answered < exchange.received ||
      exchange.returned - exchange.sent < exchange.answered - exchange.received)
    return;
  recent_.push_back(exchange);
  if (recent_.size() > kMaxExchanges) recent_.pop_front();
  origin_node_ = exchange.received;
  origin_offset_ = exchange.sent - exchange.received;
  for (;; recent_.pop_front()) {
    cuts_.clear();
    for (const ClockExchange& each : recent_) {
      const double min_at = ns(each.received - origin_node_), max_at = ns(each.answered - origin_node_);
      cuts_.push_back(
          {.min_at = min_at,
           .min = ns(each.sent - each.received - origin_offset_) - kWander * std::abs(min_at),
           .max_at = max_at,
           .max = ns(each.returned - each.answered - origin_offset_) + kWander * std::abs(max_at)});
    }
    if (find_skews() || recent_.size() == 1) return;
  }
}

ClockReading ClockModel::rig_from_node(nanoseconds node_time) const {
  assert(ready());
  const double at = ns(node_time - origin_node_);
  const double high_skew = top_of([&](double s) { return highest(at, s); }, min_skew_, max_skew_),
               low_skew = top_of([&](double s) { return -lowest(at, s); }, min_skew_, max_skew_);
  const double high = highest(at, high_skew), low = lowest(at, low_skew);
  const auto middle = nanoseconds(std::llround(0.5 * (high + low)));
  // Plus a margin for the tolerance of the searches.
  const double error = 0.5 * (high - low) + kWander * std::abs(at) + 100.0;
  return {.time = node_time + origin_offset_ + middle,
          .error = nanoseconds(static_cast<std::int64_t>(std::ceil(error)))};
}

ClockReading ClockModel::node_from_rig(nanoseconds rig_time) const {
  // The skew is so small that the second iteration is exact to a nanosecond.
  nanoseconds node_time = rig_time - origin_offset_;
  ClockReading there;
  for (int i = 0; i < 3; ++i) {
    there = rig_from_node(node_time);
    node_time += rig_time - there.time;
  }
  return {.time = node_time,
          .error = there.error + nanoseconds(static_cast<std::int64_t>(kMaxSkew * ns(there.error)) + 1)};
}

}  // namespace glasswing
