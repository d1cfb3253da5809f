// Composites beside the photograph, as in the paper's figures 5 and 6.
#pragma once

#include <absl/status/status.h>

#include <filesystem>
#include <vector>

#include "tests/compare/figures.h"

namespace glasswing {

// Writes two PNGs per row from the composites that measure() left in `composites`: comparison_*.png there
// shows them beside the photograph, light with gamma 2.2; docs/pictures/comparison_*.png shows their
// differences, times eight, since the photographs must not be published. Composites that were not measured
// are left out. NOT_FOUND names a missing composite.
absl::Status write_picture_rows(const std::filesystem::path& scenes, const std::filesystem::path& docs,
                                const std::filesystem::path& composites, const std::vector<Figures>& figures);

}  // namespace glasswing
