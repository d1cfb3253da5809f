// Dilation, hole filling and erosion of a mask, and specks out of it (Chuang et al. 2000, section 4.2). What
// lies outside the picture is background.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace glasswing {

struct MaskCleaning {
  int dilation_px = 0, erosion_px = 0;  // half sides of the squares; 0: not done
  bool fill_holes = true;
  int min_px = 0;  // what hangs together in fewer pixels is noise
};

// What was left out filled in: dilated by what closes gaps where the object happens to show what is behind
// it, 0.3 % of the diagonal; eroded as dilated; specks of less than the dilating square's area dropped.
MaskCleaning usual_cleaning(int width_px, int height_px, std::optional<int> dilation_px,
                            std::optional<int> erosion_px, std::optional<int> min_px = std::nullopt);

// `samples`: by rows, 0 or 255.
void clean_mask(std::span<std::uint8_t> samples, int width_px, int height_px, const MaskCleaning& cleaning);

}  // namespace glasswing
