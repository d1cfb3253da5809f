// XXH3-64: against damage, not against malice.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace glasswing {

// "xxh3:" and 16 hex digits.
std::string checksum_of(std::string_view bytes);

// The checksum of bytes that arrive in pieces.
class RunningChecksum {
 public:
  RunningChecksum();
  void add(std::string_view bytes);
  std::uint64_t value() const;  // of all bytes since the last start()
  std::string text() const;     // as checksum_of()
  void start();

 private:
  struct Free {
    void operator()(void* state) const;
  };
  std::unique_ptr<void, Free> state_;
};

}  // namespace glasswing
