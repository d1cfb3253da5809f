#include "core/matte/matte_region.h"

#include <fmt/format.h>

#include <array>
#include <charconv>

namespace glasswing {
namespace {

std::string text_of(const MatteRegion& region) {
  return fmt::format("{}x{}+{}+{}", region.width_px, region.height_px, region.x_px, region.y_px);
}

}  // namespace

absl::StatusOr<MatteRegion> parse_region(std::string_view text) {
  MatteRegion region;
  const std::array<int*, 4> numbers{&region.width_px, &region.height_px, &region.x_px, &region.y_px};
  constexpr std::string_view kBetween = "x++";
  const char* at = text.data();
  const char* const end = at + text.size();
  bool good = true;
  for (size_t i = 0; i < numbers.size() && good; ++i) {
    const auto [after, error] = std::from_chars(at, end, *numbers[i]);
    good = error == std::errc() && *numbers[i] >= (i < 2 ? 1 : 0) &&
           (i < kBetween.size() ? after != end && *after == kBetween[i] : after == end);
    at = i < kBetween.size() ? after + 1 : after;
  }
  if (good) return region;
  return absl::InvalidArgumentError(
      fmt::format("the region is \"{}\"; it must be WIDTHxHEIGHT+X+Y, such as 640x480+100+50", text));
}

absl::Status check_region(const MatteRegion& region, int width_px, int height_px) {
  if (region.width_px > 0 && region.height_px > 0 && region.x_px >= 0 && region.y_px >= 0 &&
      region.x_px <= width_px - region.width_px && region.y_px <= height_px - region.height_px)
    return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("the region is {}; it must have pixels and be within the picture, which is {}x{}",
                  text_of(region), width_px, height_px));
}

int sampling_step(int width_px, int height_px, std::int64_t max_pixels) {
  if (max_pixels <= 0) return 1;
  int step = 1;
  while (std::int64_t{sampled_length(width_px, step)} * sampled_length(height_px, step) > max_pixels) ++step;
  return step;
}

}  // namespace glasswing
