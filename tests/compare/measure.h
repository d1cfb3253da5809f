// Solves a scene by a candidate and holds its composites against the photographs.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>

#include "tests/compare/candidate.h"
#include "tests/compare/figures.h"

namespace glasswing {

// Where a candidate's composite lies: 16-bit linear PNG.
std::filesystem::path composite_path(const std::filesystem::path& folder, const std::string& scene,
                                     const std::string& family, const std::string& variant,
                                     const std::string& photograph);

// At that level of noise, which comes on top of the summed frames of `capture`. Frames that the method does
// not read count as not taken. Composites of clean frames are written below `folder`.
absl::StatusOr<Figures> measure(const RenderedScene& scene, const Candidate& candidate,
                                const MadeCapture& capture, const NoiseLevel& noise,
                                const std::filesystem::path& folder);

// The photographs without the object.
Figures measure_bare(const RenderedScene& scene);

}  // namespace glasswing
