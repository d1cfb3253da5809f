// The response of a footprint to the patterns of a monitor (pattern_answer.h), in lanes of float: sinusoids
// and stripes are computed together. Areas, and stripes and points that are clipped by an edge of the
// monitor, come from core/footprint one by one.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/footprint/cut_footprint.h"
#include "core/footprint/pattern_answer.h"

namespace glasswing {

namespace internal {

struct WaveLanes {
  const double *by_x, *by_y, *from;
  const float *xx, *xy, *yy, *own_px2, *height, *fx, *fy;
};

}  // namespace internal

class PatternLanes {
 public:
  static constexpr size_t kPad = 8;
  static constexpr size_t kColumns = PatternAnswers::kColumns;

  // Keeps a reference.
  explicit PatternLanes(const PatternAnswers& answers);

  const PatternAnswers& answers() const { return answers_; }
  size_t pattern_count() const { return static_cast<size_t>(answers_.size()); }
  // Of a column, padding included; a pattern's place in it; and that of black, to which nothing responds.
  size_t size() const { return size_; }
  size_t lane(size_t pattern) const { return lane_[pattern]; }
  size_t black_lane() const { return black_lane_; }

  // kColumns columns of size() numbers: PatternAnswers::of(), times `scale` by lane. Lanes without a pattern
  // must have scale 0.
  void answer(const Footprint& mode, bool through_pixels, const float* scale, float* columns) const;

 private:
  internal::WaveLanes lanes() const;
  // `share_of(lit)`: NormalShare of the footprint.
  template <typename ShareOf>
  void answer_areas(const ShareOf& share_of, const Footprint& mode, const float* scale, float* columns) const;
  // Of waves whose clipped responses may be computed in lanes; others are few.
  bool cut_in_lanes(const Footprint& mode) const;
  void answer_cut(const Footprint& mode, bool through_pixels, const float* scale, float* columns) const;

  const PatternAnswers& answers_;
  std::vector<size_t> lane_, areas_;  // areas_: their patterns
  double most_turn_ = 0.0;            // |wx wy| of a wave, at most
  size_t wave_end_ = 0, stripe_end_ = 0, size_ = 0, black_lane_ = 0;
  // By lane of waves and stripes. The argument of a wave in turns and of a stripe in px is by_x x + by_y y -
  // from; its variance by the footprint's is xx, xy and yy, in addition to that of the stripe itself.
  // `height` of a wave is half of sinc(fx) sinc(fy), of a stripe sigma_s.
  std::vector<double> by_x_, by_y_, from_;
  std::vector<float> xx_, xy_, yy_, own_px2_, height_, fx_, fy_;
};

namespace internal {

// How a footprint's centre and variance, as pixels show them, change with its own.
struct SeenSlopes {
  float centre_by_centre_x = 1.0f, centre_by_variance_x = 0.0f, variance_by_centre_x = 0.0f,
        variance_by_variance_x = 1.0f;
  float centre_by_centre_y = 1.0f, centre_by_variance_y = 0.0f, variance_by_centre_y = 0.0f,
        variance_by_variance_y = 1.0f;
};
void answer_waves(const WaveLanes& lanes, const Footprint& seen, const SeenSlopes& slopes, size_t begin,
                  size_t end, size_t size, const float* scale, float* columns);
void answer_stripes(const WaveLanes& lanes, const Footprint& seen, const SeenSlopes& slopes, size_t begin,
                    size_t end, size_t size, const float* scale, float* columns);

// Of waves from lane 0, for which an edge of the monitor clips the footprint. `level`: H(0) of weight 1.
void answer_cut_waves(const WaveLanes& lanes, const Footprint& mode, const MonitorExtent& extent,
                      const NormalShare& level, size_t end, size_t size, const float* scale, float* columns);
// Of a narrow footprint, partly seen by these pixels.
void answer_reached_waves(const WaveLanes& lanes, double weight, std::span<const ReachedPixel> pixels,
                          const NormalShare& level, size_t end, size_t size, const float* scale,
                          float* columns);

// Takes from each column its part along `root`, whose square sum is `information`.
void centre(const float* root, double information, std::span<float* const> columns, size_t size);
// The products of all pairs of columns: the lower triangle, by rows.
void multiply(std::span<float* const> columns, size_t size, float* products);
float dot(const float* a, const float* b, size_t size);

// Footprints side by side: answers[sample][footprint], `stride` footprints, a multiple of kTogether.
inline constexpr size_t kTogether = 4 * PatternLanes::kPad;
// Sums over samples of wanted * answer.
void correlate(const float* answers, std::span<const float> wanted, size_t stride, float* by_footprint);
// Of first * answer and of second * answer^2.
void weigh(const float* answers, std::span<const float> first, std::span<const float> second, size_t stride,
           float* sums, float* squares);

}  // namespace internal

}  // namespace glasswing
