#include "solver/method/frame_registration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

constexpr int kLobes = 5;
constexpr size_t kTaps = 2 * kLobes;

// Samples at `first`, first + 1, ... from a pixel's own.
struct Kernel {
  int first = 0;
  std::array<float, kTaps> weight{};
};

double lanczos(double x) {
  const double t = std::numbers::pi * x;
  return t == 0.0 ? 1.0 : std::sin(t) / t * std::sin(t / kLobes) / (t / kLobes);
}

Kernel kernel_of(double shift_px) {
  Kernel kernel{.first = static_cast<int>(std::floor(shift_px)) - kLobes + 1};
  float sum = 0.0f;
  for (size_t k = 0; k < kTaps; ++k) {
    kernel.weight[k] = static_cast<float>(lanczos(kernel.first + static_cast<double>(k) - shift_px));
    sum += kernel.weight[k];
  }
  for (float& weight : kernel.weight) weight /= sum;
  return kernel;
}

// One frame's rows, moved back.
std::vector<std::uint16_t> registered(const FrameStack& stack, std::span<const std::uint16_t> samples,
                                      const FrameCorrection& correction, int first, int count) {
  const Kernel along_x = kernel_of(static_cast<double>(correction.dx_px)),
               along_y = kernel_of(static_cast<double>(correction.dy_px));
  const auto width = static_cast<size_t>(stack.width_px), row_samples = width * kChannels;
  std::vector<std::uint16_t> moved(static_cast<size_t>(count) * row_samples);
  std::vector<float> column(row_samples);
  std::vector<bool> saturated(row_samples);
  for (int y = 0; y < count; ++y) {
    std::ranges::fill(column, 0.0f);
    std::fill(saturated.begin(), saturated.end(), false);
    for (size_t k = 0; k < kTaps; ++k) {
      const int row = std::clamp(first + y + along_y.first + static_cast<int>(k), 0, stack.row_count - 1);
      const std::uint16_t* const from = samples.data() + static_cast<size_t>(row) * row_samples;
      const bool beside = k + 1 == kLobes || k == kLobes;
      for (size_t at = 0; at < row_samples; ++at) {
        column[at] += along_y.weight[k] * static_cast<float>(from[at]);
        if (beside && along_y.weight[k] != 0.0f && from[at] >= kSaturatedCode) saturated[at] = true;
      }
    }
    for (size_t at = 0; at < row_samples; ++at) {
      const auto x = static_cast<int>(at / kChannels);
      float sum = 0.0f;
      bool full = false;
      for (size_t k = 0; k < kTaps; ++k) {
        const int column_x = std::clamp(x + along_x.first + static_cast<int>(k), 0, stack.width_px - 1);
        const size_t from = static_cast<size_t>(column_x) * kChannels + at % kChannels;
        sum += along_x.weight[k] * column[from];
        full = full || ((k + 1 == kLobes || k == kLobes) && along_x.weight[k] != 0.0f && saturated[from]);
      }
      moved[static_cast<size_t>(y) * row_samples + at] =
          full ? std::uint16_t{65535}
               : static_cast<std::uint16_t>(
                     std::clamp(sum + 0.5f, 0.0f, static_cast<float>(kSaturatedCode - 1)));
    }
  }
  return moved;
}

struct Moved {
  std::shared_ptr<const void> source;
  std::vector<std::vector<std::uint16_t>> frames;
};

}  // namespace

int registration_reach(const FrameCorrections* corrections) {
  if (corrections == nullptr) return 0;
  int reach = 0;
  for (const FrameCorrection& own : corrections->of_frame) {
    if (own.is_moved()) reach = std::max(reach, static_cast<int>(std::ceil(std::abs(own.dy_px))) + kLobes);
  }
  return reach;
}

FrameStack registered_rows(const FrameStack& stack, const FrameCorrections& corrections, int first,
                           int count) {
  FrameStack rows = stack;
  rows.first_row += first;
  rows.row_count = count;
  const auto owned = std::make_shared<Moved>();
  owned->source = stack.owner;
  owned->frames.resize(stack.rows.size());
  const size_t row_samples = static_cast<size_t>(stack.width_px) * kChannels;
  for (size_t f = 0; f < stack.rows.size(); ++f) {
    if (stack.rows[f].empty()) continue;
    if (!corrections.of_frame[f].is_moved()) {
      rows.rows[f] = stack.rows[f].subspan(static_cast<size_t>(first) * row_samples,
                                           static_cast<size_t>(count) * row_samples);
      continue;
    }
    owned->frames[f] = registered(stack, stack.rows[f], corrections.of_frame[f], first, count);
    rows.rows[f] = owned->frames[f];
  }
  rows.owner = owned;
  return rows;
}

}  // namespace glasswing
