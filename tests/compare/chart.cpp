#include "tests/compare/chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace glasswing {
namespace {

constexpr double kLeft = 60.0, kTop = 64.0, kWidth = 290.0, kHeight = 250.0, kGapX = 44.0, kGapY = 64.0,
                 kBottom = 66.0, kRight = 20.0;
constexpr double kTick_y = 10.0;  // dB

struct Axes {
  double low_x = std::numeric_limits<double>::max(), high_x = 0.0;
  double low_y = std::numeric_limits<double>::max(), high_y = std::numeric_limits<double>::lowest();

  double x(double value) const { return kWidth * std::log(value / low_x) / std::log(high_x / low_x); }
  double y(double value) const { return kHeight * (high_y - value) / (high_y - low_y); }
};

Axes axes_of(const Chart& chart) {
  Axes axes;
  const auto take_y = [&](double y) {
    axes.low_y = std::min(axes.low_y, y);
    axes.high_y = std::max(axes.high_y, y);
  };
  for (const ChartPanel& panel : chart.panels) {
    take_y(panel.level);
    for (const ChartCurve& curve : panel.curves) {
      for (const ChartPoint& point : curve.points) {
        axes.low_x = std::min(axes.low_x, point.x);
        axes.high_x = std::max(axes.high_x, point.x);
        take_y(point.y);
      }
    }
  }
  axes.low_x /= 1.25;
  axes.high_x *= 1.25;
  axes.low_y = std::floor((axes.low_y - 1.0) / 5.0) * 5.0;
  axes.high_y = std::ceil((axes.high_y + 1.0) / 5.0) * 5.0;
  return axes;
}

std::string frame_of(const Axes& axes, double per_second) {
  std::string svg =
      fmt::format("<rect width='{}' height='{}' fill='none' stroke='#888'/>\n", kWidth, kHeight);
  for (double y = std::ceil(axes.low_y / kTick_y) * kTick_y; y <= axes.high_y; y += kTick_y) {
    svg += fmt::format(
        "<line x2='{0}' y1='{1:.1f}' y2='{1:.1f}' stroke='#ddd'/><text x='-6' y='{2:.1f}' "
        "text-anchor='end'>{3:.0f}</text>\n",
        kWidth, axes.y(y), axes.y(y) + 4.0, y);
  }
  for (double ten = std::pow(10.0, std::floor(std::log10(axes.low_x))); ten <= axes.high_x; ten *= 10.0) {
    for (const double part : {1.0, 2.0, 5.0}) {
      const double x = part * ten;
      if (x < axes.low_x || x > axes.high_x) continue;
      svg += fmt::format(
          "<line x1='{0:.1f}' x2='{0:.1f}' y2='{1}' stroke='#eee'/><text x='{0:.1f}' y='{2}' "
          "text-anchor='middle'>{3:.6g}</text>\n",
          axes.x(x), kHeight, kHeight + 16.0, x);
      if (per_second > 0.0 && part > 1.0)  // otherwise they touch

        svg += fmt::format("<text x='{:.1f}' y='{}' text-anchor='middle' fill='#777'>{:.2g} s</text>\n",
                           axes.x(x), kHeight + 31.0, x / per_second);
    }
  }
  return svg;
}

std::string curve_of(const Axes& axes, const ChartCurve& curve) {
  std::string line, marks;
  for (const ChartPoint& point : curve.points) {
    const double x = axes.x(point.x), y = axes.y(point.y);
    line += fmt::format("{:.1f},{:.1f} ", x, y);
    marks += fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='3.5' fill='{}'/>", x, y, curve.colour);
  }
  return fmt::format("<polyline points='{}' fill='none' stroke='{}' stroke-width='1.8'/>{}\n", line,
                     curve.colour, marks);
}

std::string legend_of(const Chart& chart) {
  std::map<std::string, bool> named;
  std::string svg;
  double x = kLeft;
  const auto add = [&](const std::string& name, const std::string& sample) {
    svg += fmt::format("<g transform='translate({:.0f},18)'>{}<text x='24' y='4'>{}</text></g>\n", x, sample,
                       name);
    x += 36.0 + 6.0 * static_cast<double>(name.size());
  };
  for (const ChartPanel& panel : chart.panels) {
    for (const ChartCurve& curve : panel.curves) {
      if (std::exchange(named[curve.name], true)) continue;
      add(curve.name,
          fmt::format("<line x2='18' stroke='{0}' stroke-width='1.8'/><circle cx='9' r='3.5' fill='{0}'/>",
                      curve.colour));
    }
  }
  add(chart.level_label, "<line x2='18' stroke='#555' stroke-dasharray='5 4'/>");
  return svg;
}

}  // namespace

std::string svg_of(const Chart& chart) {
  const Axes axes = axes_of(chart);
  const int columns = std::min(chart.columns, static_cast<int>(chart.panels.size()));
  const int rows = (static_cast<int>(chart.panels.size()) + columns - 1) / columns;
  const double width = kLeft + columns * kWidth + (columns - 1) * kGapX + kRight;
  const double height = kTop + rows * kHeight + (rows - 1) * kGapY + kBottom;
  std::string svg = fmt::format(
      "<svg xmlns='http://www.w3.org/2000/svg' width='{0}' height='{1}' viewBox='0 0 {0} {1}' "
      "font-family='sans-serif' font-size='12'>\n<rect width='100%' height='100%' fill='white'/>\n",
      width, height);
  svg += legend_of(chart);
  for (size_t i = 0; i < chart.panels.size(); ++i) {
    const ChartPanel& panel = chart.panels[i];
    const int column = static_cast<int>(i) % columns, row = static_cast<int>(i) / columns;
    svg +=
        fmt::format("<g transform='translate({:.0f},{:.0f})'>\n<text y='-8' font-weight='bold'>{}</text>\n",
                    kLeft + column * (kWidth + kGapX), kTop + row * (kHeight + kGapY), panel.title);
    svg += frame_of(axes, chart.per_second);
    svg += fmt::format("<line x2='{0}' y1='{1:.1f}' y2='{1:.1f}' stroke='#555' stroke-dasharray='5 4'/>\n",
                       kWidth, axes.y(panel.level));
    for (const ChartCurve& curve : panel.curves) svg += curve_of(axes, curve);
    svg += "</g>\n";
  }
  svg += fmt::format("<text x='{:.0f}' y='{:.0f}' text-anchor='middle'>{}</text>\n", 0.5 * width,
                     height - 12.0, chart.x_label);
  svg += fmt::format("<text transform='translate(14,{:.0f}) rotate(-90)' text-anchor='middle'>{}</text>\n",
                     0.5 * height, chart.y_label);
  return svg + "</svg>\n";
}

}  // namespace glasswing
