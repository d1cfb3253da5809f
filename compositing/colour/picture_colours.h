// The colour spaces in which a verb reads and writes pictures.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <string>

#include "compositing/colour/colour_space.h"
#include "core/image/image.h"
#include "core/image/image_file.h"

namespace glasswing {

// Names of colour spaces; empty: those of the formats (image_file.h).
struct ColourArguments {
  std::string in, out, both;  // `both`: where `in` or `out` is not given
  std::string config;         // a file; empty: $OCIO
};
void add_colour_options(CLI::App& command, ColourArguments& arguments);

class PictureColours {
 public:
  // Errors as in ColourSpace::open().
  static absl::StatusOr<PictureColours> open(const ColourArguments& arguments);

  // True if pictures are converted as they are read, or written.
  bool reads() const { return in_ != nullptr; }
  bool writes() const { return out_ != nullptr; }

  // Reads linear Rec. 709, from the input space if there is one; otherwise read_radiance().
  absl::StatusOr<RadianceImage> read(const std::filesystem::path& path, Encoding encoding) const;
  // Encodes linear Rec. 709, as a file of this name, in the output space if there is one, also in PNG and
  // TIFF; otherwise encode_radiance(), which documents `coverage`.
  absl::StatusOr<std::string> encode(const std::filesystem::path& name, RadianceImage image,
                                     Encoding encoding, int bits, const PictureColour& colour,
                                     const RadianceImage* coverage = nullptr) const;
  // Writes the same to the file, durably.
  absl::Status write(const std::filesystem::path& path, RadianceImage image, Encoding encoding, int bits,
                     const PictureColour& colour, const RadianceImage* coverage = nullptr) const;

 private:
  std::shared_ptr<const ColourSpace> in_, out_;
};

}  // namespace glasswing
