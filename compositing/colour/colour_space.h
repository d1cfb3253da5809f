// A colour space of an OpenColorIO config, and the light that we compute with: linear Rec. 709, which the
// config tells by its role aces_interchange, or by a space of that name.
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "compositing/colour/colour_module.h"
#include "core/frame/image.h"
#include "core/frame/image_file.h"

namespace glasswing {

class ColourSpace {
 public:
  // `name`: a colour space, an alias or a role; `config`: its file, empty: $OCIO. INVALID_ARGUMENT: no
  // config, or one that cannot be read, has no such space, or does not tell linear Rec. 709; or the space is
  // for data. UNIMPLEMENTED: this installation lacks OpenColorIO.
  static absl::StatusOr<ColourSpace> open(const std::string& config, const std::string& name);

  void to_linear(RadianceImage& picture) const;
  void from_linear(RadianceImage& picture) const;
  // What a file of its samples says: its name, and if it is found to be linear light of primaries that have a
  // name, that and their chromaticities.
  const PictureColour& colour() const { return colour_; }

 private:
  std::unique_ptr<const ColourConversion> to_linear_, from_linear_;
  PictureColour colour_;
};

}  // namespace glasswing
