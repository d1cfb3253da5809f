#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>

#include "compositing/composite/arguments.h"
#include "compositing/composite/backdrop.h"
#include "compositing/composite/commands.h"
#include "compositing/composite/composite_rays.h"
#include "compositing/composite/object.h"
#include "compositing/composite/sequence.h"
#include "compositing/picture/picture.h"
#include "compositing/picture/video_file.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/output_file.h"
#include "core/cli/progress.h"
#include "core/file/file.h"
#include "core/file/mapped_file.h"
#include "core/footprint/composite_error.h"
#include "core/footprint/matte_transport.h"
#include "core/matte/matte_file.h"
#include "core/matte/matte_notes.h"

namespace glasswing {
namespace {

// "; 12 pixels are not solved: " and how they were handled; empty: none.
std::string unsolved_note(const CompositeArguments& arguments, std::int64_t pixels) {
  if (pixels == 0) return "";
  return fmt::format("; {} not solved: {}", pixels == 1 ? "1 pixel is" : fmt::format("{} pixels are", pixels),
                     !arguments.from.empty() ? "without light"
                     : arguments.fill        ? "filled from neighbours"
                                             : "black, or filled from neighbours with --fill");
}

void print_composite(const CommandLine& command_line, const CompositeArguments& arguments,
                     const RadianceImage& picture, const v1::MatteMetadata* metadata = nullptr,
                     const PixelCount& pixels = {}) {
  if (command_line.json) {
    nlohmann::ordered_json written = {{"file", arguments.output},
                                      {"width_px", picture.width_px},
                                      {"height_px", picture.height_px},
                                      {"unsolved_pixels", pixels.unsolved},
                                      {"filled", arguments.fill}};
    if (metadata != nullptr) add_notes(warnings_of(*metadata), pixels, written);
    std::cout << written.dump(1) << "\n";
    return;
  }
  std::cout << fmt::format("{}: {}x{}{}\n", arguments.output, picture.width_px, picture.height_px,
                           unsolved_note(arguments, pixels.unsolved));
  print_flagged(pixels);
}

// The output's name, or one with the suffix of --format for standard output.
std::string picture_name(const CompositeArguments& arguments) {
  return arguments.output == kStandardOutput ? "standard output." + arguments.format : arguments.output;
}

// Before any work.
absl::Status check_outputs(const CompositeArguments& arguments) {
  GW_RETURN_IF_ERROR(check_output_file(arguments.output, {".exr", ".png", ".tif", ".tiff", kStandardOutput}));
  if (!arguments.error.empty()) {
    if (!arguments.error.ends_with(".exr")) {
      return absl::InvalidArgumentError(
          fmt::format("--error {} must be an .exr: other formats cannot mark where the error is not known",
                      arguments.error));
    }
    GW_RETURN_IF_ERROR(check_writable(arguments.error));
  }
  return check_picture_file(picture_name(arguments), arguments.bits, arguments.object);
}

absl::Status write_composite(const CompositeArguments& arguments, const PictureColours& colours,
                             const ObjectPicture& picture, const PictureColour& colour) {
  GW_ASSIGN_OR_RETURN(const std::string bytes,
                      colours.encode(picture_name(arguments), picture.light, arguments.encoding(),
                                     arguments.bits, colour, picture.alpha()));
  return write_output(arguments.output, bytes);
}

absl::Status composite_rays_still(const CommandLine& command_line, const CompositeArguments& arguments) {
  GW_RETURN_IF_ERROR(check_outputs(arguments));
  GW_ASSIGN_OR_RETURN(const PictureColours colours, PictureColours::open(arguments.colours));
  absl::StatusOr<ObjectPicture> picture;
  {
    Progress progress("compositing");
    picture =
        composite_of_rays(arguments, colours, [&progress](double fraction) { progress.update(fraction); });
  }
  GW_RETURN_IF_ERROR(picture.status());
  GW_RETURN_IF_ERROR(write_composite(arguments, colours, *picture, PictureColour()));
  print_composite(command_line, arguments, picture->light);
  return absl::OkStatus();
}

// The monitor that --from names: "monitor" is the first one.
absl::StatusOr<int> viewing_texture(const std::string& from, const v1::MatteMetadata& metadata) {
  std::vector<std::string> names;
  for (const v1::Monitor& monitor : metadata.monitors()) names.push_back(monitor.name());
  const auto found = std::ranges::find(names, from);
  if (found != names.end()) return static_cast<int>(found - names.begin());
  if (from == "monitor" && !names.empty()) return 0;
  return absl::InvalidArgumentError(
      fmt::format("--from is {}; it must be monitor, which is the first one, or one of: {}", from,
                  fmt::join(names, ", ")));
}

// Options of pictures that the camera would see, or of several.
absl::Status check_from_options(const CompositeArguments& arguments) {
  const BackgroundArguments& behind = arguments.backgrounds;
  for (const auto& [given, option] :
       {std::pair{!arguments.error.empty(), "--error"}, std::pair{arguments.object, "--object"},
        std::pair{arguments.fill, "--fill"}, std::pair{is_video(arguments), "several frames"},
        std::pair{!behind.matches.empty(), "--match"}, std::pair{!behind.shifts.empty(), "--shift"},
        std::pair{!behind.pans.empty(), "--pan"}, std::pair{!arguments.planes.empty(), "--plane"},
        std::pair{!arguments.environment.empty(), "--environment"},
        std::pair{arguments.lossless, "--lossless"},
        std::pair{behind.pictures.size() > 1, "a second --background"}}) {
    if (given) {
      return absl::InvalidArgumentError(fmt::format(
          "{} does not go with --from, which makes one picture as the monitor would see it", option));
    }
  }
  return absl::OkStatus();
}

// Dual photography (core/footprint/matte_transport.h).
absl::Status composite_dual(const CommandLine& command_line, const CompositeArguments& arguments) {
  GW_RETURN_IF_ERROR(check_from_options(arguments));
  GW_RETURN_IF_ERROR(check_outputs(arguments));
  GW_ASSIGN_OR_RETURN(const PictureColours colours, PictureColours::open(arguments.colours));
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> file, MappedFile::open(arguments.matte));
  const absl::StatusOr<Matte> matte = decode_matte(file->bytes(), Pyramids::kKept);
  if (!matte.ok()) return in_file(arguments.matte, matte.status());
  print_warnings(warnings_of(matte->metadata));
  GW_ASSIGN_OR_RETURN(const int texture, viewing_texture(arguments.from, matte->metadata));
  RadianceImage shone(matte->width_px(), matte->height_px());
  std::ranges::fill(shone.samples, 1.0f);
  if (!arguments.backgrounds.pictures.empty()) {
    GW_ASSIGN_OR_RETURN(const RadianceImage picture,
                        colours.read(arguments.backgrounds.pictures[0], arguments.encoding()));
    shone = resized(picture, shone.width_px, shone.height_px);
  }
  GW_ASSIGN_OR_RETURN(const RadianceImage seen, composite_from_monitor(*matte, texture, shone));
  ObjectPicture picture;
  GW_ASSIGN_OR_RETURN(picture.light, cropped(seen, arguments.crop));
  GW_RETURN_IF_ERROR(write_composite(arguments, colours, picture, PictureColour()));
  print_composite(command_line, arguments, picture.light, &matte->metadata, count_pixels(*matte));
  return absl::OkStatus();
}

// A matte shows only its monitors; what only rays can show is rejected.
absl::Status check_matte_options(const CompositeArguments& arguments) {
  for (const auto& [given, option] : {std::pair{!arguments.planes.empty(), "--plane"},
                                      std::pair{!arguments.environment.empty(), "--environment"},
                                      std::pair{arguments.lossless, "--lossless"}}) {
    if (given) {
      return absl::InvalidArgumentError(fmt::format(
          "{} is for rays; {} is not a rays file: glasswing rays makes one from mattes at two depths", option,
          arguments.matte));
    }
  }
  if (!arguments.backgrounds.pictures.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError("--background is required: the picture behind the object");
}

absl::Status composite_still(const CommandLine& command_line, const CompositeArguments& arguments) {
  GW_RETURN_IF_ERROR(check_outputs(arguments));
  GW_ASSIGN_OR_RETURN(const PictureColours colours, PictureColours::open(arguments.colours));
  absl::StatusOr<ObjectPicture> picture;
  absl::StatusOr<RadianceImage> error;
  PictureColour colour;
  v1::MatteMetadata metadata;
  PixelCount pixels;
  {
    Progress progress("compositing");
    const auto report = [&progress](double fraction) { progress.update(fraction); };
    GW_ASSIGN_OR_RETURN(ObjectInFront object,
                        ObjectInFront::create(arguments.matte, arguments, ObjectInFront::Pictures::kOne));
    metadata = object.metadata();
    print_warnings(warnings_of(metadata));
    GW_ASSIGN_OR_RETURN(Backdrop backdrop, Backdrop::open(arguments.backgrounds, object.metadata(), colours,
                                                          arguments.encoding()));
    colour = backdrop.colour_of_composite();
    GW_ASSIGN_OR_RETURN(const std::vector<RadianceImage>* const behind, backdrop.next());
    picture = object.composite(*behind, report);
    pixels = object.pixels();
    if (picture.ok() && !arguments.error.empty()) {
      Progress errors("errors");
      error = object.error(*behind, [&errors](double fraction) { errors.update(fraction); });
      GW_RETURN_IF_ERROR(error.status());
    }
  }
  GW_RETURN_IF_ERROR(picture.status());
  GW_RETURN_IF_ERROR(write_composite(arguments, colours, *picture, colour));
  if (!arguments.error.empty()) {
    GW_ASSIGN_OR_RETURN(const std::string bytes, encode_composite_error(*error));
    GW_RETURN_IF_ERROR(write_file_durably(arguments.error, bytes));
  }
  print_composite(command_line, arguments, picture->light, &metadata, pixels);
  return absl::OkStatus();
}

absl::Status composite_frames(const CommandLine& command_line, const CompositeArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const Composited made, composite_sequence(arguments));
  print_warnings(made.warnings);
  if (command_line.json) {
    nlohmann::ordered_json written = {
        {"output", arguments.output}, {"frames", made.frames}, {"filled", arguments.fill}};
    add_notes(made.warnings, made.pixels, written);
    std::cout << written.dump(1) << "\n";
  } else {
    std::cout << fmt::format("{}: {} frames{}\n", arguments.output, made.frames,
                             arguments.fill ? ", unsolved pixels filled from their neighbours" : "");
    print_flagged(made.pixels);
  }
  return absl::OkStatus();
}

absl::Status composited(const CommandLine& command_line, const CompositeArguments& arguments) {
  if (holds_rays(arguments.matte)) {
    if (!arguments.from.empty())
      return absl::InvalidArgumentError(fmt::format("--from is for mattes; {} holds rays", arguments.matte));
    if (is_video(arguments) && arguments.frame_count > 0)
      return absl::InvalidArgumentError(
          fmt::format("{} holds rays, which give one picture", arguments.matte));
    return composite_rays_still(command_line, arguments);
  }
  if (!arguments.from.empty()) return composite_dual(command_line, arguments);
  GW_RETURN_IF_ERROR(check_matte_options(arguments));
  return is_video(arguments) ? composite_frames(command_line, arguments)
                             : composite_still(command_line, arguments);
}

void add_rays_options(CLI::App& command, CompositeArguments& arguments) {
  command
      .add_option("--plane", arguments.planes,
                  "for rays: DEPTH_MM[:PICTURE], a picture at this distance from the camera, as large as the "
                  "monitor; default: --background's; may be repeated, nearer ones hide others")
      ->allow_extra_args(false);
  command.add_option(
      "--environment", arguments.environment,
      "for rays: a picture of all directions, equirectangular; its centre is straight ahead of the camera");
  command
      .add_option("--environment-turn", arguments.environment_turn_deg,
                  "turn the environment about the vertical, degrees; the view ahead moves to the right")
      ->check(CLI::Range(-3600.0, 3600.0));
  command.add_option("--environment-gain", arguments.environment_gain, "factor on the environment's light")
      ->check(CLI::Range(0.0f, 1e6f))
      ->capture_default_str();
  command.add_flag("--lossless", arguments.lossless,
                   "the object absorbs nothing: light that no monitor showed is taken from the environment's "
                   "mean");
}

void add_composite_options(CLI::App& command, CompositeArguments& arguments) {
  command.add_option("matte", arguments.matte, "a matte from glasswing fetch, or a directory of them")
      ->required();
  command.add_option("--background", arguments.backgrounds.pictures, "[TEXTURE=]IMAGE; may be repeated")
      ->allow_extra_args(false);
  command
      .add_option(
          "-o,--output", arguments.output,
          fmt::format("a picture (.exr, .png or .tif), or - for standard output; for several frames a "
                      "directory or a video ({})",
                      kVideoSuffixes))
      ->required();
  command
      .add_option("--format", arguments.format, "format of pictures in a directory, or on standard output")
      ->check(CLI::IsMember({"exr", "png", "tif"}))
      ->capture_default_str();
  command
      .add_option("--bits", arguments.bits,
                  "bits per sample: 8 or 16 for PNG and TIFF (with --linear default 16), 32 or 16 for EXR")
      ->check(CLI::IsMember({8, 16, 32}));
  command
      .add_option(
          "--shift", arguments.backgrounds.shifts,
          "[TEXTURE=]DX,DY: shift the picture by monitor px to the right and down; beyond its edges its edge "
          "pixels continue (clamp)")
      ->allow_extra_args(false);
  command
      .add_option("--pan", arguments.backgrounds.pans, "[TEXTURE=]DX,DY: shift it further with every frame")
      ->allow_extra_args(false);
  command.add_flag("--wrap", arguments.backgrounds.wraps,
                   "for --shift and --pan: the picture repeats beyond its edges, for endless pans");
  command.add_option("--frames", arguments.frame_count, "number of frames, for one matte")
      ->check(CLI::Range(1, 1000000));
  command.add_option("--fps", arguments.frame_rate_hz, "frame rate of the written video, Hz")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  command
      .add_option(
          "--match", arguments.backgrounds.matches,
          "[TEXTURE=]PHOTOGRAPH: match the background's colours to it, for example to a photograph of "
          "the same picture on a monitor")
      ->allow_extra_args(false);
  command
      .add_option("--foreground-gain", arguments.foreground_gain,
                  "factor on the object's own light F; highlights of a video often look better above 1")
      ->check(CLI::Range(0.0f, 100.0f))
      ->capture_default_str();
  command.add_option(
      "--error", arguments.error,
      "also write this .exr: each sample's standard error from the frames' noise; A is 1 where it is known, "
      "elsewhere all are 0");
  command.add_flag(
      "--object", arguments.object,
      "the object alone, to put over other pictures: coverage as alpha, R, G and B premultiplied in an EXR, "
      "not in a PNG");
  command.add_option("--crop", arguments.crop, kCropHelp);
  command.add_flag("--fill", arguments.fill,
                   "fill unsolved pixels, such as those that see the id patch, from their neighbours");
  add_rays_options(command, arguments);
  command.add_option("--from", arguments.from,
                     "monitor, or its name: the picture as the monitor would see it while the camera's place "
                     "shines the --background (default: white) at the object");
  command.add_flag("--exact", arguments.exact,
                   "integrate every footprint, slowly; the default is within 0.002 rms of this");
  add_colour_options(command, arguments.colours);
  command.add_flag("--linear", arguments.linear,
                   "PNG and TIFF values are linear radiance, value / full scale");
}

}  // namespace

void add_composite_command(CLI::App& app, CommandLine& command_line) {
  CLI::App& command = *app.add_subcommand(
      "composite", "Composite the object of a matte, or of a video, over other pictures.");
  command.footer(
      "Each picture is scaled to its monitor; monitors without one are black. TEXTURE is a monitor's name;\n"
      "default: the first monitor. EXR is linear radiance, 1.0 = the archive's full scale; PNG and TIFF are\n"
      "sRGB. An EXR has A, 1 without --object. For an EXR with several layers or parts, it says which one is "
      "used.\n\n"
      "A directory of mattes (glasswing fetch VIDEO -o DIR/) gives one picture per frame, 0000.exr or\n"
      "0000.png, or a video file. A background may be a still, a directory of pictures, or a video file; "
      "the\n"
      "latter two repeat. One matte also gives a video, as long as its longest background, or --frames.\n\n"
      "Examples:\n"
      "  glasswing composite vase.exr --background harbour.png -o vase.png\n"
      "  glasswing composite vase.exr --background back=harbour.png --background left=quilt.png -o "
      "vase_out.exr\n"
      "  glasswing composite pour/ --background harbour.png -o frames/ --format png\n"
      "  glasswing composite pour/ --background waves.mp4 -o pour.mp4 --fps 30\n"
      "  glasswing composite vase.exr --background waves.mp4 -o vase.mp4\n"
      "  glasswing composite vase.exr --background harbour.png --pan 2,0 --frames 300 -o vase.mp4\n"
      "  glasswing composite vase.exr --background harbour.png --pan 8,0 --wrap --frames 60 -o vase.webp\n"
      "  glasswing composite vase.exr --background harbour.png --shift 40,-10 --bits 16 -o vase.png\n"
      "  glasswing composite vase.exr --background harbour.png --match harbour_on_monitor.png -o vase.png\n"
      "  glasswing composite vase.exr --background harbour.png -o vase.png --error vase_error.exr\n"
      "  glasswing composite vase.exr --background plate.exr --object -o vase_object.exr\n"
      "  glasswing composite vase.exr --background plate.exr --ocio ACEScg -o vase_acescg.exr\n"
      "  glasswing composite vase.exr --from monitor -o vase_from_monitor.png\n"
      "  glasswing composite rays.exr --environment street.exr --environment-turn 30 -o vase.png\n"
      "  glasswing composite rays.exr --plane 850:harbour.png --environment street.exr -o vase.png");
  auto arguments = std::make_shared<CompositeArguments>();
  add_composite_options(command, *arguments);
  command.callback([&command_line, arguments] {
    command_line.run = [&command_line, arguments] { return composited(command_line, *arguments); };
  });
}

}  // namespace glasswing
