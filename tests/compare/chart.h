// Draws curves as SVG.
#pragma once

#include <string>
#include <vector>

namespace glasswing {

struct ChartPoint {
  double x = 0.0, y = 0.0;
};
struct ChartCurve {
  std::string name, colour;
  std::vector<ChartPoint> points;  // joined in this order, each with a mark
};
// One of several panels with common axes.
struct ChartPanel {
  std::string title;
  std::vector<ChartCurve> curves;
  double level = 0.0;  // a dashed line across
};
struct Chart {
  std::string x_label, y_label, level_label;
  std::vector<ChartPanel> panels;
  int columns = 3;
  double per_second = 0.0;  // x per second, for a second line of ticks; 0: none
};

// x is logarithmic, ticks at 1, 2 and 5 times powers of ten; the legend names every curve once. `x` must be
// positive.
std::string svg_of(const Chart& chart);

}  // namespace glasswing
