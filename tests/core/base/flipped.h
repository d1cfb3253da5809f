// A file with one byte altered at a time, as a failing disk or memory leaves it.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

namespace glasswing {

// Calls `look` with `bytes` but for one of them, at each place from `first` on, `step` apart: a bit of it
// flipped, its highest bit, all of them.
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
