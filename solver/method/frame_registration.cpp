#include "solver/method/frame_registration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

constexpr int kLobes = 5;
constexpr size_t kTaps = 2 * kLobes;
constexpr float kOwn = 0.5f;                  // weight of a sample that the moved one is, for the most part
constexpr std::uint16_t kBrightCode = 63500;  // light that noise may lift to full scale

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

// Whether light beyond full scale is no more than noise there: a sample beside it has nearly as much, and is
// not saturated. What counts as full scale then does no harm to the pixels around.
bool is_barely_saturated(const FrameStack& stack, std::span<const std::uint16_t> samples, int row,
                         size_t at) {
  const size_t row_samples = static_cast<size_t>(stack.width_px) * kChannels,
               own = static_cast<size_t>(row) * row_samples + at;
  const auto is_bright = [&](bool there, size_t other) {
    return there && samples[other] >= kBrightCode && samples[other] < kSaturatedCode;
  };
  return is_bright(at >= kChannels, own - kChannels) ||
         is_bright(at + kChannels < row_samples, own + kChannels) || is_bright(row > 0, own - row_samples) ||
         is_bright(row + 1 < stack.row_count, own + row_samples);
}

// One frame's rows, moved back.
std::vector<std::uint16_t> registered(const FrameStack& stack, std::span<const std::uint16_t> samples,
                                      const FrameCorrection& correction, int first, int count) {
  const auto dx_px = static_cast<double>(correction.dx_px), turn = static_cast<double>(correction.turn_rad);
  const auto width = static_cast<size_t>(stack.width_px), row_samples = width * kChannels;
  std::vector<Kernel> along_y;  // of each column
  for (int x = 0; x < stack.width_px; ++x)
    along_y.push_back(kernel_of(correction.dy_px + turn * (x - dx_px)));
  std::vector<std::uint16_t> moved(static_cast<size_t>(count) * row_samples);
  std::vector<float> column(row_samples);
  std::vector<float> saturated(row_samples);  // weight of what is barely so; infinite: more than that
  for (int y = 0; y < count; ++y) {
    std::ranges::fill(column, 0.0f);
    std::ranges::fill(saturated, 0.0f);
    const Kernel along_x = kernel_of(dx_px - turn * (stack.first_row + first + y));
    for (size_t k = 0; k < kTaps; ++k) {
      const bool beside = k + 1 == kLobes || k == kLobes;
      for (size_t at = 0; at < row_samples; ++at) {
        const Kernel& own = along_y[at / kChannels];
        const int row = std::clamp(first + y + own.first + static_cast<int>(k), 0, stack.row_count - 1);
        const std::uint16_t from = samples[static_cast<size_t>(row) * row_samples + at];
        column[at] += own.weight[k] * static_cast<float>(from);
        if (!beside || own.weight[k] == 0.0f || from < kSaturatedCode) continue;
        const bool barely = is_barely_saturated(stack, samples, row, at);
        saturated[at] = std::max(saturated[at], barely ? own.weight[k] : INFINITY);
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
        full = full || ((k + 1 == kLobes || k == kLobes) && along_x.weight[k] != 0.0f &&
                        along_x.weight[k] * saturated[from] > kOwn);
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

int registration_reach(const FrameCorrections* corrections, int width_px) {
  if (corrections == nullptr) return 0;
  int reach = 0;
  for (const FrameCorrection& own : corrections->of_frame) {
    if (!own.is_moved()) continue;
    const float left = own.dy_px - own.turn_rad * own.dx_px,
                right = left + own.turn_rad * static_cast<float>(width_px);
    const float most = std::max(std::abs(left), std::abs(right));
    reach = std::max(reach, static_cast<int>(std::ceil(most)) + kLobes);
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
