// Tables, charts and rows of pictures from the measurements.
#pragma once

#include <absl/status/status.h>

#include <filesystem>
#include <vector>

#include "tests/compare/figures.h"

namespace glasswing {

// Fills the tables between the marks of docs/comparison.md, and writes docs/pictures/comparison_*.
// `composites`: the folder that measure() wrote to.
absl::Status write_report(const std::filesystem::path& scenes, const std::filesystem::path& docs,
                          const std::filesystem::path& composites, const std::vector<Figures>& figures);

}  // namespace glasswing
