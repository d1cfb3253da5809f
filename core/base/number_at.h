// Numbers in the headers of files.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace glasswing {

// The number in `size_bytes` bytes, at most 8, from byte `at` on; none: the bytes end before it.
inline std::optional<std::uint64_t> number_at(std::string_view bytes, size_t at, size_t size_bytes,
                                              std::endian order) {
  if (at > bytes.size() || bytes.size() - at < size_bytes) return std::nullopt;
  std::uint64_t value = 0;
  for (size_t i = 0; i < size_bytes; ++i) {
    const size_t place = order == std::endian::big ? at + i : at + size_bytes - 1 - i;
    value = value << 8 | static_cast<unsigned char>(bytes[place]);
  }
  return value;
}

}  // namespace glasswing
