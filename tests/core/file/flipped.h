// Copies of a file with one byte altered, as a failing disk or memory leaves it.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

namespace glasswing {

// Calls `look` with copies of `bytes` in which one byte is altered, for every `step`-th byte from `first` on:
// its lowest bit flipped, its highest bit, all bits.
inline void for_each_flip(const std::string& bytes, size_t first, size_t step,
                          const std::function<void(const std::string& altered, size_t at)>& look) {
  for (size_t at = first; at < bytes.size(); at += step) {
    for (const unsigned flip : {1u << (at % 7), 0x80u, 0xffu}) {
      std::string altered = bytes;
      altered[at] = static_cast<char>(static_cast<unsigned char>(altered[at]) ^ flip);
      look(altered, at);
    }
  }
}

}  // namespace glasswing
