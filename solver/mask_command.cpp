#include "solver/mask_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <iostream>
#include <memory>
#include <string>

#include "core/base/status.h"
#include "core/image/image_file.h"
#include "solver/background/object_mask.h"

namespace glasswing {
namespace {

struct MaskPictures {
  std::string with, without, mask;
  MaskOptions options;
};

absl::Status make_mask(const MaskPictures& pictures) {
  GW_ASSIGN_OR_RETURN(const CodedPhotograph with, read_photograph(pictures.with));
  GW_ASSIGN_OR_RETURN(const CodedPhotograph without, read_photograph(pictures.without));
  MaskOptions options = pictures.options;
  options.bits = std::min(with.bits, without.bits);
  const Image16 picture_with = interpolated(with), picture_without = interpolated(without);
  GW_ASSIGN_OR_RETURN(const ObjectMask object, ObjectMask::of_pair(picture_with, picture_without, options));
  const Mask mask = object.mask(picture_with);
  RadianceImage picture(mask.width_px, mask.height_px);
  for (size_t i = 0; i < picture.samples.size(); ++i)
    picture.samples[i] = mask.samples[i / 3] != 0 ? 1.0f : 0.0f;
  GW_RETURN_IF_ERROR(write_radiance(pictures.mask, picture, Encoding::kDisplay));
  const ImageRegistration& registration = object.registration();
  std::cout << fmt::format(
      "{}: {:.1f} % of the picture; shifted by {:+.2f} {:+.2f} px, corners by up to {:.2f} px; {:.3f} {:.3f} "
      "{:.3f} times as bright; noise "
      "{:.2f} codes of 255\n",
      pictures.mask, 100.0 * mask.coverage(), registration.shift_px[0], registration.shift_px[1],
      registration.max_px(mask.width_px, mask.height_px), registration.gain[0], registration.gain[1],
      registration.gain[2], 255.0 * object.usual_noise());
  return absl::OkStatus();
}

}  // namespace

void add_mask_command(CLI::App& app, DaemonOptions& daemon) {
  const auto pictures = std::make_shared<MaskPictures>();
  CLI::App& command = add_command(app, daemon, "mask",
                                  "Find the object in a photograph, using one without "
                                  "it",
                                  [pictures]() -> absl::StatusOr<int> {
                                    GW_RETURN_IF_ERROR(make_mask(*pictures));
                                    return 0;
                                  });
  command.footer(
      "First registers the picture without the object to the other one, in position and brightness, to "
      "compensate for a camera that was touched.\nThe object is where they differ by more than noise, "
      "cleaned by dilation, hole "
      "filling and erosion. It is white in the mask.\n\nExample:\n  glasswing-solver mask vase.jpg empty.jpg "
      "mask.png");
  command.add_option("with", pictures->with, "photograph with the object: PNG, JPEG or TIFF")->required();
  command.add_option("without", pictures->without, "one without it, of the same size")->required();
  command.add_option("mask", pictures->mask, "PNG or TIFF to write")->required();
  MaskOptions& options = pictures->options;
  command
      .add_option(
          "--false-positive-rate", options.false_positive_rate,
          "of the difference test, for normal noise: share of the other pixels that are mistaken for the "
          "object")
      ->check(CLI::Range(1e-12, 0.5))
      ->capture_default_str();
  command
      .add_option("--dilate", options.dilation_px,
                  "px: half the side of the square that closes gaps; default: 0.3 % of the diagonal")
      ->check(CLI::Range(0, 1000));
  command.add_option("--erode", options.erosion_px, "px: the same for erosion; default: as --dilate")
      ->check(CLI::Range(0, 1000));
  command
      .add_option("--least", options.min_px,
                  "px: smaller connected regions are noise; default: the square's area")
      ->check(CLI::Range(0, 1 << 28));
  command.add_flag("!--keep-holes", options.fill_holes, "do not fill holes in the object");
  command.add_flag("!--no-drift", options.follow_drift, "the pictures are already aligned");
}

}  // namespace glasswing
