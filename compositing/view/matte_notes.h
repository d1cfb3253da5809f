// What users should know of a matte beside its pixels: its warnings and the shares of its flags, in the same
// words wherever a matte is read.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "core/matte/matte.h"

namespace glasswing {

// On standard error, a line each.
void print_warnings(const v1::MatteMetadata& metadata);

// The shares of flags, on standard output; nothing if there are none.
void print_flagged(const PixelCount& count);

// "warnings", and "flagged": the object's pixels by their most serious flag.
void add_notes(const v1::MatteMetadata& metadata, const PixelCount& count, nlohmann::ordered_json& written);

}  // namespace glasswing
