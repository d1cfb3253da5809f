#include "compositing/picture/picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>

#include "core/base/scanner.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"
#include "core/frame/archive.h"
#include "core/import/foreign_manifest.h"
#include "core/radiometry/frame_light.h"
#include "core/radiometry/primary_mix.h"
#include "core/radiometry/shading.h"

namespace glasswing {

void print_written(const CommandLine& command_line, const std::string& file, int width_px, int height_px) {
  if (command_line.json) {
    const nlohmann::ordered_json written = {{"file", file}, {"width_px", width_px}, {"height_px", height_px}};
    std::cout << written.dump(1) << "\n";
  } else {
    std::cout << fmt::format("{}: {}x{}\n", file, width_px, height_px);
  }
}

absl::Status check_output(const std::filesystem::path& output, int bits) {
  GW_RETURN_IF_ERROR(check_output_file(output, {".exr", ".png", ".tif", ".tiff"}));
  return check_picture_file(output, bits);
}

void tell_layer(const std::filesystem::path& file) {
  const std::string layer = layer_of_file(file);
  if (!layer.empty()) std::cerr << fmt::format("{}: {} is taken\n", file.string(), layer);
}

absl::Status in_file(const std::string& file, const absl::Status& status) {
  if (status.ok()) return status;
  return absl::Status(status.code(), fmt::format("{}: {}", file, std::string(status.message())));
}

absl::StatusOr<CapturedPicture> read_picture(const std::filesystem::path& file, const PictureColours& colours,
                                             Encoding encoding) {
  const std::filesystem::path archive = file.parent_path().parent_path();
  const std::string name = (file.parent_path().filename() / file.filename()).string();
  const auto plain = [&]() -> absl::StatusOr<CapturedPicture> {
    GW_ASSIGN_OR_RETURN(RadianceImage picture, colours.read(file, encoding));
    tell_layer(file);
    return CapturedPicture{std::move(picture),
                           colours.reads() ? linear_rec709() : colour_of_file(file, encoding)};
  };
  if (!std::filesystem::exists(archive / "manifest.json")) return plain();
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, read_any_manifest(archive));
  if (std::ranges::none_of(manifest.frames(), [&](const v1::Frame& frame) { return frame.file() == name; }))
    return plain();
  if (colours.reads()) {
    return absl::InvalidArgumentError(
        fmt::format("{} is a frame of an archive, whose colours are the camera's; --ocio-in is for other "
                    "pictures",
                    file.string()));
  }
  GW_ASSIGN_OR_RETURN(const FrameLight light, FrameLight::create(manifest));
  GW_ASSIGN_OR_RETURN(const PrimaryMix mix, PrimaryMix::create(manifest));
  const PictureColour colour = mix.is_unit() ? PictureColour() : linear_rec709();
  const std::optional<Mosaic> mosaic = mosaic_of(manifest.camera());
  if (light.is_identity() && mix.is_unit() && !mosaic) {
    GW_ASSIGN_OR_RETURN(RadianceImage picture, read_radiance(file, encoding));
    return CapturedPicture{std::move(picture), colour};
  }
  GW_ASSIGN_OR_RETURN(const Shading shading, Shading::create(manifest));
  GW_ASSIGN_OR_RETURN(const Image16 stored, read_frame_file(file, shape_of(manifest.camera())));
  const Image16 frame = interpolated(stored, mosaic);
  RadianceImage picture(frame.width_px, frame.height_px);
  for (int y = 0; y < frame.height_px; ++y) {
    for (int x = 0; x < frame.width_px; ++x) {
      const auto left = static_cast<float>(shading.camera(x, y));
      PrimaryMix::Light seen{};
      for (int c = 0; c < 3; ++c) seen[c] = light.light(frame.at(x, y, c), c) / left;
      const PrimaryMix::Light primaries = mix.primaries(seen);
      for (int c = 0; c < 3; ++c) picture.at(x, y, c) = primaries[c];
    }
  }
  return CapturedPicture{std::move(picture), colour};
}

absl::StatusOr<RadianceImage> read_picture(const std::filesystem::path& file, Encoding encoding) {
  GW_ASSIGN_OR_RETURN(CapturedPicture picture, read_picture(file, PictureColours(), encoding));
  return std::move(picture.light);
}

absl::StatusOr<RadianceImage> cropped(const RadianceImage& picture, const std::string& region) {
  if (region.empty()) return picture;
  int width = 0, height = 0, left = 0, top = 0;
  Scanner scan(region);
  scan.number(width).then("x").number(height);
  const bool parsed = scan.then("+").number(left).then("+").number(top).done();
  const bool inside = parsed && width > 0 && height > 0 && left >= 0 && top >= 0 &&
                      left <= picture.width_px - width && top <= picture.height_px - height;
  if (!inside) {
    return absl::InvalidArgumentError(
        fmt::format("--crop is {}; it must be WIDTHxHEIGHT+X+Y and lie within the picture, which is {}x{}",
                    region, picture.width_px, picture.height_px));
  }
  RadianceImage part(width, height, picture.channels);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < part.channels; ++c) part.at(x, y, c) = picture.at(left + x, top + y, c);
    }
  }
  return part;
}

RadianceImage shifted(const RadianceImage& picture, double dx_px, double dy_px, bool wraps) {
  // For each column or row: the two source indices, and the weight of the second.
  struct Parts {
    std::vector<int> first, second;
    float part;
  };
  const auto parts_of = [wraps](double shift, int extent) {
    const double whole = std::floor(shift);
    const int away =
        static_cast<int>(wraps ? std::fmod(whole, extent) : std::clamp(whole, -1.0 * extent, 1.0 * extent));
    const auto inside = [&](int i) {
      return wraps ? (i + 2 * extent) % extent : std::clamp(i, 0, extent - 1);
    };
    Parts parts{.first = {}, .second = {}, .part = static_cast<float>(shift - whole)};
    for (int i = 0; i < extent; ++i) {
      parts.first.push_back(inside(i - away));
      parts.second.push_back(inside(i - away - 1));
    }
    return parts;
  };
  const Parts across = parts_of(dx_px, picture.width_px), down = parts_of(dy_px, picture.height_px);
  RadianceImage out(picture.width_px, picture.height_px);
  for (int y = 0; y < out.height_px; ++y) {
    const size_t row = y;
    for (int x = 0; x < out.width_px; ++x) {
      const size_t column = x;
      for (int c = 0; c < 3; ++c) {
        const auto along = [&](int from) {
          return (1.0f - across.part) * picture.at(across.first[column], from, c) +
                 across.part * picture.at(across.second[column], from, c);
        };
        out.at(x, y, c) = down.part == 0.0f ? along(down.first[row])
                                            : (1.0f - down.part) * along(down.first[row]) +
                                                  down.part * along(down.second[row]);
      }
    }
  }
  return out;
}

}  // namespace glasswing
