// Solves a scene with a candidate and compares its composites with the photographs.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>

#include "tests/compare/candidate.h"
#include "tests/compare/figures.h"

namespace glasswing {

// The path of a candidate's composite, a 16-bit linear PNG.
std::filesystem::path composite_path(const std::filesystem::path& folder, const std::string& scene,
                                     const std::string& family, const std::string& variant,
                                     const std::string& photograph);

// Measures at this level of noise, which is added to the summed frames of `capture`. Frames that the method
// does not read do not count as images. Composites of clean frames are written below `folder`.
absl::StatusOr<Figures> measure(const RenderedScene& scene, const Candidate& candidate,
                                const SynthesizedCapture& capture, const NoiseLevel& noise,
                                const std::filesystem::path& folder);

// Measures the photographs without the object.
Figures measure_bare(const RenderedScene& scene);

}  // namespace glasswing
