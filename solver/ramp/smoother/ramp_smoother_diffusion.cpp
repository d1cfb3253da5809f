#include "solver/ramp/smoother/ramp_smoother_diffusion.h"

#include <array>
#include <cmath>
#include <vector>

#include "core/base/for_rows.h"

namespace glasswing {
namespace {

constexpr float kLambda = 1.0f / 6.0f;  // the largest stable value for six neighbours

class Diffuser {
 public:
  Diffuser(std::span<const RampFrame* const> frames, const Diffusion& diffusion)
      : frames_(frames),
        diffusion_(diffusion),
        width_(static_cast<size_t>(frames[0]->width_px)),
        height_(frames[0]->height_px) {
    for (const RampFrame* frame : frames) now_.push_back({frame->x_px, frame->y_px});
    next_ = now_;
  }

  void step(int thread_count) {
    for (size_t t = 0; t < frames_.size(); ++t) {
      for_rows(height_, thread_count, [&](int first, int last) {
        for (int y = first; y < last; ++y) step_row(t, y);
      });
    }
    std::swap(now_, next_);
  }

  const std::array<std::vector<float>, 2>& c(size_t t) const { return now_[t]; }

 private:
  float flow(float difference) const {
    const float share = difference / diffusion_.contrast_px, square = share * share;
    return difference * (diffusion_.exponential ? std::exp(-square) : 1.0f / (1.0f + square));
  }

  void step_row(size_t t, int y) {
    const size_t row = static_cast<size_t>(y) * width_;
    for (size_t x = 0; x < width_; ++x) {
      const size_t i = row + x;
      if (frames_[t]->alpha[i] <= 0.0f) continue;
      std::array<float, 2> sum{};
      const auto join = [&](size_t other, size_t j) {
        if (frames_[other]->alpha[j] <= 0.0f) return;
        for (size_t k = 0; k < 2; ++k) sum[k] += flow(now_[other][k][j] - now_[t][k][i]);
      };
      if (x > 0) join(t, i - 1);
      if (x + 1 < width_) join(t, i + 1);
      if (y > 0) join(t, i - width_);
      if (y + 1 < height_) join(t, i + width_);
      if (t > 0) join(t - 1, i);
      if (t + 1 < frames_.size()) join(t + 1, i);
      for (size_t k = 0; k < 2; ++k) next_[t][k][i] = now_[t][k][i] + kLambda * sum[k];
    }
  }

  const std::span<const RampFrame* const> frames_;
  const Diffusion diffusion_;
  const size_t width_;
  const int height_;
  std::vector<std::array<std::vector<float>, 2>> now_, next_;  // c_x and c_y of each frame
};

}  // namespace

void diffuse(std::span<const RampFrame* const> frames, size_t at, const Diffusion& diffusion,
             int thread_count, RampFrame& result) {
  Diffuser diffuser(frames, diffusion);
  for (int i = 0; i < diffusion.iterations; ++i) diffuser.step(thread_count);
  result.x_px = diffuser.c(at)[0];
  result.y_px = diffuser.c(at)[1];
}

}  // namespace glasswing
