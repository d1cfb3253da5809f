#include "core/base/checksum.h"

#include <fmt/format.h>
#include <xxhash.h>

namespace glasswing {
namespace {

std::string text_of(std::uint64_t checksum) {
  return fmt::format("xxh3:{:016x}", checksum);
}

}  // namespace

std::string checksum_of(std::string_view bytes) {
  return text_of(XXH3_64bits(bytes.data(), bytes.size()));
}

void RunningChecksum::Free::operator()(void* state) const {
  XXH3_freeState(static_cast<XXH3_state_t*>(state));
}

RunningChecksum::RunningChecksum() : state_(XXH3_createState()) {
  start();
}

void RunningChecksum::start() {
  XXH3_64bits_reset(static_cast<XXH3_state_t*>(state_.get()));
}

void RunningChecksum::add(std::string_view bytes) {
  XXH3_64bits_update(static_cast<XXH3_state_t*>(state_.get()), bytes.data(), bytes.size());
}

std::uint64_t RunningChecksum::value() const {
  return XXH3_64bits_digest(static_cast<const XXH3_state_t*>(state_.get()));
}

std::string RunningChecksum::text() const {
  return text_of(value());
}

}  // namespace glasswing
