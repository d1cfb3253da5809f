// Which picture stands on which texture.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/pictures/moving_picture.h"
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
                                                    const v1::MatteMetadata& metadata,
                                                    std::string_view option = "--background");

// What the command line says of the pictures behind the object; each entry is "[TEXTURE=]VALUE".
struct BackgroundArguments {
  std::vector<std::string> pictures, matches;
  std::vector<std::string> shifts,
      pans;  // DX,DY: monitor px right and down; of the first picture, and of each next one
};

// What stands behind the object, frame by frame.
class Backgrounds {
 public:
  // INVALID_ARGUMENT: a texture is named twice, or one without a background is to take colours or to move.
  static absl::StatusOr<Backgrounds> open(const BackgroundArguments& arguments,
                                          const v1::MatteMetadata& metadata, Encoding encoding);

  // One picture a texture, scaled to its monitor; empty where no argument names it. Valid until the next
  // call.
  absl::StatusOr<const std::vector<RadianceImage>*> next();

  // One of them is a video or a directory of pictures.
  bool has_video() const;
  // All of these have begun again with what next() gave last.
  bool is_over() const;
  int announced_frames() const;  // of the longest, as far as is known

 private:
  struct Screen {
    int width_px = 0, height_px = 0;
    std::optional<MovingPicture> picture;
    RadianceImage photograph;  // to take colours from; empty: none
    std::optional<HistogramMatch> match;
    double dx_px = 0.0, dy_px = 0.0;        // of the next picture
    double pan_x_px = 0.0, pan_y_px = 0.0;  // from one to the next
    RadianceImage placed;                   // before it is moved
  };
  Backgrounds() = default;

  std::vector<Screen> screens_;
  std::vector<RadianceImage> now_;
};

}  // namespace glasswing
