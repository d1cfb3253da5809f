// How the primaries of a session's monitors reach its camera's channels, and back:
//
//   seen_c = sum over primaries p of N_cp light_p
//
// N is a monitor's crosstalk with each row divided by its sum, the camera's response to white, so white keeps
// its brightness in every channel. An object acts on the light seen by each camera channel: glass refracts
// red and green differently. So a matte's channels are those of the camera: backgrounds are multiplied by N
// before compositing, and the composite is converted back to primaries by the inverse of the monitors' mean
// N.
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

  // INVALID_ARGUMENT: invalid crosstalk, or crosstalk that hardly separates the primaries.
  static absl::StatusOr<PrimaryMix> create(const v1::CaptureManifest& manifest);
  static absl::StatusOr<PrimaryMix> create(const v1::MatteMetadata& metadata);

  // True if no monitor is calibrated: channels equal primaries.
  bool is_unit() const { return matrices_.empty(); }
  // Converts light of a monitor's primaries to the camera's channels; `texture` is the monitor's index in the
  // manifest.
  Light seen(int texture, const Light& primaries) const;
  Light primaries(const Light& seen) const;
  // The largest deviation of a monitor's N from the mean.
  double spread() const { return spread_; }

  // Writes the crosstalk that create() reads.
  void describe(v1::MatteMetadata& metadata) const;

 private:
  using Matrix = std::array<std::array<double, 3>, 3>;
  static absl::StatusOr<PrimaryMix> create(std::vector<Matrix> matrices, const std::vector<bool>& known);

  std::vector<Matrix> matrices_;  // N by texture; none if all are unit
  Matrix inverse_{};              // of the mean of the known ones
  double spread_ = 0.0;
};

}  // namespace glasswing
