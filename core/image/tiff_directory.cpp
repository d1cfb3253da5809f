#include "core/image/tiff_directory.h"

#include <array>

#include "core/base/number_at.h"

namespace glasswing {
namespace {

constexpr std::uint64_t kTiff = 42, kBigTiff = 43;
constexpr std::uint64_t kTypeAscii = 2, kTypeRational = 5;

// Bytes of a number of this type; 0: another type.
size_t size_of(std::uint64_t type) {
  constexpr std::uint64_t kShort = 3, kLong = 4, kIfd = 13, kLong8 = 16, kIfd8 = 18;
  if (type == kShort) return 2;
  if (type == kLong || type == kIfd) return 4;
  return type == kLong8 || type == kIfd8 ? 8 : 0;
}

}  // namespace

bool is_tiff(std::string_view bytes) {
  return bytes.starts_with("II") || bytes.starts_with("MM");
}

TiffDirectory::TiffDirectory(std::string_view bytes)
    : bytes_(bytes), order_(bytes.starts_with("MM") ? std::endian::big : std::endian::little) {
  if (!is_tiff(bytes)) return;
  const std::optional<std::uint64_t> kind = at(2, 2);
  big_ = kind == kBigTiff;
  if (kind == kTiff || big_) *this = TiffDirectory(*this, at(big_ ? 8 : 4, big_ ? 8 : 4).value_or(0));
}

TiffDirectory::TiffDirectory(const TiffDirectory& file, std::uint64_t offset)
    : bytes_(file.bytes_), order_(file.order_), big_(file.big_) {
  const size_t count_bytes = big_ ? 8 : 2;
  const std::optional<std::uint64_t> count = at(offset, count_bytes);
  if (!count) return;
  entries_ = offset + count_bytes;
  count_ = *count;
}

TiffDirectory TiffDirectory::inner(Tag tag) const {
  return {*this, number(tag).value_or(bytes_.size())};
}

bool TiffDirectory::is_whole() const {
  const size_t word = big_ ? 8 : 4, entry_bytes = 4 + 2 * word;
  constexpr std::array<std::uint64_t, 14> kBytes{1, 1, 1, 2, 4, 8, 1,
                                                 1, 2, 4, 8, 4, 8, 4};  // by type, TIFF 6.0
  for (size_t place = entries_, i = 0; i < count_; ++i, place += entry_bytes) {
    const auto type = at(place + 2, 2), count = at(place + 4, word), value = at(place + 4 + word, word);
    if (!type || !count || !value) return false;
    const std::uint64_t bytes = *type < kBytes.size() ? kBytes[*type] : 8;
    if (*count > word / bytes && (*count > bytes_.size() / bytes || *value > bytes_.size() - *count * bytes))
      return false;
  }
  return true;
}

std::optional<std::uint64_t> TiffDirectory::number(Tag tag) const {
  const std::optional<Values> found = values(tag);
  if (!found || size_of(found->type) == 0) return std::nullopt;
  return at(found->place, size_of(found->type));
}

std::string TiffDirectory::with_number(Tag tag, std::uint64_t value) const {
  if (!number(tag)) return "";
  std::string bytes(bytes_);
  const Values found = *values(tag);
  const size_t size_bytes = size_of(found.type);
  for (size_t i = 0; i < size_bytes; ++i, value >>= 8)
    bytes[found.place + (order_ == std::endian::big ? size_bytes - 1 - i : i)] = static_cast<char>(value);
  return bytes;
}

std::optional<double> TiffDirectory::ratio(Tag tag) const {
  const std::optional<Values> found = values(tag);
  if (!found || found->type != kTypeRational) return std::nullopt;
  const std::optional<std::uint64_t> numerator = at(found->place, 4), denominator = at(found->place + 4, 4);
  if (!numerator || denominator.value_or(0) == 0) return std::nullopt;
  return static_cast<double>(*numerator) / static_cast<double>(*denominator);
}

std::string TiffDirectory::text(Tag tag) const {
  const std::optional<Values> found = values(tag);
  if (!found || found->type != kTypeAscii || found->place > bytes_.size()) return "";
  const std::string_view text = bytes_.substr(found->place, found->count);
  return std::string(text.substr(0, text.find('\0')));
}

std::optional<std::uint64_t> TiffDirectory::at(size_t offset, size_t size_bytes) const {
  return number_at(bytes_, offset, size_bytes, order_);
}

std::optional<TiffDirectory::Values> TiffDirectory::values(Tag tag) const {
  const size_t word = big_ ? 8 : 4, entry_bytes = 4 + 2 * word;
  std::optional<size_t> entry;
  for (size_t place = entries_, i = 0; i < count_ && place < bytes_.size(); ++i, place += entry_bytes) {
    if (at(place, 2) != tag) continue;
    if (entry) return std::nullopt;
    entry = place;
  }
  if (!entry) return std::nullopt;
  Values found{.type = at(*entry + 2, 2).value_or(0), .count = at(*entry + 4, word).value_or(0)};
  found.place = *entry + 4 + word;
  const std::uint64_t value_bytes = found.type == kTypeAscii      ? 1
                                    : found.type == kTypeRational ? 8
                                                                  : size_of(found.type);
  if (found.count > word / std::max<std::uint64_t>(value_bytes, 1))
    found.place = at(found.place, word).value_or(bytes_.size());
  return found;
}

}  // namespace glasswing
