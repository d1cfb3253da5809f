// Cleans a mask: dilation, hole filling, erosion and removal of specks (Chuang et al. 2000, section 4.2).
// Everything outside the picture is background.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace glasswing {

struct MaskCleaning {
  int dilation_px = 0, erosion_px = 0;  // half sides of the squares; 0: skipped
  bool fill_holes = true;
  int min_px = 0;  // smaller connected regions are noise
};

// Fills in the defaults: dilation by 0.3 % of the diagonal, which closes gaps where the object happens to
// look like its background; erosion equal to dilation; specks smaller than the dilating square dropped.
MaskCleaning usual_cleaning(int width_px, int height_px, std::optional<int> dilation_px,
                            std::optional<int> erosion_px, std::optional<int> min_px = std::nullopt);

// `samples`: by rows, 0 or 255.
void clean_mask(std::span<std::uint8_t> samples, int width_px, int height_px, const MaskCleaning& cleaning);

}  // namespace glasswing
