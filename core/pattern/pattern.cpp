#include "core/pattern/pattern.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

// Standard deviations from a stripe's peak beyond which light is 0: exp(-z^2 / 2) is 5e-32 there, and
// denormal floats, further out, are slow.
constexpr double kReach = 12.0;

template <typename Value>
absl::Status bad(const std::string& field, const Value& value, const std::string& accepted) {
  return absl::InvalidArgumentError(fmt::format("stimulus {} is {}; it must be {}", field, value, accepted));
}

template <typename... Visitors>
struct Overloaded : Visitors... {
  using Visitors::operator()...;
};
template <typename... Visitors>
Overloaded(Visitors...) -> Overloaded<Visitors...>;  // needed by clang 14

}  // namespace

absl::StatusOr<Pattern> Pattern::create(const v1::Stimulus& stimulus, MonitorSize size) {
  Colour colour{1.0f, 1.0f, 1.0f};
  if (stimulus.colour_size() != 0 && stimulus.colour_size() != 3) {
    return bad("colour", fmt::format("{} numbers", stimulus.colour_size()), "3: red, green, blue");
  }
  for (int i = 0; i < stimulus.colour_size(); ++i) {
    if (!(stimulus.colour(i) >= 0.0 && stimulus.colour(i) <= 1.0))
      return bad("colour", stimulus.colour(i), "in [0, 1]");
    colour[i] = static_cast<float>(stimulus.colour(i));
  }
  if (kind_of(stimulus) == StimulusKind::kSolid) return Pattern(Solid{}, colour, size);
  if (kind_of(stimulus) == StimulusKind::kRamp) return Pattern(Ramp{}, colour, size);
  if (kind_of(stimulus) == StimulusKind::kStripe || kind_of(stimulus) == StimulusKind::kSinusoid) {
    if (!(stimulus.peak() > 0.0 && stimulus.peak() <= 1.0)) return bad("peak", stimulus.peak(), "in (0, 1]");
    if (!std::isfinite(stimulus.phi_deg())) return bad("phi_deg", stimulus.phi_deg(), "finite");
    for (float& value : colour) value *= static_cast<float>(stimulus.peak());
    const double phi_rad = stimulus.phi_deg() * std::numbers::pi / 180.0;
    const double cos_phi = std::cos(phi_rad), sin_phi = std::sin(phi_rad), period_px = stimulus.period_px();
    if (kind_of(stimulus) == StimulusKind::kSinusoid) {
      if (!(period_px > 0.0) || !std::isfinite(period_px)) return bad("period_px", period_px, "> 0");
      if (!std::isfinite(stimulus.phase_deg())) return bad("phase_deg", stimulus.phase_deg(), "finite");
      const double phase_rad = stimulus.phase_deg() * std::numbers::pi / 180.0;
      return Pattern(Sinusoid{cos_phi, sin_phi, period_px, phase_rad}, colour, size);
    }
    if (!(stimulus.sigma_px() > 0.0) || !std::isfinite(stimulus.sigma_px()))
      return bad("sigma_px", stimulus.sigma_px(), "> 0");
    if (!std::isfinite(stimulus.r_px())) return bad("r_px", stimulus.r_px(), "finite");
    return Pattern(Stripe{cos_phi, sin_phi, stimulus.r_px(), stimulus.sigma_px()}, colour, size);
  }
  if (kind_of(stimulus) == StimulusKind::kSquare) {
    if (stimulus.orient() != "vertical_bars" && stimulus.orient() != "horizontal_bars") {
      return bad("orient", "\"" + stimulus.orient() + "\"", "\"vertical_bars\" or \"horizontal_bars\"");
    }
    if (!(stimulus.bar_width_px() > 0.0) || !std::isfinite(stimulus.bar_width_px())) {
      return bad("bar_width_px", stimulus.bar_width_px(), "> 0");
    }
    if (!std::isfinite(stimulus.offset_px())) return bad("offset_px", stimulus.offset_px(), "finite");
    return Pattern(Square{.along_x = stimulus.orient() == "vertical_bars",
                          .bar_width_px = stimulus.bar_width_px(),
                          .offset_px = stimulus.offset_px(),
                          .inverse = stimulus.inverse()},
                   colour, size);
  }
  return bad("kind", "\"" + stimulus.kind() + "\"", "solid, gauss_stripe, sinusoid, square or ramp");
}

Colour Pattern::radiance(double x_px, double y_px) const {
  const auto scaled = [this](double value) {
    const auto v = static_cast<float>(value);
    return Colour{colour_[0] * v, colour_[1] * v, colour_[2] * v};
  };
  return std::visit(
      Overloaded{[&](const Solid&) { return colour_; },
                 [&](const Stripe& stripe) {
                   const double z =
                       (x_px * stripe.cos_phi + y_px * stripe.sin_phi - stripe.r_px) / stripe.sigma_px;
                   if (std::abs(z) > kReach) return Colour{0.0f, 0.0f, 0.0f};
                   return scaled(std::exp(-0.5 * z * z));
                 },
                 [&](const Sinusoid& wave) {
                   const double t = x_px * wave.cos_phi + y_px * wave.sin_phi;
                   const double angle = 2.0 * std::numbers::pi * t / wave.period_px - wave.phase_rad;
                   return scaled(0.5 * (1.0 + std::cos(angle)));
                 },
                 [&](const Square& square) {
                   const double t = (square.along_x ? x_px : y_px) - square.offset_px;
                   const double bar = std::floor(t / square.bar_width_px);
                   const bool even = 2.0 * std::floor(0.5 * bar) == bar;
                   return scaled(even != square.inverse ? 1.0 : 0.0);
                 },
                 [&](const Ramp&) {
                   const double u = x_px / size_.width_px;
                   const double v = y_px / size_.height_px;
                   return Colour{static_cast<float>(0.1 + 0.8 * u), static_cast<float>(0.1 + 0.8 * v),
                                 static_cast<float>(0.9 - 0.4 * u - 0.4 * v)};
                 }},
      shape_);
}

void Pattern::rasterise(int y_px, std::span<float> row) const {
  if (const auto* const stripe = std::get_if<Stripe>(&shape_)) return rasterise(*stripe, y_px, row);
  if (const auto* const wave = std::get_if<Sinusoid>(&shape_)) return rasterise(*wave, y_px, row);
  for (int x = 0; x < size_.width_px; ++x) {
    const Colour colour = radiance(x + 0.5, y_px + 0.5);
    std::copy(colour.begin(), colour.end(), row.begin() + 3 * x);
  }
}

// Along a row z rises by d per pixel, so exp(-z^2 / 2) is multiplied by q = exp(-z d - d^2 / 2), and q by
// exp(-d^2). After n pixels the product is off by n^2 roundings of a double, which a float does not show.
void Pattern::rasterise(const Stripe& stripe, int y_px, std::span<float> row) const {
  const double off_px = (y_px + 0.5) * stripe.sin_phi - stripe.r_px;
  // The pixels where |z| < kReach; the whole row if the bounds are not finite.
  const double middle = -off_px / stripe.cos_phi - 0.5;
  const double half = kReach * stripe.sigma_px / std::abs(stripe.cos_phi);
  const double width = size_.width_px;
  const double from = std::min(width, std::max(0.0, std::ceil(middle - half)));
  const double to = std::max(from, std::min(width, std::floor(middle + half) + 1.0));
  const auto begin = static_cast<size_t>(from), end = static_cast<size_t>(to);
  std::fill_n(row.begin(), 3 * begin, 0.0f);
  std::fill(row.begin() + 3 * end, row.end(), 0.0f);
  const double z = ((from + 0.5) * stripe.cos_phi + off_px) / stripe.sigma_px;
  const double d = stripe.cos_phi / stripe.sigma_px;
  double value = std::exp(-0.5 * z * z), factor = std::exp(-z * d - 0.5 * d * d);
  const double change = std::exp(-d * d);
  for (size_t x = begin; x < end; ++x) {
    for (size_t c = 0; c < 3; ++c) row[3 * x + c] = colour_[c] * static_cast<float>(value);
    value *= factor;
    factor *= change;
  }
}

// Along a row the angle rises linearly: each pixel rotates exp(i angle) by the same amount.
void Pattern::rasterise(const Sinusoid& wave, int y_px, std::span<float> row) const {
  const double per_px = 2.0 * std::numbers::pi / wave.period_px;
  const double angle = per_px * (0.5 * wave.cos_phi + (y_px + 0.5) * wave.sin_phi) - wave.phase_rad;
  double re = std::cos(angle), im = std::sin(angle);
  const double turn_re = std::cos(per_px * wave.cos_phi), turn_im = std::sin(per_px * wave.cos_phi);
  for (size_t x = 0; x < static_cast<size_t>(size_.width_px); ++x) {
    for (size_t c = 0; c < 3; ++c) row[3 * x + c] = colour_[c] * static_cast<float>(0.5 * (1.0 + re));
    const double next = re * turn_re - im * turn_im;
    im = re * turn_im + im * turn_re;
    re = next;
  }
}

RadianceImage Pattern::rasterised() const {
  RadianceImage image(size_.width_px, size_.height_px);
  const size_t row = 3 * static_cast<size_t>(size_.width_px);
  for (int y = 0; y < size_.height_px; ++y)
    rasterise(y, std::span(image.samples).subspan(static_cast<size_t>(y) * row, row));
  return image;
}

}  // namespace glasswing
