#include "compositing/dataset/npz.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <zlib.h>

#include <bit>
#include <utility>

#include "core/base/status.h"

namespace glasswing {
namespace {

static_assert(std::endian::native == std::endian::little);

template <typename Value>
NumpyArray array_of(const char* type, std::span<const Value> values, std::vector<std::int64_t> shape) {
  return {.type = type,
          .shape = std::move(shape),
          .bytes = {reinterpret_cast<const char*>(values.data()), values.size_bytes()}};
}

// Little-endian numbers, one after the other.
class Record {
 public:
  Record& u16(std::uint64_t value) { return add(value, 2); }
  Record& u32(std::uint64_t value) { return add(value, 4); }
  Record& u64(std::uint64_t value) { return add(value, 8); }
  Record& text(std::string_view text) {
    bytes_ += text;
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  Record& add(std::uint64_t value, int size) {
    for (int i = 0; i < size; ++i) bytes_ += static_cast<char>((value >> (8 * i)) & 0xff);
    return *this;
  }
  std::string bytes_;
};

constexpr std::uint64_t kIn64 = 0xffffffff;       // the number stands in the extra field
constexpr std::uint64_t kVersion = 45;            // ZIP64
constexpr std::uint64_t kNewYear1980 = 0x210000;  // time and date: the same arrays give the same bytes

std::uint32_t checksum_of(std::string_view header, std::string_view data) {
  uLong crc = crc32(0, nullptr, 0);
  for (const std::string_view part : {header, data})
    crc = crc32_z(crc, reinterpret_cast<const Bytef*>(part.data()), part.size());
  return static_cast<std::uint32_t>(crc);
}

}  // namespace

NumpyArray numpy_array(std::span<const float> values, std::vector<std::int64_t> shape) {
  return array_of("<f4", values, std::move(shape));
}
NumpyArray numpy_array(std::span<const double> values, std::vector<std::int64_t> shape) {
  return array_of("<f8", values, std::move(shape));
}
NumpyArray numpy_array(std::span<const std::int32_t> values, std::vector<std::int64_t> shape) {
  return array_of("<i4", values, std::move(shape));
}
NumpyArray numpy_array(std::span<const std::int64_t> values, std::vector<std::int64_t> shape) {
  return array_of("<i8", values, std::move(shape));
}
NumpyArray numpy_array(std::span<const std::uint8_t> values, std::vector<std::int64_t> shape) {
  return array_of("|u1", values, std::move(shape));
}
NumpyArray numpy_text(std::string_view text) {
  return {.type = fmt::format("|S{}", text.size()), .shape = {}, .bytes = text};
}

std::string npy_header(const NumpyArray& array) {
  // A tuple of one number needs its comma.
  std::string header = fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}{}), }}", array.type,
                                   fmt::join(array.shape, ", "), array.shape.size() == 1 ? "," : "");
  constexpr size_t kBefore = 10, kAligned = 64;
  header.append(kAligned - (kBefore + header.size() + 1) % kAligned, ' ');
  header += '\n';
  return Record()
      .text("\x93NUMPY\x01")
      .text(std::string_view("\0", 1))
      .u16(header.size())
      .text(header)
      .bytes();
}

absl::Status write_npy(const std::filesystem::path& path, const NumpyArray& array) {
  return write_file_durably(path, npy_header(array) + std::string(array.bytes));
}

absl::StatusOr<NpzWriter> NpzWriter::create(const std::filesystem::path& path) {
  GW_ASSIGN_OR_RETURN(FileWriter file, FileWriter::create(path.string() + ".tmp"));
  return NpzWriter(path, std::move(file));
}

absl::Status NpzWriter::add(const std::string& name, const NumpyArray& array) {
  const std::string header = npy_header(array);
  const Entry entry{.name = name + ".npy",
                    .offset = written_,
                    .size = header.size() + array.bytes.size(),
                    .checksum = checksum_of(header, array.bytes)};
  Record local;
  local.u32(0x04034b50).u16(kVersion).u16(0).u16(0).u32(kNewYear1980).u32(entry.checksum);
  local.u32(kIn64).u32(kIn64).u16(entry.name.size()).u16(20).text(entry.name);
  local.u16(1).u16(16).u64(entry.size).u64(entry.size);
  for (const std::string_view part :
       {std::string_view(local.bytes()), std::string_view(header), array.bytes}) {
    GW_RETURN_IF_ERROR(file_.add(part));
    written_ += part.size();
  }
  entries_.push_back(entry);
  return absl::OkStatus();
}

absl::Status NpzWriter::finish() {
  Record end;
  for (const Entry& entry : entries_) {
    end.u32(0x02014b50).u16(kVersion).u16(kVersion).u16(0).u16(0).u32(kNewYear1980).u32(entry.checksum);
    end.u32(kIn64).u32(kIn64).u16(entry.name.size()).u16(28).u16(0).u16(0).u16(0).u32(0).u32(kIn64);
    end.text(entry.name).u16(1).u16(24).u64(entry.size).u64(entry.size).u64(entry.offset);
  }
  const std::uint64_t size = end.bytes().size(), count = entries_.size(), first = written_;
  end.u32(0x06064b50).u64(44).u16(kVersion).u16(kVersion).u32(0).u32(0).u64(count).u64(count);
  end.u64(size).u64(first);
  end.u32(0x07064b50).u32(0).u64(first + size).u32(1);
  end.u32(0x06054b50).u16(0).u16(0).u16(0xffff).u16(0xffff).u32(kIn64).u32(kIn64).u16(0);
  GW_RETURN_IF_ERROR(file_.add(end.bytes()));
  return place_file_durably(file_.path(), path_);
}

}  // namespace glasswing
