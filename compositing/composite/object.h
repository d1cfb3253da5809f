// The object of a matte, in front of pictures.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "compositing/composite/arguments.h"
#include "core/composite/fast_compositor.h"
#include "core/composite/fill_unsolved.h"
#include "core/file/mapped_file.h"
#include "core/image/image.h"
#include "core/matte/matte.h"
#include "core/matte/matte_file.h"

namespace glasswing {

// A composite, and the object's coverage of each pixel if only the object is requested; otherwise empty.
struct ObjectPicture {
  RadianceImage light, coverage;

  const RadianceImage* alpha() const { return coverage.empty() ? nullptr : &coverage; }
};

// Composites one matte over pictures, with the options of the arguments. Holds the matte's file rather than
// the matte, which is several times as large; with --exact, both.
class ObjectInFront {
 public:
  // `pictures`: how many composites will be made; for many, the preparation is kept.
  enum class Pictures { kOne, kMany };
  static absl::StatusOr<ObjectInFront> create(const std::filesystem::path& matte,
                                              const CompositeArguments& arguments, Pictures pictures);

  const v1::MatteMetadata& metadata() const { return outline_.metadata; }
  absl::StatusOr<ObjectPicture> composite(const std::vector<RadianceImage>& backgrounds,
                                          const std::function<void(double)>& progress = nullptr);
  // Of the composite, without what --crop leaves out; known after a composite.
  const PixelCount& pixels() const { return counted_->pixels; }
  // The standard error of the composite due to the frames' noise (core/footprint/composite_error.h).
  absl::StatusOr<RadianceImage> error(const std::vector<RadianceImage>& backgrounds,
                                      const std::function<void(double)>& progress = nullptr) const;

 private:
  ObjectInFront(std::string file, std::shared_ptr<const MappedFile> mapped, MatteOutline outline,
                const CompositeArguments& arguments);
  absl::Status prepare(Pictures pictures, bool exact);
  absl::StatusOr<RadianceImage> composite_whole(const std::vector<RadianceImage>& backgrounds,
                                                const std::function<void(double)>& progress);
  // Brightens the object's own light, and records coverage and unsolved pixels.
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

}  // namespace glasswing
