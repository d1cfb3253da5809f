// A matte as a matrix: how much of the light of each pixel of the monitors reaches each pixel of the camera,
//
//   C_i = F_i + sum_j A_ij T_j      A_ij = sum_k R_k \int_pixel j G(x; c_k, Sigma_k) dx
//
// in one of the camera's channels. Composites of the exact compositor (core/composite/compositor.h) are this
// sum. The transpose gives the picture that a camera at the monitors would take while the camera's place
// shines: light goes the same way back (Helmholtz; Sen et al. 2005 call it dual photography).
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "core/footprint/matte_covariance.h"
#include "core/image/image.h"
#include "core/matte/matte.h"

namespace glasswing {

// Compressed sparse rows: of row i, entries [starts[i], starts[i + 1]), columns ascending.
struct TransportMatrix {
  std::int64_t row_count = 0, column_count = 0;
  std::vector<std::int64_t> starts = {};
  std::vector<std::int32_t> columns = {};
  std::vector<float> values = {};
  // Standard errors due to the frames' noise, 0: not known; empty: none is.
  std::vector<float> errors = {};
};

class MatteTransport {
 public:
  // Of a row, the smallest entries are left out that together hold at most this part of it: a composite
  // changes by no more than this part of the brightest light.
  static constexpr double kLeftOut = 1e-5;

  // `matte` must outlive it. INVALID_ARGUMENT: its monitors have more pixels than a matrix has columns.
  static absl::StatusOr<MatteTransport> create(const Matte& matte);

  // The column of a monitor's first pixel; the others follow row by row, then those of the next monitor.
  std::int64_t first_column(int texture) const { return first_columns_[texture]; }
  std::int64_t column_count() const { return first_columns_.back(); }
  // Standard errors come from the covariance of all modes of a pixel's channel, if the matte records how it
  // was sampled (matte_covariance.h); otherwise from the modes' own of weight and centre, without those of
  // widths and without correlations. Boxes have none, nor do pyramids then.
  bool has_covariance() const { return covariance_.has_value(); }

  // Rows are the camera's pixels, row by row. `thread_count` and `progress` as in composite().
  // RESOURCE_EXHAUSTED: more than kMaxEntries.
  absl::StatusOr<TransportMatrix> matrix(int channel, bool errors, int thread_count = 0,
                                         const std::function<void(double)>& progress = nullptr) const;
  static constexpr std::int64_t kMaxEntries = std::int64_t{1} << 32;

 private:
  explicit MatteTransport(const Matte& matte) : matte_(matte) {}
  class Row;
  const Matte& matte_;
  std::vector<std::int64_t> first_columns_;
  std::optional<MatteCovariance> covariance_;
};

// The transpose of all of a composite but F, crosstalk included: what a camera at monitor `texture` would see
// while the camera shines this picture, of the matte's size, times the monitor's pixels per camera pixel, so
// that an empty stage that fills the camera's picture is about as bright as `shone`.
// INVALID_ARGUMENT: `shone` has another size, or the matte's crosstalk is invalid.
absl::StatusOr<RadianceImage> composite_from_monitor(const Matte& matte, int texture,
                                                     const RadianceImage& shone, int thread_count = 0);

// Where on a monitor a pixel's light comes from, as a picture of the monitor's size: the share of each of its
// pixels in the light of matte pixel (x, y), counted from the tile's corner, by channel; Gaussians, boxes and
// pyramids alike. Sums to the weights, less what lies beyond the monitor's edge.
RadianceImage footprint_picture(const Matte& matte, int x, int y, int texture);

}  // namespace glasswing
