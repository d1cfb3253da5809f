#include "core/matte/pyramid_share.h"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>

#include "core/base/status.h"
#include "core/matte/matte_file.h"
#include "core/matte/matte_notes.h"

namespace glasswing {

PyramidShare& PyramidShare::operator+=(const PyramidShare& other) {
  object += other.object;
  pixels += other.pixels;
  light += other.light;
  in_pyramids += other.in_pyramids;
  return *this;
}

PyramidShare pyramid_share(const Matte& matte) {
  PyramidShare share;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      if (matte.coverage(x, y) <= 0.0f) continue;
      ++share.object;
      share.pixels += matte.has_pyramid(x, y);
      for (int c = 0; c < kChannels; ++c) {
        for (const PyramidFootprint& pyramid : matte.pyramids(x, y, c)) {
          for (const Coefficient& own : pyramid.coefficients)
            share.in_pyramids += static_cast<double>(own.weight);
        }
        const auto add = [&](const Mode& mode) { share.light += static_cast<double>(mode.weight); };
        if (matte.pyramids(x, y, c).empty()) {
          std::ranges::for_each(matte.modes(x, y, c), add);
        } else {
          std::ranges::for_each(matte.gaussians(x, y, c), add);
        }
      }
    }
  }
  return share;
}

absl::StatusOr<PyramidShare> pyramid_share(std::string_view file) {
  PyramidShare share;
  GW_ASSIGN_OR_RETURN(const MatteOutline outline, outline_of(file));
  if (!outline.pyramids) return share;
  std::mutex mutex;
  GW_RETURN_IF_ERROR(for_blocks_of_matte(
      file, 0,
      [&](const Matte& rows) {
        const PyramidShare own = pyramid_share(rows);
        const std::lock_guard lock(mutex);
        share += own;
        return absl::OkStatus();
      },
      Pyramids::kKept));
  return share;
}

std::string lost_text(const PyramidShare& share, std::string_view holders) {
  if (share.pixels == 0) return "";
  return fmt::format(
      "{:.1f} % of the object's pixels, with {:.1f} % of its light, have footprints of any shape, which {} "
      "cannot hold: they show the closest Gaussians",
      100.0 * static_cast<double>(share.pixels) / static_cast<double>(share.object),
      share.light > 0.0 ? 100.0 * share.in_pyramids / share.light : 0.0, holders);
}

absl::Status tell_lost(std::string_view file, std::string_view holders) {
  GW_ASSIGN_OR_RETURN(const PyramidShare share, pyramid_share(file));
  tell_lost(share, holders);
  return absl::OkStatus();
}

void tell_lost(const PyramidShare& share, std::string_view holders) {
  if (const std::string text = lost_text(share, holders); !text.empty()) print_warnings({text});
}

}  // namespace glasswing
