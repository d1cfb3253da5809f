// The pictures behind a matte's object, one for each of its textures (monitors).
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "compositing/composite/arguments.h"
#include "compositing/picture/moving_picture.h"
#include "core/composite/histogram_match.h"
#include "core/image/image.h"
#include "core/image/image_file.h"
#include "glasswing/v1/matte.pb.h"

namespace glasswing {

struct BackgroundArgument {
  int texture = 0;  // index in MatteMetadata.monitors
  std::string file;
};

// Parses "[TEXTURE=]IMAGE". The part before '=' is a texture if a monitor has this name; otherwise all of it
// must be an existing file. INVALID_ARGUMENT lists the matte's textures.
absl::StatusOr<BackgroundArgument> parse_background(const std::string& argument,
                                                    const v1::MatteMetadata& metadata,
                                                    std::string_view option = "--background");

// The pictures behind the object, frame by frame.
class Backdrop {
 public:
  // INVALID_ARGUMENT: a texture is named twice, --match, --shift or --pan names one without a background, or
  // a background is a video, which is sRGB, and `colours` is to convert it.
  static absl::StatusOr<Backdrop> open(const BackgroundArguments& arguments,
                                       const v1::MatteMetadata& metadata, const PictureColours& colours,
                                       Encoding encoding);

  // One picture for each texture, scaled to its monitor; empty where no argument names it. Valid until the
  // next call.
  absl::StatusOr<const std::vector<RadianceImage>*> next();

  // True if a background is a video or a directory of pictures.
  bool has_video() const;
  // True once all of those have started over.
  bool is_over() const;
  int announced_frames() const;  // of the longest; 0: not known
  // What is known about the colours of a composite over them: linear Rec. 709 if the matte's monitors are
  // calibrated, so that its channels become their primaries, and the pictures are linear Rec. 709.
  PictureColour colour_of_composite() const;

 private:
  struct Screen {
    int width_px = 0, height_px = 0;
    std::optional<MovingPicture> picture;
    RadianceImage photograph;  // whose colours to match; empty: none
    std::optional<HistogramMatch> match;
    double dx_px = 0.0, dy_px = 0.0;        // shift of the next picture
    double pan_x_px = 0.0, pan_y_px = 0.0;  // change of the shift from frame to frame
    RadianceImage placed;                   // the picture before it is shifted
  };
  Backdrop() = default;

  bool calibrated_ = false, are_rec709_ = true, wraps_ = false;
  std::vector<Screen> screens_;
  std::vector<RadianceImage> now_;
};

}  // namespace glasswing
