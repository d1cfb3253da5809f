#include "core/image/raw_photograph.h"

#include <absl/strings/ascii.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "core/base/status.h"
#include "core/file/descriptor.h"
#include "core/image/image.h"
#include "core/image/raw_answer.h"
#include "core/image/tiff_directory.h"
#include "core/process/module.h"
#include "core/process/run_program.h"

namespace glasswing {
namespace {

// For a truncated file, LibRaw uses what is left, without the levels stored at the end.
absl::Status check_directories(std::string_view bytes) {
  const TiffDirectory first(bytes);
  for (const TiffDirectory& each :
       {first, first.inner(TiffDirectory::kExif), first.inner(TiffDirectory::kInner)}) {
    if (!each.is_whole())
      return absl::DataLossError(
          "it is damaged, or truncated: a directory is "
          "incomplete");
  }
  for (const TiffDirectory::Tag tag : {TiffDirectory::kExif, TiffDirectory::kInner}) {
    if (first.number(tag) && first.inner(tag).empty())
      return absl::DataLossError("it is damaged, or truncated: a directory is missing");
  }
  return absl::OkStatus();
}

// True if it was complete.
bool read_all(int file, void* to, size_t size, off_t from) {
  for (size_t done = 0; done < size;) {
    const ssize_t count =
        ::pread(file, static_cast<char*>(to) + done, size - done, from + static_cast<off_t>(done));
    if (count <= 0) return false;
    done += static_cast<size_t>(count);
  }
  return true;
}

// `what` glasswing-raw is to read; only "photograph" has codes.
absl::StatusOr<RawPhotograph> ask(const std::string& what, std::string_view bytes) {
  constexpr std::chrono::seconds kLimit(120);
  if (std::ssize(bytes) > kMaxRawBytes) {
    return absl::DataLossError(
        fmt::format("it has {} bytes; the maximum for a raw photograph is {}", bytes.size(), kMaxRawBytes));
  }
  GW_RETURN_IF_ERROR(check_directories(bytes));
  GW_ASSIGN_OR_RETURN(const std::filesystem::path program, find_module("glasswing-raw"));
  const Descriptor output(::memfd_create("glasswing-raw", MFD_CLOEXEC));
  if (!output.is_open()) return absl::ErrnoToStatus(errno, "cannot hold a raw file in memory");
  const absl::Status ran =
      run_command({program.string(), what}, {.limit = kLimit, .input = bytes, .output_file = output.get()});
  RawAnswer answer;
  if (!ran.ok() || !read_all(output.get(), &answer, sizeof answer, 0))
    return absl::DataLossError("it is damaged: LibRaw could not read it");
  answer.refused.back() = answer.mosaic.back() = '\0';
  if (answer.refused.front() != '\0') return absl::DataLossError(answer.refused.data());
  RawPhotograph raw{
      .codes = {}, .mosaic = answer.mosaic.data(), .black = answer.black, .white = answer.white, .facts = {}};
  if (answer.exposure_ms > 0.0) raw.facts.exposure_ms = answer.exposure_ms;
  if (answer.iso > 0.0) raw.facts.iso = answer.iso;
  raw.facts.turned = answer.turned != 0;
  if (what != "photograph") return raw;
  const auto good = [](int side) { return side >= 1 && side <= kMaxSide_px; };
  if (!good(answer.width_px) || !good(answer.height_px) || raw.black < 0 || raw.white <= raw.black ||
      raw.white > 65535)
    return absl::DataLossError("it is damaged: LibRaw could not read it");
  raw.codes = Image16(answer.width_px, answer.height_px, 1);
  if (read_all(output.get(), raw.codes.samples.data(), raw.codes.samples.size() * sizeof(std::uint16_t),
               sizeof answer))
    return raw;
  return absl::DataLossError("it is damaged: LibRaw could not read it");
}

}  // namespace

bool is_raw_file(const std::filesystem::path& path) {
  constexpr std::array<std::string_view, 12> kSuffixes{".dng", ".cr2", ".cr3", ".nef", ".nrw", ".arw",
                                                       ".raf", ".orf", ".rw2", ".pef", ".srw", ".3fr"};
  return std::ranges::find(kSuffixes, absl::AsciiStrToLower(path.extension().string())) != kSuffixes.end();
}

absl::StatusOr<RawPhotograph> decode_raw(std::string_view bytes) {
  return ask("photograph", bytes);
}

absl::StatusOr<RawFacts> read_raw_facts(std::string_view bytes) {
  GW_ASSIGN_OR_RETURN(RawPhotograph raw, ask("facts", bytes));
  return raw.facts;
}

}  // namespace glasswing
