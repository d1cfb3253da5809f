// The first directory of a TIFF 6.0 or BigTIFF, and directories that it names. EXIF data have the same form.
#pragma once

#include <bit>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace glasswing {

bool is_tiff(std::string_view bytes);

class TiffDirectory {
 public:
  enum Tag : std::uint16_t {
    kWidth = 256,
    kHeight = 257,
    kBits = 258,  // of a sample
    kPhotometric = 262,
    kOrientation = 274,
    kSamples = 277,
    kPlanar = 284,
    kTileWidth = 322,
    kInner = 330,  // where directories of other pictures lie
    kFormat = 339,
    kExposureTime = 0x829A,   // s
    kExif = 0x8769,           // where the directory of EXIF's own tags lies
    kIso = 0x8827,            // PhotographicSensitivity
    kDateTaken = 0x9003,      // DateTimeOriginal
    kSubsecondTaken = 0x9291  // digits after the point
  };

  // `bytes`: the file's; the directory keeps a view of them. Without entries if there is no directory.
  explicit TiffDirectory(std::string_view bytes);
  // The directory that an entry names; without entries if there is none.
  TiffDirectory inner(Tag tag) const;

  bool empty() const { return count_ == 0; }
  // Everything listed in its entries is within the file.
  bool is_whole() const;

  // The first of those that the entry lists, of type SHORT, LONG, LONG8 or IFD; none: the directory lacks the
  // entry, or has it twice.
  std::optional<std::uint64_t> number(Tag tag) const;
  // The bytes with this number in its place; empty: the directory lacks it.
  std::string with_number(Tag tag, std::uint64_t value) const;
  // The first of type RATIONAL; none: the directory lacks it, or it is divided by 0.
  std::optional<double> ratio(Tag tag) const;
  // Of type ASCII, up to its 0; empty: the directory lacks it.
  std::string text(Tag tag) const;

 private:
  // The values of an entry, and their position.
  struct Values {
    std::uint64_t type = 0, count = 0;
    size_t place = 0;
  };
  TiffDirectory(const TiffDirectory& file, std::uint64_t offset);
  std::optional<std::uint64_t> at(size_t offset, size_t size_bytes) const;
  // Of the only entry with this tag.
  std::optional<Values> values(Tag tag) const;

  std::string_view bytes_;
  std::endian order_ = std::endian::little;
  bool big_ = false;  // BigTIFF: offsets of 8 bytes
  size_t entries_ = 0;
  std::uint64_t count_ = 0;
};

}  // namespace glasswing
