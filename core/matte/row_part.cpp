#include "core/matte/row_part.h"

#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>
#include <fmt/format.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <algorithm>
#include <map>
#include <memory>
#include <mutex>

#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/file/mapped_file.h"
#include "core/matte/packed_matte.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// MatteMetadata.generator of a part: its generator, kMark and the fields of its origin.
constexpr char kBetween[] = "; ", kMark[] = "rows of a matte", kAsRecorded[] = "as recorded",
               kCorrected[] = "corrected";
constexpr size_t kFields = 6;

struct Part {
  fs::path path;
  std::shared_ptr<const MappedFile> file;
  MatteOutline outline;
  PartOrigin origin;
  int end_row() const { return outline.y0_px + outline.height_px; }
};

absl::Status in_part(const fs::path& path, const absl::Status& status) {
  return absl::Status(status.code(), fmt::format("{}: {}", path.string(), std::string(status.message())));
}

absl::StatusOr<Part> open_part(const fs::path& path) {
  Part part{.path = path, .file = nullptr, .outline = {}, .origin = {}};
  GW_ASSIGN_OR_RETURN(part.file, MappedFile::open(path));
  absl::StatusOr<MatteOutline> outline = outline_of(part.file->bytes());
  if (!outline.ok()) return in_part(path, outline.status());
  part.outline = *std::move(outline);
  const std::optional<PartOrigin> origin = origin_of(part.outline.metadata);
  if (!origin || part.outline.delivery || part.outline.metadata.edits_size() > 0) {
    return absl::InvalidArgumentError(
        fmt::format("{} is not a part of a matte, or was edited; glasswing-solver solve --rows writes parts",
                    path.string()));
  }
  part.origin = *origin;
  return part;
}

std::map<std::string, std::string> options_of(const MatteOutline& outline) {
  return {outline.metadata.options().begin(), outline.metadata.options().end()};
}

std::string text_of(const std::map<std::string, std::string>& options) {
  return options.empty() ? "no options" : absl::StrJoin(options, " ", absl::PairFormatter("="));
}

absl::Status check_goes_with(const Part& part, const Part& first) {
  const v1::MatteMetadata& own = part.outline.metadata;
  const v1::MatteMetadata& other = first.outline.metadata;
  const auto differ = [&](std::string_view what, std::string_view is, std::string_view was) {
    return absl::InvalidArgumentError(
        fmt::format("{} has {} {}, but {} has {}; parts of one matte must agree", part.path.string(), what,
                    is, first.path.string(), was));
  };
  if (own.session() != other.session() || part.origin.archive != first.origin.archive) {
    return differ("rows of the archive", fmt::format("\"{}\" ({})", own.session(), part.origin.archive),
                  fmt::format("\"{}\" ({})", other.session(), first.origin.archive));
  }
  if (own.method() != other.method()) return differ("the method", own.method(), other.method());
  const auto options = options_of(part.outline), options_before = options_of(first.outline);
  if (options != options_before) return differ("the options", text_of(options), text_of(options_before));
  if (part.origin.as_recorded != first.origin.as_recorded)
    return differ("frames", part.origin.as_recorded ? kAsRecorded : kCorrected,
                  first.origin.as_recorded ? kAsRecorded : kCorrected);
  if (part.origin.computes != first.origin.computes)
    return differ("the versions", part.origin.computes, first.origin.computes);
  return absl::OkStatus();
}

// They are sorted by their first row.
absl::Status check_rows(const std::vector<Part>& parts) {
  const auto missing = [](int first, int end) {
    return absl::InvalidArgumentError(
        fmt::format("rows {} to {} are in no file; solve that part too", first, end - 1));
  };
  int next = 0;
  const Part* before = nullptr;
  for (const Part& part : parts) {
    const int first = part.outline.y0_px;
    if (first < next) {
      return absl::InvalidArgumentError(fmt::format("rows {} to {} are in both {} and {}", first,
                                                    std::min(next, part.end_row()) - 1, before->path.string(),
                                                    part.path.string()));
    }
    if (first > next) return missing(next, first);
    next = part.end_row();
    before = &part;
  }
  const int height = parts.front().outline.metadata.height_px();
  return next < height ? missing(next, height) : absl::OkStatus();
}

absl::StatusOr<std::vector<Part>> open_parts(const std::vector<fs::path>& paths) {
  std::vector<Part> parts;
  for (const fs::path& path : paths) {
    GW_ASSIGN_OR_RETURN(Part part, open_part(path));
    if (!parts.empty()) GW_RETURN_IF_ERROR(check_goes_with(part, parts.front()));
    parts.push_back(std::move(part));
  }
  std::ranges::sort(parts, {}, [](const Part& part) { return part.outline.y0_px; });
  GW_RETURN_IF_ERROR(check_rows(parts));
  return parts;
}

// Decodes every row, as a reader will.
absl::StatusOr<PixelCount> verified_pixels(const Part& part) {
  PixelCount pixels;
  std::mutex mutex;
  const absl::Status whole = for_blocks_of_matte(part.file->bytes(), 0, [&](Matte& rows) {
    const PixelCount counted = count_pixels(rows);
    const std::lock_guard lock(mutex);
    pixels += counted;
    return absl::OkStatus();
  });
  if (!whole.ok()) return in_part(part.path, whole);
  return pixels;
}

}  // namespace

std::string archive_digest(const v1::CaptureManifest& manifest) {
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);
    manifest.SerializeToCodedStream(&coded);
  }
  return checksum_of(bytes);
}

void mark_part(const PartOrigin& origin, v1::MatteMetadata& metadata) {
  metadata.set_generator(
      absl::StrJoin({metadata.generator(), std::string(kMark), origin.archive, origin.computes,
                     origin.vectors, std::string(origin.as_recorded ? kAsRecorded : kCorrected)},
                    kBetween));
}

std::optional<PartOrigin> origin_of(const v1::MatteMetadata& metadata) {
  const std::vector<std::string> fields = absl::StrSplit(metadata.generator(), kBetween);
  if (fields.size() != kFields || fields[1] != kMark) return std::nullopt;
  return PartOrigin{.archive = fields[2],
                    .computes = fields[3],
                    .vectors = fields[4],
                    .as_recorded = fields[5] == kAsRecorded};
}

std::string mixed_vectors(const JoinedParts& joined) {
  if (joined.vectors.size() < 2) return "";
  return fmt::format(
      "the parts were solved by processors with different vector instructions, {}; the last bits of the "
      "matte "
      "differ between them",
      absl::StrJoin(joined.vectors, " and "));
}

absl::StatusOr<JoinedParts> join_parts(const std::vector<fs::path>& paths, PositionedFile& file) {
  if (paths.empty()) return absl::InvalidArgumentError("there are no parts to join");
  GW_ASSIGN_OR_RETURN(const std::vector<Part> parts, open_parts(paths));
  JoinedParts joined{
      .outline = parts.front().outline, .origin = parts.front().origin, .vectors = {}, .pixels = {}};
  MatteOutline& whole = joined.outline;
  whole.height_px = whole.metadata.height_px();
  const std::vector<std::string> made_by = absl::StrSplit(whole.metadata.generator(), kBetween);
  whole.metadata.set_generator(made_by.front());
  GW_ASSIGN_OR_RETURN(PackedMatteWriter writer,
                      PackedMatteWriter::begin(
                          whole, [&file](auto offset, auto bytes) { return file.write_at(offset, bytes); }));
  for (const Part& part : parts) {
    GW_ASSIGN_OR_RETURN(const PixelCount pixels, verified_pixels(part));
    joined.pixels += pixels;
    joined.vectors.insert(part.origin.vectors);
    if (const absl::Status added = writer.add(part.file->bytes()); !added.ok())
      return in_part(part.path, added);
    if (!part.file->intact()) return absl::DataLossError(part.path.string() + " changed while being read");
  }
  GW_RETURN_IF_ERROR(writer.finish());
  return joined;
}

}  // namespace glasswing
