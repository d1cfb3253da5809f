// Which picture stands on which texture.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>
#include <vector>

#include "client/moving_picture.h"
#include "core/frame/image.h"
#include "core/frame/image_file.h"
#include "core/matte/histogram_match.h"
#include "glasswing/v1/matte.pb.h"

namespace glasswing {

struct BackgroundArgument {
  int texture = 0;  // place in MatteMetadata.monitors
  std::string file;
};

// "[TEXTURE=]IMAGE". The part before '=' is a texture if it is a monitor's name; a file whose own name has a
// '=' is taken whole if it is there. INVALID_ARGUMENT lists the textures there are.
absl::StatusOr<BackgroundArgument> parse_background(const std::string& argument,
                                                    const v1::MatteMetadata& metadata);

// What stands behind the object, frame by frame.
class Backgrounds {
 public:
  // INVALID_ARGUMENT: a texture is named twice, or a photograph to match is of one without a background.
  static absl::StatusOr<Backgrounds> open(const std::vector<std::string>& arguments,
                                          const std::vector<std::string>& matches,
                                          const v1::MatteMetadata& metadata, Encoding encoding);

  // One picture a texture, scaled to its monitor; empty where no argument names it. Valid until the next
  // call.
  absl::StatusOr<const std::vector<RadianceImage>*> next();

 private:
  struct Screen {
    int width_px = 0, height_px = 0;
    std::optional<MovingPicture> picture;
    RadianceImage photograph;  // to take colours from; empty: none
    std::optional<HistogramMatch> match;
  };
  Backgrounds() = default;

  std::vector<Screen> screens_;
  std::vector<RadianceImage> now_;
};

}  // namespace glasswing
