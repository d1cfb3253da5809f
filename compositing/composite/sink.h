// The destination of composites of several frames.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>

#include "compositing/composite/arguments.h"
#include "compositing/composite/object.h"
#include "compositing/picture/video_file.h"

namespace glasswing {

// Writes pictures into a directory, or frames of a video. Written pictures are kept after a failure.
class Sink {
 public:
  // `arguments` must outlive it. INVALID_ARGUMENT: the output cannot hold several pictures, or not the
  // requested ones.
  static absl::StatusOr<Sink> create(const CompositeArguments& arguments);

  const PictureColours& colours() const { return colours_; }
  // `name`: a picture's, without its suffix.
  absl::Status add(const std::string& name, const ObjectPicture& made, const PictureColour& colour);
  absl::Status finish();

 private:
  explicit Sink(const CompositeArguments& arguments) : arguments_(arguments) {}

  const CompositeArguments& arguments_;
  PictureColours colours_;
  std::optional<VideoWriter> video_;
};

}  // namespace glasswing
