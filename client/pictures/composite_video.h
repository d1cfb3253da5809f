// Composites of many frames: of a directory with a matte for each frame, or of one matte over moving
// backgrounds.
#pragma once

#include <absl/status/status.h>

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/client.h"
#include "client/pictures/composite.h"
#include "core/frame/image_file.h"
#include "core/matte/fast_compositor.h"
#include "core/matte/matte.h"

namespace glasswing {

struct CompositeArguments {
  std::string matte;  // a file, or a directory
  BackgroundArguments backgrounds;
  std::string output;
  std::string format = "exr";
  int bits = 0;         // as for write_radiance()
  int frame_count = 0;  // for one matte; 0: as many as its backgrounds have
  double frame_rate_hz = 30.0;
  float foreground_gain = 1.0f;
  std::string crop;
  std::string error;  // a picture of the composite's standard error; empty: none
  bool linear = false, exact = false;
  bool fill = false;  // pixels that are not solved, from their neighbours

  Encoding encoding() const { return linear ? Encoding::kLinear : Encoding::kDisplay; }
};

// Composites one matte over pictures, with the options of the arguments.
class ObjectInFront {
 public:
  static absl::StatusOr<ObjectInFront> create(const std::filesystem::path& matte,
                                              const CompositeArguments& arguments,
                                              const std::function<void(double)>& progress = nullptr);

  const v1::MatteMetadata& metadata() const { return matte_.metadata; }
  std::int64_t unsolved_count() const { return count_pixels(matte_).unsolved; }
  absl::StatusOr<RadianceImage> composite(const std::vector<RadianceImage>& backgrounds,
                                          const std::function<void(double)>& progress = nullptr) const;
  // The standard error that the frames' noise leaves in that (core/footprint/composite_error.h).
  absl::StatusOr<RadianceImage> error(const std::vector<RadianceImage>& backgrounds,
                                      const std::function<void(double)>& progress = nullptr) const;

 private:
  ObjectInFront(Matte matte, const CompositeArguments& arguments)
      : matte_(std::move(matte)), crop_(arguments.crop), fill_(arguments.fill) {}

  Matte matte_;
  std::string crop_;
  bool fill_;
  std::optional<FastCompositor> fast_;  // nullopt: exact
};

// True if the arguments ask for several pictures.
bool is_video(const CompositeArguments& arguments);

// Errors name the matte at fault; pictures already written are kept.
absl::Status composite_video(const Client& client, const CompositeArguments& arguments);

}  // namespace glasswing
