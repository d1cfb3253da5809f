// Archives with several sequences of frames, one folder each.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// Pictures (PNG, JPEG, TIFF) whose names end in a number, sorted by that number.
std::vector<std::filesystem::path> numbered_pictures(const std::filesystem::path& directory);

// How many numbers between the first and the last have no picture; 0 for numbers of more than 15 digits.
std::int64_t missing_numbers(const std::vector<std::filesystem::path>& numbered);

// The frames of one sequence, as a manifest: first those of DIR/bg, without the object, then those of
// DIR/NAME in the order of their numbers, with it. The first word of a sequence's name is its stimulus,
// "ramp". Its backgrounds are named after that word and as many trailing words of the name as match: for
// ramp_dark_noise these are ramp_dark_noise, ramp_noise or ramp, with or without a number. NOT_FOUND lists
// the sequences.
absl::StatusOr<v1::CaptureManifest> read_sequence(const std::filesystem::path& directory,
                                                  const std::string& name);

}  // namespace glasswing
