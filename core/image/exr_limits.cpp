#include "core/image/exr_limits.h"

#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <optional>

#include "core/base/status.h"

namespace glasswing {
namespace {

// The rest of the headers.
class Headers {
 public:
  explicit Headers(std::string_view bytes) : rest_(bytes) {}

  std::optional<std::string_view> take(size_t size) {
    if (rest_.size() < size) return std::nullopt;
    const std::string_view taken = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return taken;
  }
  std::optional<std::uint32_t> take_word() {
    const std::optional<std::string_view> bytes = take(sizeof(std::uint32_t));
    if (!bytes) return std::nullopt;
    std::uint32_t word = 0;
    std::memcpy(&word, bytes->data(), sizeof word);
    return word;
  }
  // Up to and including its zero.
  std::optional<std::string_view> take_name() {
    const size_t end = rest_.find('\0');
    if (end == std::string_view::npos) return std::nullopt;
    const std::string_view name = rest_.substr(0, end);
    rest_.remove_prefix(end + 1);
    return name;
  }

 private:
  std::string_view rest_;
};

constexpr std::uint32_t kMagic = 20000630, kMultiPart = 0x1000;

absl::Status cut_short() {
  return absl::DataLossError("its headers do not end within it");
}

// Each entry of a list of channels is a name and 16 bytes; an empty name ends it.
int channels_in(std::string_view list) {
  constexpr size_t kAfterName = 16;
  int count = 0;
  for (Headers rest(list); count <= kMaxExrChannels; ++count) {
    const std::optional<std::string_view> name = rest.take_name();
    if (!name || name->empty() || !rest.take(kAfterName)) break;
  }
  return count;
}

}  // namespace

absl::Status check_exr_limits(std::string_view bytes) {
  Headers headers(bytes);
  if (headers.take_word() != kMagic) return absl::OkStatus();
  const std::optional<std::uint32_t> version = headers.take_word();
  if (!version) return cut_short();
  int channels = 0;
  for (int parts = 0;; ++parts) {
    std::optional<std::string_view> name = headers.take_name();
    if (!name) return cut_short();
    if (name->empty()) return absl::OkStatus();  // past the last header
    if (parts == kMaxExrParts)
      return absl::InvalidArgumentError(fmt::format("it has more than {} parts", kMaxExrParts));
    while (!name->empty()) {
      const std::optional<std::string_view> type = headers.take_name();
      const std::optional<std::uint32_t> size = headers.take_word();
      const std::optional<std::string_view> value = size ? headers.take(*size) : std::nullopt;
      if (!type || !value) return cut_short();
      if (*type == "chlist") channels += channels_in(*value);
      if (channels > kMaxExrChannels)
        return absl::InvalidArgumentError(fmt::format("it has more than {} channels", kMaxExrChannels));
      if (!(name = headers.take_name())) return cut_short();
    }
    if ((*version & kMultiPart) == 0) return absl::OkStatus();
  }
}

}  // namespace glasswing
