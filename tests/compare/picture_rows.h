// Composites beside the photograph, as in the paper's figures 5 and 6.
#pragma once

#include <absl/status/status.h>

#include <filesystem>
#include <vector>

#include "tests/compare/figures.h"

namespace glasswing {

// Two PNG a row, of the composites that measure() left in `composites`: comparison_*.png there shows them
// beside the photograph, light with gamma 2.2; docs/pictures/comparison_*.png how far they are from it, times
// eight, since the photographs are not ours to publish. What was not measured is left out. NOT_FOUND names a
// composite that should be there.
absl::Status write_picture_rows(const std::filesystem::path& scenes, const std::filesystem::path& docs,
                                const std::filesystem::path& composites, const std::vector<Figures>& figures);

}  // namespace glasswing
