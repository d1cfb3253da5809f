#include "solver/gaussian/synthesized_capture.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "core/base/status.h"
#include "core/pattern/pattern.h"
#include "core/pattern/stimulus_kind.h"
#include "solver/background/stage_layout.h"
#include "solver/method/exposure_merge.h"

namespace glasswing {
namespace {

// The largest error of a synthesized pattern at any point of the monitor, as a share of white.
constexpr double kMaxError = 2e-3;
// Ridge, as a share of the trace of the stripes' products. It suppresses periods much shorter than a stripe
// is wide.
constexpr double kRidge = 1e-9;
constexpr double kPointStep_px = 0.5;
// Below this weight a saturated summand does not matter.
constexpr double kMinWeight = 0.02;

// Points along a direction, from one end of the monitor to the other.
struct Axis {
  MonitorSize size;
  double cos_phi = 1.0, sin_phi = 0.0, first_px = 0.0;
  Eigen::Index count = 0;
};

Axis axis_of(const v1::Monitor& monitor, double phi_deg) {
  const double phi_rad = phi_deg * std::numbers::pi / 180.0;
  Axis axis{.size = {monitor.width_px(), monitor.height_px()},
            .cos_phi = std::cos(phi_rad),
            .sin_phi = std::sin(phi_rad)};
  const double across = axis.cos_phi * monitor.width_px(), down = axis.sin_phi * monitor.height_px();
  axis.first_px = std::min(across, 0.0) + std::min(down, 0.0);
  axis.count = static_cast<Eigen::Index>((std::abs(across) + std::abs(down)) / kPointStep_px) + 1;
  return axis;
}

// Red stands for gray.
absl::StatusOr<Eigen::VectorXd> shown(const v1::Stimulus& stimulus, const Axis& axis) {
  GW_ASSIGN_OR_RETURN(const Pattern pattern, Pattern::create(stimulus, axis.size));
  Eigen::VectorXd points(axis.count);
  for (Eigen::Index i = 0; i < axis.count; ++i) {
    const double t = axis.first_px + kPointStep_px * static_cast<double>(i);
    points[i] = static_cast<double>(pattern.radiance(t * axis.cos_phi, t * axis.sin_phi)[0]);
  }
  return points;
}

}  // namespace

void SynthesizedCapture::add(const v1::Frame& frame, std::vector<Part> summands) {
  *manifest.add_frames() = frame;
  parts.push_back(std::move(summands));
}

SynthesizedCapture as_recorded(const v1::CaptureManifest& recorded) {
  return part_of(recorded, [](const v1::Frame&) { return true; });
}

SynthesizedCapture part_of(const v1::CaptureManifest& recorded,
                           const std::function<bool(const v1::Frame&)>& wanted) {
  SynthesizedCapture capture{.manifest = recorded, .parts = {}};
  capture.manifest.clear_frames();
  for (int i = 0; i < recorded.frames_size(); ++i) {
    if (wanted(recorded.frames(i))) capture.add(recorded.frames(i), {{.frame = i, .weight = 1.0}});
  }
  return capture;
}

std::vector<int> frames_of(const SynthesizedCapture& capture, const std::vector<int>& synthesized) {
  std::set<int> frames;
  for (const int frame : synthesized) {
    for (const Part& part : capture.parts[frame]) frames.insert(part.frame);
  }
  return {frames.begin(), frames.end()};
}

FrameStack synthesized_stack(const FrameStack& recorded, const SynthesizedCapture& capture,
                             const std::vector<int>& synthesized) {
  FrameStack stack = recorded;
  stack.brightness.clear();
  stack.stage_maps = nullptr;  // those of all that was recorded
  stack.rows.assign(capture.parts.size(), {});
  auto sums = std::make_shared<std::vector<std::vector<std::uint16_t>>>();
  for (const int frame : synthesized) {
    const std::vector<Part>& parts = capture.parts[frame];
    const auto rows_of = [&](const Part& part) { return recorded.rows[part.frame]; };
    if (parts.size() == 1 && parts.front().weight == 1.0) {
      stack.rows[frame] = rows_of(parts.front());
      continue;
    }
    const size_t count = rows_of(parts.front()).size();
    std::vector<float> light(count, recorded.zero);
    std::vector<bool> saturated(count);
    for (const Part& part : parts) {
      const std::span<const std::uint16_t> rows = rows_of(part);
      const auto weight = static_cast<float>(part.weight);
      const bool counts = std::abs(part.weight) > kMinWeight;
      for (size_t i = 0; i < count; ++i) {
        light[i] += weight * (static_cast<float>(rows[i]) - recorded.zero);
        if (counts && rows[i] >= kSaturatedCode) saturated[i] = true;
      }
    }
    std::vector<std::uint16_t>& sum = sums->emplace_back(count);
    for (size_t i = 0; i < count; ++i) {
      sum[i] = saturated[i] ? std::uint16_t{65535}
                            : static_cast<std::uint16_t>(std::lround(std::clamp(light[i], 0.0f, 65501.0f)));
    }
    stack.rows[frame] = sum;
  }
  stack.owner =
      std::make_shared<std::pair<std::shared_ptr<const void>, decltype(sums)>>(recorded.owner, sums);
  return stack;
}

struct StripeSums::Basis {
  Axis axis;
  std::vector<int> frames;
  int black = -1;
  Eigen::MatrixXd patterns;  // a column a frame
  Eigen::LDLT<Eigen::MatrixXd> products;
};

absl::StatusOr<std::shared_ptr<const StripeSums::Basis>> StripeSums::basis(const std::string& panel,
                                                                           double phi_deg, bool white) {
  std::shared_ptr<const Basis>& known = bases_[{panel, phi_deg, white}];
  if (known) return known;
  auto basis = std::make_shared<Basis>();
  for (const v1::Monitor& monitor : recorded_.monitors()) {
    if (monitor.name() == panel) basis->axis = axis_of(monitor, phi_deg);
  }
  GW_ASSIGN_OR_RETURN(const Exposures exposures, Exposures::of(recorded_));
  for (int i = 0; i < recorded_.frames_size(); ++i) {
    const v1::Frame& frame = recorded_.frames(i);
    const v1::Stimulus& stimulus = frame.stimulus();
    if (!is_pattern(frame) || !frame.object() || frame.exposure_ms() != exposures.times_ms().front())
      continue;
    const double solid = kind_of(stimulus) == StimulusKind::kSolid ? gray_of(stimulus) : -1.0;
    if (solid == 0.0) basis->black = i;
    if (stimulus.panel() != panel) continue;
    const bool stripe = kind_of(stimulus) == StimulusKind::kStripe && stimulus.phi_deg() == phi_deg;
    if (stripe || (white && solid == 1.0)) basis->frames.push_back(i);
  }
  if (basis->frames.size() < 2 || basis->black < 0) {
    return absl::FailedPreconditionError(
        fmt::format("no stripes at {} deg on monitor \"{}\", or no black", phi_deg, panel));
  }
  basis->patterns.resize(basis->axis.count, basis->frames.size());
  for (size_t k = 0; k < basis->frames.size(); ++k) {
    GW_ASSIGN_OR_RETURN(basis->patterns.col(k),
                        shown(recorded_.frames(basis->frames[k]).stimulus(), basis->axis));
  }
  Eigen::MatrixXd products = basis->patterns.transpose() * basis->patterns;
  products.diagonal().array() += kRidge * products.trace();
  basis->products.compute(products);
  known = std::move(basis);
  return known;
}

absl::StatusOr<std::vector<Part>> StripeSums::parts(const v1::Stimulus& wanted, double phi_deg) {
  std::shared_ptr<const Basis> own;
  Eigen::VectorXd weights;
  double error = INFINITY;
  // White is nearly a sum of stripes and the brightest frame: use it only if stripes do not suffice.
  for (const bool white : {false, true}) {
    GW_ASSIGN_OR_RETURN(own, basis(wanted.panel(), phi_deg, white));
    GW_ASSIGN_OR_RETURN(const Eigen::VectorXd points, shown(wanted, own->axis));
    weights = own->products.solve(own->patterns.transpose() * points);
    error = (own->patterns * weights - points).cwiseAbs().maxCoeff();
    if (error <= kMaxError) break;
  }
  if (error > kMaxError) {
    return absl::FailedPreconditionError(
        fmt::format("of stripes as they were recorded at {} deg, {} can be made within {:.2g} of white only",
                    phi_deg, wanted.ShortDebugString(), error));
  }
  std::vector<Part> parts;
  for (size_t k = 0; k < own->frames.size(); ++k)
    parts.push_back({.frame = own->frames[k], .weight = weights[k]});
  // Light that is present even before black counts once.
  parts.push_back({.frame = own->black, .weight = 1.0 - weights.sum()});
  return parts;
}

}  // namespace glasswing
