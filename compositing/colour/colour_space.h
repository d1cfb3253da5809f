// A colour space of an OpenColorIO config, and the light used in computations: linear Rec. 709, which the
// config defines by its role aces_interchange, or by a space of that name.
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "compositing/colour/colour_module.h"
#include "core/image/image.h"
#include "core/image/image_file.h"

namespace glasswing {

class ColourSpace {
 public:
  // `name`: a colour space, an alias or a role; `config`: its file, empty: $OCIO. INVALID_ARGUMENT: no
  // config, or one that cannot be read, has no such space, or does not define linear Rec. 709; or the space
  // is for data. UNIMPLEMENTED: this installation lacks OpenColorIO.
  static absl::StatusOr<ColourSpace> open(const std::string& config, const std::string& name);

  void to_linear(RadianceImage& picture) const;
  void from_linear(RadianceImage& picture) const;
  // The attributes for a file with its samples: its name, and if it is linear light of known primaries, their
  // name and chromaticities.
  const PictureColour& colour() const { return colour_; }

 private:
  std::unique_ptr<const ColourConversion> to_linear_, from_linear_;
  PictureColour colour_;
};

}  // namespace glasswing
