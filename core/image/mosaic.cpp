#include "core/image/mosaic.h"

#include <fmt/format.h>

#include <algorithm>

namespace glasswing {

absl::StatusOr<Mosaic> Mosaic::parse(std::string_view name) {
  constexpr std::array<std::string_view, 4> kNames{"RGGB", "GRBG", "GBRG", "BGGR"};
  if (std::ranges::find(kNames, name) == kNames.end()) {
    return absl::InvalidArgumentError(fmt::format(
        "the camera's mosaic is \"{}\"; it must be RGGB, GRBG, GBRG or BGGR", name.substr(0, 32)));
  }
  Mosaic mosaic;
  for (size_t i = 0; i < name.size(); ++i)
    mosaic.channels_[i] = static_cast<std::int8_t>(std::string_view("RGB").find(name[i]));
  return mosaic;
}

std::optional<Mosaic> mosaic_of(const v1::Camera& camera) {
  const absl::StatusOr<Mosaic> mosaic = Mosaic::parse(camera.mosaic());
  return mosaic.ok() ? std::optional(*mosaic) : std::nullopt;
}

FrameShape shape_of(const v1::Camera& camera) {
  return {.width_px = camera.width_px(),
          .height_px = camera.height_px(),
          .channels = camera.mosaic().empty() ? 3 : 1};
}

FrameShape shape_of(const Image16& frame) {
  return {.width_px = frame.width_px, .height_px = frame.height_px, .channels = frame.channels};
}

absl::Status check_shape(std::string_view frame, const FrameShape& shape, const FrameShape& of_camera) {
  if (shape == of_camera) return absl::OkStatus();
  const auto described = [](const FrameShape& of) {
    return fmt::format("{}x{} px with {}", of.width_px, of.height_px,
                       of.channels == 1 ? "one channel" : "r, g, b");
  };
  return absl::InvalidArgumentError(
      fmt::format("{} has {}; the camera's frames have {}", frame, described(shape), described(of_camera)));
}

Image16 sampled(const Image16& picture, const Mosaic& mosaic) {
  Image16 frame(picture.width_px, picture.height_px, 1);
  for (int y = 0; y < frame.height_px; ++y) {
    for (int x = 0; x < frame.width_px; ++x) frame.at(x, y, 0) = picture.at(x, y, mosaic.channel(x, y));
  }
  return frame;
}

Image16 interpolated(const Image16& frame, const std::optional<Mosaic>& mosaic) {
  if (frame.channels == 3) return frame;
  Image16 image(frame.width_px, frame.height_px);
  for (int y = 0; y < frame.height_px; ++y) {
    for (int x = 0; x < frame.width_px; ++x) {
      std::array<std::uint32_t, 3> sum{}, count{};
      // The site itself, or else those beside it along x and y, or else those at its corners: in a 2x2
      // pattern only green has sites of two of these kinds, and its own site comes first.
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const int at_x = x + dx, at_y = y + dy;
          if (at_x < 0 || at_y < 0 || at_x >= frame.width_px || at_y >= frame.height_px) continue;
          const size_t c = mosaic ? mosaic->channel(at_x, at_y) : 0;
          const bool own = dx == 0 && dy == 0;
          if (!own && mosaic && static_cast<int>(c) == mosaic->channel(x, y)) continue;
          sum[c] += frame.at(at_x, at_y, 0);
          ++count[c];
        }
      }
      for (size_t c = 0; c < 3; ++c)
        image.at(x, y, static_cast<int>(c)) =
            static_cast<std::uint16_t>(count[c] > 0 ? (sum[c] + count[c] / 2) / count[c] : 0);
    }
  }
  return image;
}

}  // namespace glasswing
