#include "core/frame/raw_photograph.h"

#include <absl/strings/ascii.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "core/base/module.h"
#include "core/base/status.h"
#include "core/frame/tiff_directory.h"

namespace glasswing {
namespace {

absl::StatusOr<const RawCodec*> codec_for(std::string_view bytes) {
  if (std::ssize(bytes) > kMaxRawBytes) {
    return absl::DataLossError(
        fmt::format("it has {} bytes; a raw photograph may have {}", bytes.size(), kMaxRawBytes));
  }
  static const absl::StatusOr<const void*> kModule = load_module("glasswing-raw.so", "glasswing_raw_codec");
  GW_RETURN_IF_ERROR(kModule.status());
  return static_cast<const RawCodec*>(*kModule);
}

// Of a file whose end is missing, LibRaw uses what is left, without the levels that were in the end.
absl::Status check_directories(std::string_view bytes) {
  const TiffDirectory first(bytes);
  for (const TiffDirectory& each :
       {first, first.inner(TiffDirectory::kExif), first.inner(TiffDirectory::kInner)}) {
    if (!each.is_whole()) return absl::DataLossError("it is damaged, or cut off: a directory is not whole");
  }
  for (const TiffDirectory::Tag tag : {TiffDirectory::kExif, TiffDirectory::kInner}) {
    if (first.number(tag) && first.inner(tag).empty())
      return absl::DataLossError("it is damaged, or cut off: a directory is missing");
  }
  return absl::OkStatus();
}

}  // namespace

bool is_raw_file(const std::filesystem::path& path) {
  constexpr std::array<std::string_view, 12> kSuffixes{".dng", ".cr2", ".cr3", ".nef", ".nrw", ".arw",
                                                       ".raf", ".orf", ".rw2", ".pef", ".srw", ".3fr"};
  return std::ranges::find(kSuffixes, absl::AsciiStrToLower(path.extension().string())) != kSuffixes.end();
}

absl::StatusOr<RawPhotograph> decode_raw(std::string_view bytes) {
  GW_ASSIGN_OR_RETURN(const RawCodec* codec, codec_for(bytes));
  GW_RETURN_IF_ERROR(check_directories(bytes));
  return codec->decode(bytes);
}

absl::StatusOr<RawFacts> read_raw_facts(std::string_view bytes) {
  GW_ASSIGN_OR_RETURN(const RawCodec* codec, codec_for(bytes));
  return codec->facts(bytes);
}

}  // namespace glasswing
