#include "client/rig/curve_chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <vector>

namespace glasswing {
namespace {

constexpr std::array<const char*, 3> kColours = {"#c62828", "#2e7d32", "#1565c0"};
constexpr double kLeft = 70.0, kWidth = 640.0, kTop = 60.0, kHeight = 360.0, kGap = 60.0, kLow = 160.0;
constexpr int kMaxPoints = 400;

struct Curve {
  std::vector<double> code, light, error;
};

// One panel of the chart, in its own units.
struct Panel {
  double top, height, low, high;
  double x(double code) const { return kLeft + kWidth * code; }
  double y(double value) const { return top + height * (high - std::clamp(value, low, high)) / (high - low); }
};

// A step of 1, 2 or 5 times a power of ten, so that at most `max_count` fit in `range`.
double tick_step(double range, int max_count) {
  const double ten = std::pow(10.0, std::floor(std::log10(range / max_count)));
  for (const double part : {1.0, 2.0, 5.0}) {
    if (range / (part * ten) <= max_count) return part * ten;
  }
  return 10.0 * ten;
}

std::string frame_of(const Panel& panel, const std::string& label, const std::string& unit) {
  std::string svg = fmt::format("<rect x='{}' y='{}' width='{}' height='{}' fill='none' stroke='#888'/>\n",
                                kLeft, panel.top, kWidth, panel.height);
  const double step = tick_step(panel.high - panel.low, 8);
  for (double value = std::ceil(panel.low / step) * step; value <= panel.high + 1e-9; value += step) {
    svg += fmt::format(
        "<line x1='{0}' x2='{1}' y1='{2:.1f}' y2='{2:.1f}' stroke='#ddd'/>"
        "<text x='{3}' y='{4:.1f}' text-anchor='end'>{5:.6g}{6}</text>\n",
        kLeft, kLeft + kWidth, panel.y(value), kLeft - 6.0, panel.y(value) + 4.0,
        std::abs(value) < 1e-9 ? 0.0 : value, unit);
  }
  for (int tenth = 0; tenth <= 10; tenth += 2) {
    svg += fmt::format("<text x='{:.1f}' y='{:.1f}' text-anchor='middle'>{}</text>\n", panel.x(0.1 * tenth),
                       panel.top + panel.height + 16.0, fmt::format("{:.1f}", 0.1 * tenth));
  }
  return svg +
         fmt::format("<text x='{}' y='{}' font-weight='bold'>{}</text>\n", kLeft, panel.top - 8.0, label);
}

std::string line_of(const Panel& panel, const Curve& curve, const std::vector<double>& value,
                    const char* colour, const char* style) {
  std::string points;
  const size_t stride = std::max<size_t>(1, value.size() / kMaxPoints);
  for (size_t i = 0; i < value.size(); ++i) {
    if (i % stride != 0 && i + 1 != value.size()) continue;
    points += fmt::format("{:.1f},{:.1f} ", panel.x(curve.code[i]), panel.y(value[i]));
  }
  return fmt::format("<polyline points='{}' fill='none' stroke='{}' {}/>\n", points, colour, style);
}

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '<') {
      out += "&lt;";
    } else if (c == '&') {
      out += "&amp;";
    } else {
      out += c;
    }
  }
  return out;
}

// `laws`: the simple curve with which each channel is compared.
std::string chart(const std::string& title, const std::vector<Curve>& curves,
                  const std::vector<std::function<double(double)>>& laws, const std::string& law_name) {
  const Panel light{.top = kTop, .height = kHeight, .low = 0.0, .high = 1.0};
  double max_off = 0.5;  // percent
  std::vector<std::vector<double>> off(curves.size());
  for (size_t c = 0; c < curves.size(); ++c) {
    for (size_t i = 0; i < curves[c].code.size(); ++i) {
      off[c].push_back(100.0 * (curves[c].light[i] - laws[c](curves[c].code[i])));
      max_off = std::max(max_off, std::abs(off[c].back()));
    }
  }
  const Panel below{
      .top = kTop + kHeight + kGap, .height = kLow, .low = -1.1 * max_off, .high = 1.1 * max_off};
  std::string svg = fmt::format(
      "<svg xmlns='http://www.w3.org/2000/svg' width='{0}' height='{1}' viewBox='0 0 {0} {1}' "
      "font-family='sans-serif' font-size='12'>\n<rect width='100%' height='100%' fill='white'/>\n"
      "<text x='{2}' y='24' font-size='16'>{3}</text>\n",
      kLeft + kWidth + 30.0, below.top + below.height + 40.0, kLeft, escaped(title));
  svg += frame_of(light, "light, of full scale, over code", "");
  svg += frame_of(below, "less " + law_name + "; thin: three standard errors", " %");
  for (size_t c = 0; c < curves.size(); ++c) {
    svg += line_of(light, curves[c], curves[c].light, kColours[c], "stroke-width='1.5'");
    svg += line_of(below, curves[c], off[c], kColours[c], "stroke-width='1.5'");
    for (const double side : {-3.0, 3.0}) {
      std::vector<double> edge = off[c];
      for (size_t i = 0; i < edge.size(); ++i) edge[i] += 100.0 * side * curves[c].error[i];
      svg += line_of(below, curves[c], edge, kColours[c], "stroke-width='0.5' opacity='0.5'");
    }
  }
  return svg + "</svg>\n";
}

// The exponent of the power law that fits the middle of the curve.
double exponent_of(const Curve& curve) {
  double sum = 0.0, weight = 0.0;
  for (size_t i = 0; i < curve.code.size(); ++i) {
    if (curve.code[i] < 0.2 || curve.code[i] > 0.95 || !(curve.light[i] > 0.0)) continue;
    const double own = std::log(curve.code[i]) * std::log(curve.code[i]);
    sum += own * std::log(curve.light[i]) / std::log(curve.code[i]);
    weight += own;
  }
  return weight > 0.0 ? sum / weight : 1.0;
}

}  // namespace

std::string chart_of(const v1::CameraCalibration& calibration) {
  std::vector<Curve> curves;
  std::vector<std::function<double(double)>> laws;
  for (const v1::CameraCurve& own : calibration.curves()) {
    Curve& curve = curves.emplace_back();
    for (int k = 0; k < own.light_size(); ++k) {
      const double code = static_cast<double>(k) / std::max(own.light_size() - 1, 1);
      if (code < own.darkest_seen() || code > own.brightest_seen()) continue;
      curve.code.push_back(code);
      curve.light.push_back(own.light(k));
      curve.error.push_back(k < own.error_size() ? own.error(k) : 0.0);
    }
    const double black = own.black_level(), top = calibration.saturation();
    Curve above = curve;
    for (double& code : above.code) code = (code - black) / (top - black);
    const double power = calibration.linear() ? 1.0 : exponent_of(above);
    laws.push_back([=](double code) { return std::pow(std::max(code - black, 0.0) / (top - black), power); });
  }
  return chart(fmt::format("Camera {}, measured {}", calibration.camera(), calibration.measured()), curves,
               laws, calibration.linear() ? "the straight line" : "the nearest power law");
}

std::string chart_of(const v1::DisplayCalibration& calibration) {
  std::vector<Curve> curves;
  std::vector<std::function<double(double)>> laws;
  for (const v1::ToneCurve& own : calibration.primaries()) {
    Curve& curve = curves.emplace_back();
    for (int k = 0; k < own.radiance_size(); ++k) {
      curve.code.push_back(static_cast<double>(k) / std::max(own.radiance_size() - 1, 1));
      curve.light.push_back(own.radiance(k));
      curve.error.push_back(k < own.error_size() ? own.error(k) : 0.0);
    }
    laws.push_back([gamma = own.gamma()](double code) { return std::pow(code, gamma); });
  }
  return chart(fmt::format("Monitor {}, measured {}", calibration.monitor(), calibration.measured()), curves,
               laws, "the power law nearest to it");
}

}  // namespace glasswing
