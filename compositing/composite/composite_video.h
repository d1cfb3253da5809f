// Composites of many frames: of a directory with a matte for each frame, or of one matte over moving
// backgrounds.
#pragma once

#include <absl/status/status.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compositing/composite/composite.h"
#include "core/base/mapped_file.h"
#include "core/cli/command_line.h"
#include "core/composite/fast_compositor.h"
#include "core/composite/fill_unsolved.h"
#include "core/frame/image_file.h"
#include "core/matte/matte.h"
#include "core/matte/matte_file.h"

namespace glasswing {

struct CompositeArguments {
  std::string matte;  // a file, or a directory
  BackgroundArguments backgrounds;
  ColourArguments colours;
  std::string output;
  std::string format = "exr";
  int bits = 0;         // as for write_radiance()
  int frame_count = 0;  // for one matte; 0: as many as its backgrounds have
  double frame_rate_hz = 30.0;
  float foreground_gain = 1.0f;
  std::string crop;
  std::string error;  // a picture of the composite's standard error; empty: none
  bool linear = false, exact = false;
  bool fill = false;    // pixels that are not solved, from their neighbours
  bool object = false;  // the object alone, with its coverage as alpha
  // Of files of rays (composite_rays.h).
  std::vector<std::string> planes;
  std::string environment;
  double environment_turn_deg = 0.0;
  float environment_gain = 1.0f;
  bool lossless = false;

  Encoding encoding() const { return linear ? Encoding::kLinear : Encoding::kDisplay; }
};

// A composite, and the object's coverage of each pixel where the object alone is asked for; else empty.
struct ObjectPicture {
  RadianceImage light, coverage;

  const RadianceImage* alpha() const { return coverage.empty() ? nullptr : &coverage; }
};

// Composites one matte over pictures, with the options of the arguments. Holds the matte's file rather than
// the matte, which is several times as large; with --exact both.
class ObjectInFront {
 public:
  // `pictures`: how many composites will be made; of many, preparation is kept.
  enum class Pictures { kOne, kMany };
  static absl::StatusOr<ObjectInFront> create(const std::filesystem::path& matte,
                                              const CompositeArguments& arguments, Pictures pictures);

  const v1::MatteMetadata& metadata() const { return outline_.metadata; }
  absl::StatusOr<ObjectPicture> composite(const std::vector<RadianceImage>& backgrounds,
                                          const std::function<void(double)>& progress = nullptr);
  // The pixels that are not solved; known after a composite.
  std::int64_t unsolved_count() const { return std::ranges::count(unsolved_, 1); }
  // The same by flags.
  const PixelCount& pixels() const { return counted_->pixels; }
  // The standard error that the frames' noise leaves in the composite (core/footprint/composite_error.h).
  absl::StatusOr<RadianceImage> error(const std::vector<RadianceImage>& backgrounds,
                                      const std::function<void(double)>& progress = nullptr) const;

 private:
  ObjectInFront(std::string file, std::shared_ptr<const MappedFile> mapped, MatteOutline outline,
                const CompositeArguments& arguments);
  absl::Status prepare(Pictures pictures, bool exact);
  absl::StatusOr<RadianceImage> composite_whole(const std::vector<RadianceImage>& backgrounds,
                                                const std::function<void(double)>& progress);
  // Brightens the object's own light, and notes coverage and what is not solved.
  void take(Matte& rows);

  std::string file_;
  std::shared_ptr<const MappedFile> mapped_;
  MatteOutline outline_;
  std::string crop_;
  bool fill_;
  float foreground_gain_;
  UnsolvedPixels unsolved_;
  struct Counted {
    std::mutex mutex;
    PixelCount pixels;
  };
  std::unique_ptr<Counted> counted_ = std::make_unique<Counted>();
  RadianceImage coverage_;  // empty unless it is asked for
  std::optional<Matte> exact_;
  std::optional<FastCompositor> many_;
};

// True if the arguments ask for several pictures.
bool is_video(const CompositeArguments& arguments);

// Errors name the matte at fault; pictures already written are kept.
absl::Status composite_video(const CommandLine& command_line, const CompositeArguments& arguments);

}  // namespace glasswing
