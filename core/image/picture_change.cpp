#include "core/image/picture_change.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/base/median.h"

namespace glasswing {
namespace {

constexpr int kMaxSide = 320;   // blocks
constexpr double kSigma = 1.5;  // of the smoothing, blocks: steps of some blocks are found by their slopes
constexpr int kSmoothed = 9, kEdge = 6;  // blocks; kEdge are left out around the picture
constexpr double kCut = 4.0;             // standard deviations, of Tukey's biweight
constexpr double kMinKnown = 0.4;        // of the pixels
constexpr double kPriorSd = 3.0;         // of shifts along which nothing is seen, blocks
constexpr double kPerMille = 0.001;

// What a fit allows a sample to be off by, besides noise; it narrows round by round.
struct Allowance {
  double light, shift;  // of the range of light, and blocks
};
constexpr std::array<Allowance, 9> kRounds{{{0.3, 2.0},
                                            {0.1, 1.0},
                                            {0.05, 0.5},
                                            {0.02, 0.3},
                                            {0.01, 0.2},
                                            {0.005, 0.1},
                                            {0.003, 0.05},
                                            {0.002, 0.05},
                                            {0.002, 0.05}}};

struct Seen {
  double light, by_x, by_y;
};

// From the reference where the frame's block (x, y) saw it before the shift.
Seen seen_at(const Brightness& picture, double x, double y) {
  const int left = std::clamp(static_cast<int>(std::floor(x)), 1, picture.width - 3);
  const int top = std::clamp(static_cast<int>(std::floor(y)), 1, picture.height - 3);
  const double right = x - left, down = y - top;
  const auto at = [&](int i, int j) { return static_cast<double>(picture.samples[j * picture.width + i]); };
  Seen seen{};
  for (const int j : {0, 1}) {
    for (const int i : {0, 1}) {
      const double weight = (i == 0 ? 1.0 - right : right) * (j == 0 ? 1.0 - down : down);
      const int u = left + i, v = top + j;
      seen.light += weight * at(u, v);
      seen.by_x += weight * 0.5 * (at(u + 1, v) - at(u - 1, v));
      seen.by_y += weight * 0.5 * (at(u, v + 1) - at(u, v - 1));
    }
  }
  return seen;
}

double range_of(const Brightness& picture) {
  std::vector<float> sorted = picture.samples;
  std::ranges::sort(sorted);
  const size_t part = sorted.size() / 50;
  return static_cast<double>(sorted[sorted.size() - 1 - part] - sorted[part]);
}

// Unknowns are gain, offset, dx and dy, in the range of light and blocks.
using Unknowns = Eigen::Vector4d;

struct Fit {
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Unknowns right = Unknowns::Zero();
  std::vector<float> rests;  // of samples that count
  size_t seen = 0;
};

Fit fit_at(const Brightness& reference, const Brightness& frame, const Unknowns& at, double noise,
           const Allowance& allowance, double range) {
  Fit fit;
  for (int y = kEdge; y < frame.height - kEdge; ++y) {
    for (int x = kEdge; x < frame.width - kEdge; ++x) {
      const Seen seen = seen_at(reference, x - at[2], y - at[3]);
      const double rest = frame.samples[y * frame.width + x] - at[1] - at[0] * seen.light;
      const double steep = allowance.shift * std::hypot(seen.by_x, seen.by_y);
      const double light = allowance.light * range;
      const double variance = noise * noise + light * light + steep * steep;
      ++fit.seen;
      const double z2 = rest * rest / variance;
      if (!(z2 < kCut * kCut)) continue;
      const double part = 1.0 - z2 / (kCut * kCut), weight = part * part / variance;
      const Unknowns by(seen.light, 1.0, -at[0] * seen.by_x, -at[0] * seen.by_y);
      fit.normal.noalias() += weight * by * by.transpose();
      fit.right.noalias() += weight * rest * by;
      fit.rests.push_back(static_cast<float>(std::abs(rest)));
    }
  }
  return fit;
}

}  // namespace

Brightness brightness_of(const Image16& frame) {
  const int mosaic_step = frame.channels == 1 ? 2 : 1;
  Brightness picture;
  while (std::max(frame.width_px, frame.height_px) / picture.block_px > kMaxSide ||
         picture.block_px < mosaic_step)
    picture.block_px += mosaic_step;
  if (picture.block_px % mosaic_step != 0) ++picture.block_px;
  const int side = picture.block_px;
  picture.width = frame.width_px / side;
  picture.height = frame.height_px / side;
  picture.samples.resize(static_cast<size_t>(picture.width) * picture.height);
  const auto row_samples = static_cast<size_t>(frame.width_px) * frame.channels;
  const auto block_samples = static_cast<size_t>(side) * frame.channels;
  const float scale = 1.0f / (65535.0f * static_cast<float>(side) * static_cast<float>(block_samples));
  for (int y = 0; y < picture.height * side; ++y) {
    const std::uint16_t* row = frame.samples.data() + static_cast<size_t>(y) * row_samples;
    float* const out = picture.samples.data() + static_cast<size_t>(y / side) * picture.width;
    for (int x = 0; x < picture.width; ++x) {
      std::uint32_t sum = 0;
      for (size_t k = 0; k < block_samples; ++k) sum += *row++;
      out[x] += scale * static_cast<float>(sum);
    }
  }
  cv::Mat samples(picture.height, picture.width, CV_32F, picture.samples.data());
  cv::GaussianBlur(samples, samples, {kSmoothed, kSmoothed}, kSigma, kSigma, cv::BORDER_REPLICATE);
  return picture;
}

PictureChange change_between(const Brightness& reference, const Brightness& frame) {
  assert(reference.width == frame.width && reference.height == frame.height);
  PictureChange change;
  if (frame.width < 3 * kEdge || frame.height < 3 * kEdge) return change;
  const double range = range_of(reference);
  if (!(range > kPerMille)) return change;
  Unknowns at(1.0, 0.0, 0.0, 0.0);
  const Unknowns expected = at;
  const Unknowns prior(1.0, 1.0, 1.0 / (kPriorSd * kPriorSd), 1.0 / (kPriorSd * kPriorSd));
  double noise = kPerMille * range;
  Eigen::Matrix4d inverse = Eigen::Matrix4d::Identity();
  for (const Allowance& allowance : kRounds) {
    Fit fit = fit_at(reference, frame, at, noise, allowance, range);
    change.known = static_cast<double>(fit.rests.size()) > kMinKnown * static_cast<double>(fit.seen);
    if (!change.known) return change;
    fit.normal.diagonal() += prior;
    fit.right -= prior.cwiseProduct(at - expected);
    const Eigen::LDLT<Eigen::Matrix4d> solver(fit.normal);
    at += solver.solve(fit.right);
    at[2] = std::clamp(at[2], -0.9 * kEdge, 0.9 * kEdge);
    at[3] = std::clamp(at[3], -0.9 * kEdge, 0.9 * kEdge);
    inverse = solver.solve(Eigen::Matrix4d::Identity());
    noise = std::max(1.5 * median_in_place(std::span<float>(fit.rests)), 1e-6);
  }
  // Smoothing correlates the errors of blocks within its width.
  const double alike = 2.0 * kSigma * std::sqrt(M_PI);
  const auto sd_of = [&](int i) { return alike * std::sqrt(inverse(i, i)); };
  change.gain = at[0];
  change.gain_sd = sd_of(0);
  change.offset = at[1] / range;
  change.offset_sd = sd_of(1) / range;
  change.dx_px = frame.block_px * at[2];
  change.dy_px = frame.block_px * at[3];
  change.dx_sd_px = frame.block_px * sd_of(2);
  change.dy_sd_px = frame.block_px * sd_of(3);
  return change;
}

}  // namespace glasswing
