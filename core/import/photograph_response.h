// The response of an imported photograph: code to light, both in [0, 1], by name:
//
//   linear    light = u            u = (code - black) / (1 - black)
//   gamma:G   light = u^G
//   srgb      light as in IEC 61966-2-1 of u
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <vector>

#include "core/image/image.h"

namespace glasswing {

class PhotographResponse {
 public:
  // INVALID_ARGUMENT: an unknown name, G outside [0.2, 5], or a black outside [0, 1).
  static absl::StatusOr<PhotographResponse> create(const std::string& name, double black);

  // Codes to linear samples, 65535 = 1.0.
  void linearise(Image16& image) const;

 private:
  explicit PhotographResponse(std::vector<std::uint16_t> light) : light_(std::move(light)) {}
  std::vector<std::uint16_t> light_;  // by code
};

}  // namespace glasswing
