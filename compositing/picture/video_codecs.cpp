#include "compositing/picture/video_codecs.h"

#include "core/base/status.h"
#include "core/process/module.h"

namespace glasswing {

absl::StatusOr<const VideoCodecs*> video_codecs() {
  static const absl::StatusOr<const void*> kModule =
      load_module("glasswing-videos.so", "glasswing_video_codecs");
  GW_RETURN_IF_ERROR(kModule.status());
  return static_cast<const VideoCodecs*>(*kModule);
}

}  // namespace glasswing
