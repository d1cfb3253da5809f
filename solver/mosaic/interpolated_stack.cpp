#include "solver/mosaic/interpolated_stack.h"

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <utility>

namespace glasswing {

FrameStack interpolated_rows(const FrameStack& stack, const std::vector<int>& needed, int first, int count) {
  const size_t width = stack.width_px;
  const int last = stack.row_count - 1;
  // The mosaic counts from an even row of the picture.
  const int above = kInterpolationReach + (stack.first_row + first - kInterpolationReach) % 2;
  Image16 sites(stack.width_px, above + count + kInterpolationReach, 1);
  const size_t band_samples = width * static_cast<size_t>(count) * kChannels;
  const auto samples = std::make_shared<std::vector<std::uint16_t>>();
  samples->reserve(needed.size() * band_samples);
  FrameStack band = stack;
  band.first_row = stack.first_row + first;
  band.row_count = count;
  band.mosaic.reset();
  band.rows.assign(stack.rows.size(), {});
  for (const int frame : needed) {
    const size_t at = frame;
    for (int y = 0; y < sites.height_px; ++y) {
      const int mirrored = last - std::abs(last - std::abs(first - above + y));
      const size_t row = std::clamp(mirrored, 0, last);
      std::ranges::copy(stack.rows[at].subspan(row * width, width),
                        sites.samples.begin() + static_cast<size_t>(y) * width);
    }
    const Image16 colours = interpolated(sites, stack.mosaic);
    const auto begin = colours.samples.begin() + static_cast<size_t>(above) * width * kChannels;
    const size_t start = samples->size();
    samples->insert(samples->end(), begin, begin + static_cast<std::ptrdiff_t>(band_samples));
    band.rows[at] = std::span(*samples).subspan(start);  // stays valid: enough was reserved
  }
  band.owner = samples;
  return band;
}

}  // namespace glasswing
