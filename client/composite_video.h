// Composites of a directory of mattes, one for each frame of a video.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

#include "client/client.h"
#include "core/frame/image_file.h"
#include "core/matte/matte.h"

namespace glasswing {

struct CompositeArguments {
  std::string matte;  // a file, or a directory
  std::vector<std::string> backgrounds, matches;
  std::string output;
  std::string format = "exr";
  double frame_rate_hz = 30.0;
  float foreground_gain = 1.0f;
  std::string crop;
  bool linear = false;

  Encoding encoding() const { return linear ? Encoding::kLinear : Encoding::kDisplay; }
};

// F times `gain`.
void brighten_foreground(Matte& matte, float gain);

// Errors name the matte at fault; frames that are written stay.
absl::Status composite_video(const Client& client, const CompositeArguments& arguments);

}  // namespace glasswing
