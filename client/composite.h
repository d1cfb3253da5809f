// Which picture stands on which texture.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "core/frame/image.h"
#include "core/frame/image_file.h"
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

// One picture a texture, scaled to its monitor; empty where no argument names it. INVALID_ARGUMENT: a texture
// is named twice.
absl::StatusOr<std::vector<RadianceImage>> load_backgrounds(const std::vector<std::string>& arguments,
                                                            const v1::MatteMetadata& metadata,
                                                            Encoding encoding);

}  // namespace glasswing
