// How badly photographs fit a block of a layout: about the negative logarithm of their likelihood, from 0 for
// photographs that fit to kWorst for each that might be anything. So a bad photograph adds kWorst to the
// right layout and does not rule it out.
#pragma once

#include <array>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "client/layouts/layout_span.h"
#include "client/layouts/pattern_view.h"

namespace glasswing {

class LayoutCosts {
 public:
  static constexpr double kWorst = 6.0;

  // Keeps a reference to `view`.
  explicit LayoutCosts(const PatternView& view) : view_(view) {}

  int photographs() const { return view_.photographs(); }

  double solid(int photograph, bool white) const;
  // Bits from coarse to fine; `pairs`: each with its complement next to it. Every wave has twice as many
  // edges as the previous one.
  double bars(size_t axis, int first, int bits, bool pairs);
  // Waves of `steps` photographs each, of different periods. An arbitrary cost above `most` if it exceeds
  // `most`.
  double fringes(size_t axis, int first, int steps, int waves, double most);

  // The photograph of a wave, from 0 on, that is bad; -1: none.
  int left_out(int first, int steps) const;
  // The photographs of bars that do not show them.
  std::vector<int> bad_bars(size_t axis, int first, int bits, bool pairs);

 private:
  std::vector<double> costs_of_bars(size_t axis, int first, int bits, bool pairs);
  double complement_error(int photograph);  // with the next one
  double wave(size_t axis, int first, int steps);

  const PatternView& view_;
  std::map<std::tuple<size_t, int, int, bool>, double> bars_;
  struct Wave {
    std::array<double, 2> costs{};  // by axis
    int left_out = -1;
  };
  std::map<std::pair<int, int>, Wave> waves_;
  std::map<int, double> complement_errors_;
};

}  // namespace glasswing
