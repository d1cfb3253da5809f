// Archives that hold several sequences of frames, each in a folder of its own.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// Pictures (PNG, JPEG, TIFF) whose names end in a number, by that number. Empty where there are none.
std::vector<std::filesystem::path> numbered_pictures(const std::filesystem::path& directory);

// How many numbers between the first and the last of these have no picture; 0 where they are no numbers that
// can be counted.
std::int64_t missing_numbers(const std::vector<std::filesystem::path>& numbered);

// The frames of one sequence, as a manifest: those of DIR/NAME in the order of their numbers, with the
// object; and of DIR/bg those without it. What a sequence shows is its name's first word, "ramp"; its
// backgrounds are named after that word and as many of the name's last words as can be had: of
// ramp_dark_noise ramp_dark_noise, ramp_noise or ramp, with a number or without. NOT_FOUND lists the
// sequences that there are.
absl::StatusOr<v1::CaptureManifest> read_sequence(const std::filesystem::path& directory,
                                                  const std::string& name);

}  // namespace glasswing
