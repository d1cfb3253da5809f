// Which object a pixel shows, as compositors pick objects by name: Cryptomatte, specification 1.2
// (Psyop, 2018).
//
// Each pixel has pairs of an id and the share of the pixel that the object covers, the largest share first.
// An id is the MurmurHash3 (x86, 32 bits, seed 0) of the object's name in UTF-8, as the bits of a float; bit
// 23 is flipped where that would be no normal number. The header maps names to ids.
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

// For each layer of an EXR two of a pixel's objects are told; kMaxCryptomatteLayers hold the largest six.
inline constexpr int kMaxCryptomatteLayers = 3;

// The bytes of an EXR of 32 bits: channels R, G, B, A of layers "object00", "object01" ..., and R, G, B, A,
// how much of each pixel all objects cover, to look at. INVALID_ARGUMENT: no object, a name that is empty or
// there twice, two names of the same id, or shares that are not as many as the pixels.
absl::StatusOr<std::string> encode_cryptomatte(std::span<const ObjectShares> objects, int width_px,
                                               int height_px);

// A Cryptomatte of a whole picture: the layers of its file, and what its header says of them.
struct Cryptomatte {
  int width_px = 0, height_px = 0;
  std::map<std::string, std::string> attributes;  // "cryptomatte/..."
  std::vector<std::string> channels;              // sorted
  std::vector<std::vector<float>> planes;         // of each channel, by rows
};
// Reads the layers that the header names. DATA_LOSS names the file, if it cannot be read, is no Cryptomatte
// of 32 bits, or its data window is not the picture. NOT_FOUND: there is no such file.
absl::StatusOr<Cryptomatte> read_cryptomatte(const std::filesystem::path& file);

}  // namespace glasswing
