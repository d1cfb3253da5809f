#include "core/import/photograph_response.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/scanner.h"
#include "core/image/image_file.h"

namespace glasswing {

absl::StatusOr<PhotographResponse> PhotographResponse::create(const std::string& name, double black) {
  constexpr double kMinGamma = 0.2, kMaxGamma = 5.0;
  double gamma = 1.0;
  const bool power =
      Scanner(name).then("gamma:").number(gamma).done() && gamma >= kMinGamma && gamma <= kMaxGamma;
  if (!power && name != "linear" && name != "srgb") {
    return absl::InvalidArgumentError(
        fmt::format("response is \"{}\"; it must be linear, srgb, or gamma:G with G {} to {}", name,
                    kMinGamma, kMaxGamma));
  }
  if (!(black >= 0.0 && black < 1.0)) {
    return absl::InvalidArgumentError(
        fmt::format("black is {} of the highest code; it must be 0 or more, and below 1", black));
  }
  std::vector<std::uint16_t> light(65536);
  for (size_t code = 0; code < light.size(); ++code) {
    const double share = std::max(0.0, (static_cast<double>(code) / 65535.0 - black) / (1.0 - black));
    light[code] = code16_of(name == "srgb" ? linear_of_srgb(static_cast<float>(share))
                                           : static_cast<float>(std::pow(share, power ? gamma : 1.0)));
  }
  return PhotographResponse(std::move(light));
}

void PhotographResponse::linearise(Image16& image) const {
  for (std::uint16_t& sample : image.samples) sample = light_[sample];
}

}  // namespace glasswing
