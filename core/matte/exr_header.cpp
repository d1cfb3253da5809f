#include "core/matte/exr_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>

namespace glasswing {
namespace {

class HeaderWalk {
 public:
  explicit HeaderWalk(std::string_view bytes) : bytes_(bytes) {}

  absl::StatusOr<size_t> check() {
    for (int parts = 0;; ++parts) {
      std::string_view name;
      if (!take_name(&name)) return damaged();
      if (name.empty()) break;  // no attribute: past the last header
      if (parts == kMaxParts) return absl::DataLossError(fmt::format("it has more than {} parts", kMaxParts));
      for (; !name.empty();) {
        if (!take_attribute(name) || !take_name(&name)) return damaged();
      }
    }
    if (chunk_count_ > static_cast<std::int64_t>((bytes_.size() - at_) / 8)) return damaged();
    return at_;
  }

 private:
  static absl::Status damaged() {
    return absl::DataLossError("it is damaged or not a matte: its header is not that of a matte");
  }

  bool take(size_t size, std::string_view* taken) {
    if (at_ > bytes_.size() || bytes_.size() - at_ < size) return false;
    *taken = bytes_.substr(at_, size);
    at_ += size;
    return true;
  }
  bool take_int(std::int32_t* value) {
    std::string_view taken;
    if (!take(sizeof *value, &taken)) return false;
    std::memcpy(value, taken.data(), sizeof *value);
    return true;
  }
  bool take_name(std::string_view* name) {
    constexpr size_t kMaxName = 255;
    const size_t end = at_ < bytes_.size() ? bytes_.find('\0', at_) : std::string_view::npos;
    return end != std::string_view::npos && end - at_ <= kMaxName && take(end - at_, name) && ++at_ > 0;
  }
  // A list of channels ends with an empty name and nothing after it.
  bool take_channels(size_t size) {
    const size_t end = at_ + size;
    constexpr size_t kAfterName = 16;
    for (std::string_view name, rest; take_name(&name) && at_ <= end;) {
      if (name.empty()) return at_ == end;
      if (!take(kAfterName, &rest)) break;
    }
    return false;
  }
  static std::uint32_t word(std::string_view value, size_t at) {
    std::uint32_t number = 0;
    std::memcpy(&number, value.data() + at, sizeof number);
    return number;
  }
  // Sides, then the mode of levels, which is 0 if there is one.
  static bool are_tiles(std::string_view value) {
    const auto good = [](std::uint32_t side) { return side >= 1 && side <= kMaxTile_px; };
    return good(word(value, 0)) && good(word(value, 4)) && value[8] == 0;
  }
  // Sides, then four bytes for each pixel.
  static bool is_preview(std::string_view value) {
    constexpr std::uint32_t kMaxSide = 1024;
    if (value.size() < 8) return false;
    const std::uint32_t width = word(value, 0), height = word(value, 4);
    return width <= kMaxSide && height <= kMaxSide && value.size() == 8 + size_t{4} * width * height;
  }
  bool take_attribute(std::string_view name) {
    struct Type {
      std::string_view name;
      std::int32_t size;
    };
    constexpr std::array<Type, 7> kTypes{{{"box2i", 16},
                                          {"compression", 1},
                                          {"float", 4},
                                          {"int", 4},
                                          {"lineOrder", 1},
                                          {"tiledesc", 9},
                                          {"v2f", 8}}};
    std::string_view type, value;
    std::int32_t size = 0;
    if (!take_name(&type) || !take_int(&size) || size < 0) return false;
    if (type == "chlist") return take_channels(static_cast<size_t>(size));
    const size_t start = at_;
    if (!take(static_cast<size_t>(size), &value)) return false;
    if (type == "string") return true;
    if (type == "preview") return is_preview(value);
    const auto known = std::ranges::find(kTypes, type, &Type::name);
    if (known == kTypes.end() || known->size != size) return false;
    if (type == "tiledesc" && !are_tiles(value)) return false;
    if (name == "chunkCount") {
      std::int32_t count = 0;
      std::memcpy(&count, &bytes_[start], sizeof count);
      if (type != "int" || count < 0) return false;
      chunk_count_ += count;
    }
    return true;
  }

  static constexpr int kMaxParts = 64;  // several times those of a matte, or of rays
  const std::string_view bytes_;
  size_t at_ = 8;  // past magic number and version
  std::int64_t chunk_count_ = 0;
};

}  // namespace

absl::StatusOr<size_t> check_exr_header(std::string_view bytes) {
  return HeaderWalk(bytes).check();
}

}  // namespace glasswing
