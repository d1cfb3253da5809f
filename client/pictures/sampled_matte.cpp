#include "client/pictures/sampled_matte.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "core/base/status.h"

namespace glasswing {

absl::StatusOr<SampledMatte> sample_matte(std::string_view file, double max_pixels) {
  SampledMatte sampled;
  GW_ASSIGN_OR_RETURN(sampled.outline, outline_of(file));
  const MatteOutline& outline = sampled.outline;
  const double pixels = static_cast<double>(outline.width_px) * outline.height_px;
  sampled.step = std::max(1, static_cast<int>(std::ceil(std::sqrt(pixels / max_pixels))));
  const int step = sampled.step;
  const auto fewer = [step](int length) { return (length + step - 1) / step; };
  Matte& matte = sampled.matte = Matte(0, 0, fewer(outline.width_px), fewer(outline.height_px),
                                       outline.modes_per_channel, outline.colourless);
  matte.metadata = outline.metadata;
  std::mutex mutex;
  GW_RETURN_IF_ERROR(for_blocks_of_matte(file, 0, [&](const Matte& rows) {
    const int top = rows.y0_px() - outline.y0_px;
    for (int y = (step - top % step) % step; y < rows.height_px(); y += step) {
      for (int x = 0; x < rows.width_px(); x += step) {
        const int to_x = x / step, to_y = (top + y) / step;
        matte.foreground(to_x, to_y) = rows.foreground(x, y);
        matte.coverage(to_x, to_y) = rows.coverage(x, y);
        matte.flags(to_x, to_y) = rows.flags(x, y);
        for (int c = 0; c < (rows.is_colourless() ? 1 : kChannels); ++c)
          std::ranges::copy(rows.modes(x, y, c), matte.modes(to_x, to_y, c).begin());
      }
    }
    const PixelCount count = count_pixels(rows);
    const std::lock_guard lock(mutex);
    sampled.pixels.object += count.object;
    sampled.pixels.flagged += count.flagged;
    sampled.pixels.unsolved += count.unsolved;
    return absl::OkStatus();
  }));
  return sampled;
}

}  // namespace glasswing
