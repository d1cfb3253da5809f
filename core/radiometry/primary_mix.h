// How the primaries of a session's monitors reach its camera's channels, and back:
//
//   seen_c = sum over primaries p of N_cp light_p
//
// N is a monitor's crosstalk, each row divided by its sum, the camera's answer to white: white keeps its
// brightness in every channel. What an object does to light it does to what each camera channel sees: glass
// bends red and green differently, and no channel of one place is mixed with another's. So a matte's channels
// are the camera's. Its backgrounds go through N before they are composited, and the composite is taken back
// to primaries by the inverse of the monitors' mean N.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <string>
#include <vector>

#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/matte.pb.h"

namespace glasswing {

class PrimaryMix {
 public:
  using Light = std::array<float, 3>;

  // INVALID_ARGUMENT: crosstalk that cannot be one, or that hardly tells primaries apart.
  static absl::StatusOr<PrimaryMix> create(const v1::CaptureManifest& manifest);
  static absl::StatusOr<PrimaryMix> create(const v1::MatteMetadata& metadata);

  // No monitor is calibrated: channels and primaries are the same.
  bool is_unit() const { return matrices_.empty(); }
  // Of light of a monitor's primaries (its place in the manifest), what the camera's channels see.
  Light seen(int texture, const Light& primaries) const;
  Light primaries(const Light& seen) const;
  // The largest difference of a monitor's N from the mean.
  double spread() const { return spread_; }

  // For create().
  void describe(v1::MatteMetadata& metadata) const;

 private:
  using Matrix = std::array<std::array<double, 3>, 3>;
  static absl::StatusOr<PrimaryMix> create(std::vector<Matrix> matrices, const std::vector<bool>& known);

  std::vector<Matrix> matrices_;  // N by texture; none if all are unit
  Matrix inverse_{};              // of the mean of those that are known
  double spread_ = 0.0;
};

}  // namespace glasswing
