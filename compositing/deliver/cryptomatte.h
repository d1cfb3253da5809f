// Which object a pixel shows, as compositors pick objects by name: Cryptomatte, specification 1.2
// (Psyop, 2018).
//
// Each pixel has pairs of an id and the share of the pixel that the object covers, the largest share first.
// An id is the MurmurHash3 (x86, 32 bits, seed 0) of the object's name in UTF-8, as the bits of a float; bit
// 23 is flipped if the result would not be a normal number. The header maps names to ids.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace glasswing {

std::uint32_t murmur3_32(std::string_view text);
// The id of a name, as bits and as the float that a file holds.
std::uint32_t cryptomatte_id(std::string_view name);

// An object and the share of each pixel that shows it, 0 to 1, by rows.
struct ObjectShares {
  std::string name;
  std::vector<float> share;
};

// Each layer of an EXR holds two of a pixel's objects; kMaxCryptomatteLayers hold the largest six.
inline constexpr int kMaxCryptomatteLayers = 3;

// The bytes of a 32-bit EXR: channels R, G, B, A of layers "object00", "object01" ..., and R, G, B, A, how
// much of each pixel all objects cover, for viewing. INVALID_ARGUMENT: no object, an empty or repeated name,
// two names with the same id, or shares whose number differs from the pixels.
absl::StatusOr<std::string> encode_cryptomatte(std::span<const ObjectShares> objects, int width_px,
                                               int height_px);

// A Cryptomatte of a whole picture: the layers of its file, and what its header says about them.
struct Cryptomatte {
  int width_px = 0, height_px = 0;
  std::map<std::string, std::string> attributes;  // "cryptomatte/..."
  std::vector<std::string> channels;              // sorted
  std::vector<std::vector<float>> planes;         // of each channel, by rows
};
// Reads the layers that the header names. DATA_LOSS names the file, if it cannot be read, is not a 32-bit
// Cryptomatte, or its data window is not the picture. NOT_FOUND: there is no such file.
absl::StatusOr<Cryptomatte> read_cryptomatte(const std::filesystem::path& file);

}  // namespace glasswing
