// Runs of pixels in masks of bytes, 0 or 255.
#pragma once

#include <cstdint>
#include <cstring>

namespace glasswing {

// The next 255 in [from, to); `to` if none.
inline const std::uint8_t* next_set(const std::uint8_t* from, const std::uint8_t* to) {
  const void* const found = std::memchr(from, 255, static_cast<size_t>(to - from));
  return found == nullptr ? to : static_cast<const std::uint8_t*>(found);
}

inline const std::uint8_t* next_clear(const std::uint8_t* from, const std::uint8_t* to) {
  const void* const found = std::memchr(from, 0, static_cast<size_t>(to - from));
  return found == nullptr ? to : static_cast<const std::uint8_t*>(found);
}

}  // namespace glasswing
