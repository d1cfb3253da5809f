#include "client/pictures/video_codecs.h"

#include "core/base/module.h"
#include "core/base/status.h"

namespace glasswing {

absl::StatusOr<const VideoCodecs*> video_codecs() {
  GW_ASSIGN_OR_RETURN(const void* codecs, load_module("glasswing-videos.so", "glasswing_video_codecs"));
  return static_cast<const VideoCodecs*>(codecs);
}

}  // namespace glasswing
