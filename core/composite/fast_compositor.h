// Composites of a matte that match composite() (compositor.h) within 0.002 of full scale, rms.
//
// The matte is converted to weights of the samples of a pyramid (footprint_rows.h). For many pictures, such
// as a video, the weights are kept: each picture then costs a pyramid and the products. For a single picture
// they are made and used row by row.
#pragma once

#include <absl/functional/function_ref.h>
#include <absl/status/statusor.h>

#include <functional>
#include <string_view>
#include <utility>
#include <vector>

#include "core/composite/footprint_rows.h"
#include "core/image/image.h"
#include "core/matte/matte.h"
#include "core/radiometry/primary_mix.h"

namespace glasswing {

class FastCompositor {
 public:
  // Takes about 40 bytes per mode and channel; long, narrow, oblique footprints take as much per row that
  // they touch, and lose sharpness if the total would exceed 4 GiB. `thread_count` 0: all cores.
  // INVALID_ARGUMENT: the matte's crosstalk is invalid.
  static absl::StatusOr<FastCompositor> create(const Matte& matte, int thread_count = 0);
  // The same for a matte's file, with a few rows in memory at a time. `edit` may inspect and change them
  // before they are converted; several threads call it, with blocks of rows in any order.
  // Errors are also those of decode_matte().
  static absl::StatusOr<FastCompositor> create(std::string_view file, absl::FunctionRef<void(Matte&)> edit,
                                               int thread_count = 0);

  // Like glasswing::composite() of this matte. The result does not depend on `thread_count`.
  absl::StatusOr<RadianceImage> composite(const std::vector<RadianceImage>& backgrounds,
                                          int thread_count = 0) const;

  // The size of the weights.
  size_t size_bytes() const;

 private:
  // Converts rows [first, end) of a matte to those from `to` on. Thread-safe.
  using Convert = absl::FunctionRef<absl::Status(const Matte& matte, int first, int end, int to)>;
  using ForBlocks = absl::FunctionRef<absl::Status(Convert convert)>;
  static absl::StatusOr<FastCompositor> create(const v1::MatteMetadata& metadata, int width_px, int height_px,
                                               ForBlocks for_blocks);
  FastCompositor(v1::MatteMetadata metadata, PrimaryMix mix, int width_px)
      : metadata_(std::move(metadata)),
        mix_(std::move(mix)),
        width_px_(width_px),
        textures_(footprint_textures(metadata_)) {}

  v1::MatteMetadata metadata_;
  PrimaryMix mix_;
  int width_px_;
  std::vector<FootprintTexture> textures_;
  std::vector<FootprintRow> rows_;
};

// The composite of a matte's file over one set of pictures, in the memory of these pictures, the composite,
// and a few rows of the matte. `edit` and errors as for FastCompositor; `progress` is called with the
// fraction done.
absl::StatusOr<RadianceImage> composite_file(std::string_view file,
                                             const std::vector<RadianceImage>& backgrounds,
                                             absl::FunctionRef<void(Matte&)> edit, int thread_count = 0,
                                             const std::function<void(double)>& progress = nullptr);

}  // namespace glasswing
