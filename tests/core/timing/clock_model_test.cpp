#include "core/timing/clock_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace glasswing {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

// A node with a known clock reading at every rig time, behind a network with random delays.
class SimulatedNode {
 public:
  using Clock = std::function<nanoseconds(nanoseconds)>;
  using Delay = std::function<nanoseconds(std::mt19937_64&)>;
  SimulatedNode(Clock clock, Delay there, Delay back)
      : clock_(std::move(clock)), there_(std::move(there)), back_(std::move(back)) {}

  nanoseconds now(nanoseconds rig) const { return clock_(rig); }
  ClockExchange exchange(nanoseconds sent) {
    const nanoseconds received = sent + there_(random_), answered = received + microseconds(30),
                      returned = answered + back_(random_);
    return {.sent = sent, .received = now(received), .answered = now(answered), .returned = returned};
  }

 private:
  const Clock clock_;
  const Delay there_, back_;
  std::mt19937_64 random_{7};
};

SimulatedNode::Clock drifting(nanoseconds offset, double ppm) {
  return [=](nanoseconds rig) {
    return rig + offset + nanoseconds(std::llround(static_cast<double>(rig.count()) * ppm * 1e-6));
  };
}

// `least` plus an exponentially distributed delay.
SimulatedNode::Delay jittering(microseconds least, microseconds mean) {
  return [=](std::mt19937_64& random) {
    std::exponential_distribution<double> more(1.0 / (static_cast<double>(mean.count()) + 1e-3));
    return least + nanoseconds(static_cast<std::int64_t>(1000.0 * more(random)));
  };
}

struct Case {
  const char* name;
  SimulatedNode::Clock clock;
  SimulatedNode::Delay there, back;
};

std::vector<Case> cases() {
  std::vector<Case> cases;
  const auto even = jittering(microseconds(150), microseconds(100));
  for (const double ppm : {-200.0, -35.0, 0.0, 200.0})
    cases.push_back({"drift", drifting(seconds(4321), ppm), even, even});
  cases.push_back({"one way slow", drifting(-seconds(9), 40.0),
                   jittering(microseconds(100), microseconds(20)),
                   jittering(milliseconds(9), milliseconds(2))});
  cases.push_back({"jitter to 50 ms", drifting(milliseconds(-3), -80.0),
                   jittering(microseconds(200), milliseconds(10)),
                   jittering(microseconds(200), milliseconds(10))});
  // The frequency varies by 1 ppm within a minute, as in a warming room.
  cases.push_back({"wandering",
                   [](nanoseconds rig) {
                     const double t = 1e-9 * static_cast<double>(rig.count());
                     const double drift_s = 30e-6 * t + 0.5e-6 * 9.5 * std::sin(t / 9.5);
                     return rig + nanoseconds(std::llround(1e9 * drift_s));
                   },
                   even, even});
  return cases;
}

// Exchanges as in a capture: eight at the start, then one per second. In between, readings shortly before or
// after the newest exchange are within their bound of the truth.
TEST(ClockModel, TheTruthLiesWithinTheBound) {
  for (const Case& each : cases()) {
    SimulatedNode node(each.clock, each.there, each.back);
    ClockModel clock;
    nanoseconds rig = seconds(5);
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> around_s(-1.0, 1.5);
    for (int i = 0; i < 8; ++i) clock.add(node.exchange(rig += milliseconds(2)));
    int asked = 0, outside = 0;
    for (int second = 0; second < 200; ++second) {
      clock.add(node.exchange(rig += seconds(1)));
      for (int i = 0; i < 8; ++i, ++asked) {
        const nanoseconds then = rig + nanoseconds(static_cast<std::int64_t>(1e9 * around_s(random)));
        const ClockReading there = clock.node_from_rig(then), back = clock.rig_from_node(node.now(then));
        const bool holds = std::chrono::abs(there.time - node.now(then)) <= there.error &&
                           std::chrono::abs(back.time - then) <= back.error;
        outside += holds ? 0 : 1;
      }
    }
    EXPECT_EQ(outside, 0) << each.name << ", of " << asked;
  }
}

// The best bound of one exchange is half of the shortest round trip, 0.2 ms. The smallest jitter of k
// exchanges is 0.2 ms / k, and k seconds add 2 us k for wander: 40 us together for ten. The test allows three
// times that; without the skew, a second between exchanges would add 250 us.
TEST(ClockModel, TheBoundComesToHalfTheShortestTrip) {
  SimulatedNode node(drifting(seconds(100), 150.0), jittering(microseconds(200), microseconds(200)),
                     jittering(microseconds(200), microseconds(200)));
  ClockModel clock;
  nanoseconds rig = seconds(5);
  for (int i = 0; i < 60; ++i) clock.add(node.exchange(rig += seconds(1)));
  EXPECT_LT(clock.rig_from_node(node.now(rig)).error, microseconds(320));
  EXPECT_LT(clock.rig_from_node(node.now(rig + seconds(1))).error, microseconds(330));
  // 2 x 0.2 ms over 60 s is 7 ppm; a fast node clock is a negative skew of rig time against it.
  EXPECT_NEAR(clock.skew(), -150e-6, 10e-6);
}

TEST(ClockModel, AClockThatWasSetIsBelievedFromThenOn) {
  const nanoseconds step_at = seconds(30);
  const auto clock_of = [&](nanoseconds rig) {
    return rig + (rig < step_at ? seconds(0) : -seconds(3600)) + milliseconds(12);
  };
  SimulatedNode node(clock_of, jittering(microseconds(100), microseconds(50)),
                     jittering(microseconds(100), microseconds(50)));
  ClockModel clock;
  for (nanoseconds rig = seconds(1); rig < seconds(60); rig += seconds(1)) {
    // An exchange during the step.
    if (rig == step_at - seconds(1))
      clock.add({.sent = step_at - microseconds(90),
                 .received = clock_of(step_at - microseconds(10)),
                 .answered = clock_of(step_at + microseconds(10)),
                 .returned = step_at + microseconds(90)});
    clock.add(node.exchange(rig));
    const ClockReading reading = clock.rig_from_node(node.now(rig + milliseconds(1)));
    EXPECT_LE(std::chrono::abs(reading.time - (rig + milliseconds(1))), reading.error) << rig.count();
    EXPECT_LT(reading.error, milliseconds(1));
  }
}

TEST(ClockModel, ThereAndBackIsTheSame) {
  ClockModel clock;
  clock.add({.sent = milliseconds(0),
             .received = milliseconds(100),
             .answered = milliseconds(100),
             .returned = milliseconds(20)});
  clock.add({.sent = milliseconds(30),
             .received = milliseconds(131),
             .answered = milliseconds(131),
             .returned = milliseconds(32)});
  const nanoseconds rig = milliseconds(77);
  const nanoseconds again = clock.rig_from_node(clock.node_from_rig(rig).time).time;
  EXPECT_LE(std::chrono::abs(again - rig), nanoseconds(2));
  EXPECT_NEAR(static_cast<double>(clock.node_from_rig(milliseconds(31)).time.count()), 131e6, 1e6);
}

}  // namespace
}  // namespace glasswing
