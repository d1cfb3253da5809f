// What users should know about a matte in addition to its pixels: its warnings and the shares of its flags,
// in the same words wherever a matte is made or read.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "core/matte/matte.h"

namespace glasswing {

// Adds those of a matte that are not present yet, up to 50: most of a video's frames have the same ones.
void note_warnings(const v1::MatteMetadata& metadata, std::vector<std::string>& warnings);
std::vector<std::string> warnings_of(const v1::MatteMetadata& metadata);

// On standard error, one per line.
void print_warnings(const std::vector<std::string>& warnings);

// The shares of flags, on standard output; nothing if there are none.
void print_flagged(const PixelCount& count);

// "warnings", and "flagged": the object's pixels by their most serious flag.
void add_notes(const std::vector<std::string>& warnings, const PixelCount& count,
               nlohmann::ordered_json& written);

}  // namespace glasswing
