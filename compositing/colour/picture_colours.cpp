#include "compositing/colour/picture_colours.h"

#include <utility>

#include "core/base/status.h"
#include "core/file/file.h"

namespace glasswing {

void add_colour_options(CLI::App& command, ColourArguments& arguments) {
  command
      .add_option("--ocio", arguments.both,
                  "colour space of input and output pictures, from an OpenColorIO config: ACEScg")
      ->type_name("SPACE");
  command.add_option("--ocio-in", arguments.in, "the same, only for input pictures")->type_name("SPACE");
  command.add_option("--ocio-out", arguments.out, "the same, only for output pictures")->type_name("SPACE");
  command.add_option("--ocio-config", arguments.config, "the OpenColorIO config; default: $OCIO")
      ->type_name("FILE");
}

absl::StatusOr<PictureColours> PictureColours::open(const ColourArguments& arguments) {
  PictureColours colours;
  const std::string& in = arguments.in.empty() ? arguments.both : arguments.in;
  const std::string& out = arguments.out.empty() ? arguments.both : arguments.out;
  if (in.empty() && out.empty() && !arguments.config.empty())
    return absl::InvalidArgumentError("--ocio-config is given, but neither --ocio, --ocio-in nor --ocio-out");
  if (!in.empty()) {
    GW_ASSIGN_OR_RETURN(ColourSpace space, ColourSpace::open(arguments.config, in));
    colours.in_ = std::make_shared<const ColourSpace>(std::move(space));
  }
  if (!out.empty()) {
    GW_ASSIGN_OR_RETURN(ColourSpace space, ColourSpace::open(arguments.config, out));
    colours.out_ = std::make_shared<const ColourSpace>(std::move(space));
  }
  return colours;
}

absl::StatusOr<RadianceImage> PictureColours::read(const std::filesystem::path& path,
                                                   Encoding encoding) const {
  if (in_ == nullptr) return read_radiance(path, encoding);
  GW_ASSIGN_OR_RETURN(RadianceImage picture, read_radiance(path, Encoding::kLinear));
  in_->to_linear(picture);
  return picture;
}

absl::StatusOr<std::string> PictureColours::encode(const std::filesystem::path& name, RadianceImage image,
                                                   Encoding encoding, int bits, const PictureColour& colour,
                                                   const RadianceImage* coverage) const {
  if (out_ == nullptr) return encode_radiance(name, image, encoding, bits, colour, coverage);
  out_->from_linear(image);
  const bool codes = name.extension() != ".exr";
  return encode_radiance(name, image, Encoding::kLinear, codes && bits == 0 ? 8 : bits, out_->colour(),
                         coverage);
}

absl::Status PictureColours::write(const std::filesystem::path& path, RadianceImage image, Encoding encoding,
                                   int bits, const PictureColour& colour,
                                   const RadianceImage* coverage) const {
  GW_ASSIGN_OR_RETURN(const std::string bytes,
                      encode(path, std::move(image), encoding, bits, colour, coverage));
  return write_file_durably(path, bytes);
}

}  // namespace glasswing
