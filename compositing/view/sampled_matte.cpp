#include "compositing/view/sampled_matte.h"

#include <mutex>

#include "core/base/status.h"
#include "core/matte/matte_region.h"

namespace glasswing {

absl::StatusOr<SampledMatte> sample_matte(std::string_view file, std::int64_t max_pixels) {
  SampledMatte sampled;
  GW_ASSIGN_OR_RETURN(sampled.outline, outline_of(file));
  const MatteOutline& outline = sampled.outline;
  const int step = sampled.step = sampling_step(outline.width_px, outline.height_px, max_pixels);
  Matte& matte = sampled.matte =
      Matte(0, 0, sampled_length(outline.width_px, step), sampled_length(outline.height_px, step),
            outline.modes_per_channel, outline.colourless);
  matte.metadata = outline.metadata;
  std::mutex mutex;
  GW_RETURN_IF_ERROR(for_blocks_of_matte(
      file, 0,
      [&](const Matte& rows) {
        const int top = rows.y0_px() - outline.y0_px;
        const PixelCount count = count_pixels(rows);
        const std::lock_guard lock(mutex);  // pyramids are not in arrays
        for (int y = (step - top % step) % step; y < rows.height_px(); y += step) {
          for (int x = 0; x < rows.width_px(); x += step)
            matte.copy_pixel(rows, x, y, x / step, (top + y) / step);
        }
        sampled.pixels += count;
        return absl::OkStatus();
      },
      Pyramids::kKept));
  return sampled;
}

}  // namespace glasswing
