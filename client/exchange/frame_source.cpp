#include "client/exchange/frame_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/image/image_file.h"
#include "core/import/foreign_manifest.h"
#include "core/import/photograph_response.h"
#include "core/import/response_estimate.h"
#include "core/import/sequences.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr const char* kUnknownResponse = "unknown";

absl::Status damaged(const fs::path& path, const std::string& checksum, const std::string& listed) {
  return absl::DataLossError(fmt::format("{} is damaged: its checksum is {}, the manifest says {}",
                                         path.string(), checksum, listed));
}

absl::StatusOr<Image16> read_verified(const fs::path& directory, const v1::Camera& camera,
                                      const v1::Frame& frame) {
  const fs::path path = directory / frame.file();
  if (!frame.checksum().empty()) {
    GW_ASSIGN_OR_RETURN(const std::string bytes, read_file(path));
    if (const std::string checksum = checksum_of(bytes); checksum != frame.checksum())
      return damaged(path, checksum, frame.checksum());
  }
  const std::optional<Mosaic> mosaic = mosaic_of(camera);
  if (!mosaic || !frame.stimulus().reference()) return read_frame_file(path, shape_of(camera));
  // References may have all colours, which frames of this archive cannot store.
  GW_ASSIGN_OR_RETURN(const Image16 picture,
                      read_frame_file(path, PictureSize{camera.width_px(), camera.height_px()}));
  return sampled(picture, *mosaic);
}

// Reads the list's frame; errors also name its line.
absl::StatusOr<CodedPhotograph> read_listed(const fs::path& directory, const PhotographList& list,
                                            int frame) {
  absl::StatusOr<CodedPhotograph> photograph =
      read_photograph(directory / list.manifest.frames(frame).file(), list.white);
  if (photograph.ok()) return photograph;
  const absl::Status& status = photograph.status();
  return absl::Status(status.code(), fmt::format("{}: {}", list.place(frame), std::string(status.message())));
}

// A raw file contains its own levels; a list gives those of other files.
absl::Status check_raw(const PhotographList& list) {
  const bool linear = list.response.empty() || list.response == "linear";
  if (linear && list.black == 0.0 && !list.white) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format(
      "{}: {} is a raw file, which is linear and contains its own black and white: omit response, "
      "black and white",
      list.path.string(), list.manifest.frames(0).file()));
}

std::string mosaic_text(const std::string& mosaic) {
  return mosaic.empty() ? "" : ", mosaic " + mosaic;
}

// Fills in the exposure times that the list does not give.
void note_exposures(const fs::path& directory, v1::CaptureManifest& manifest) {
  for (v1::Frame& frame : *manifest.mutable_frames()) {
    if (frame.exposure_ms() > 0.0) continue;
    if (const auto noted = exposure_noted_in(directory / frame.file())) frame.set_exposure_ms(*noted);
  }
}

// Estimates an undeclared response, and warns.
absl::Status settle_response(const fs::path& directory, double black, std::optional<StackSamples> samples,
                             PhotographList& list, std::vector<std::string>& warnings) {
  if (list.response == kUnknownResponse) {
    list.manifest.mutable_camera()->set_response(kUnknownResponse);
    list.response = "linear";
    warnings.push_back("the response is unknown: codes are treated as light, which may be wrong");
  }
  if (!list.response.empty()) return absl::OkStatus();
  if (!samples) {
    std::vector<std::string> files;
    for (const v1::Frame& frame : list.manifest.frames()) files.push_back(frame.file());
    GW_ASSIGN_OR_RETURN(samples, sample_stack(directory, files, list.white));
  }
  std::vector<std::vector<float>> codes = std::move(samples->rows.codes);
  for (size_t i = 0; i < codes.size(); ++i)
    codes[i].insert(codes[i].end(), samples->columns.codes[i].begin(), samples->columns.codes[i].end());
  const ResponseEstimate estimate = estimate_response(list.manifest, codes, black);
  if (estimate.response.empty()) {
    return absl::InvalidArgumentError(
        fmt::format("{}: the response of its codes is not declared and cannot be estimated from the "
                    "photographs ({}); pass --response srgb, linear or gamma:G, or --response unknown to "
                    "treat codes as light",
                    list.path.string(), estimate.reason));
  }
  list.response = estimate.response;
  warnings.push_back(fmt::format("the response is not declared; it was estimated as {}: {}",
                                 estimate.response, estimate.reason));
  return absl::OkStatus();
}

// The size of the frame's file, if it is in one of our archives and can be copied unchanged. Its checksum is
// not verified.
std::optional<size_t> stored_bytes(const fs::path& directory, const v1::Camera& camera,
                                   const v1::Frame& frame) {
  if (frame.checksum().empty() || !is_stored_frame(frame)) return std::nullopt;
  absl::StatusOr<FileReader> file = FileReader::open(directory / frame.file());
  if (!file.ok()) return std::nullopt;
  const FrameShape shape = shape_of(camera);
  std::string head(tiff_head_bytes(shape), '\0');
  const absl::StatusOr<size_t> got = file->read(head);
  if (!got.ok()) return std::nullopt;
  head.resize(*got);
  if (!check_tiff_head(head, file->size_bytes(), shape).ok()) return std::nullopt;
  return file->size_bytes();
}

absl::Status pass_on(const fs::path& directory, const v1::Frame& frame, const TakeBytes& take) {
  const fs::path path = directory / frame.file();
  thread_local std::vector<char> piece(kChunkBytes);
  RunningChecksum checksum;
  GW_ASSIGN_OR_RETURN(FileReader file, FileReader::open(path));
  for (;;) {
    GW_ASSIGN_OR_RETURN(const size_t got, file.read(piece));
    if (got == 0) break;
    const std::string_view bytes(piece.data(), got);
    checksum.add(bytes);
    GW_RETURN_IF_ERROR(take(bytes));
  }
  if (checksum.text() == frame.checksum()) return absl::OkStatus();
  return damaged(path, checksum.text(), frame.checksum());
}

FrameSource source_of(v1::CaptureManifest manifest, const fs::path& directory) {
  const auto shared = std::make_shared<const v1::CaptureManifest>(manifest);
  FrameSource source{.manifest = std::move(manifest), .read = [shared, directory](int frame) {
                       return read_verified(directory, shared->camera(), shared->frames(frame));
                     }};
  for (v1::Frame& frame : *source.manifest.mutable_frames()) {
    const std::optional<size_t> size = stored_bytes(directory, shared->camera(), frame);
    if (!size) return source;
    frame.set_size_bytes(static_cast<std::int64_t>(*size));
  }
  source.pass_on = [shared, directory](int frame, const TakeBytes& take) {
    return pass_on(directory, shared->frames(frame), take);
  };
  return source;
}

}  // namespace

std::string missing_text(const fs::path& directory, std::int64_t count) {
  return fmt::format("{} lacks {} of its numbers; the video continues across the gaps", directory.string(),
                     count);
}

absl::StatusOr<FrameSource> archive_source(const fs::path& directory) {
  GW_ASSIGN_OR_RETURN(v1::CaptureManifest manifest, read_any_manifest(directory));
  return source_of(std::move(manifest), directory);
}

absl::StatusOr<FrameSource> sequence_source(const fs::path& directory, const std::string& sequence) {
  GW_ASSIGN_OR_RETURN(v1::CaptureManifest manifest, read_sequence(directory, sequence));
  FrameSource source = source_of(std::move(manifest), directory);
  if (const std::int64_t missing = missing_numbers(numbered_pictures(directory / sequence)); missing > 0)
    source.warnings.push_back(missing_text(directory / sequence, missing));
  return source;
}

absl::StatusOr<FrameSource> photograph_source(const fs::path& directory, PhotographList list,
                                              std::optional<StackSamples> samples) {
  GW_ASSIGN_OR_RETURN(const CodedPhotograph first, read_listed(directory, list, 0));
  v1::Camera& camera = *list.manifest.mutable_camera();
  camera.set_width_px(first.codes.width_px);
  camera.set_height_px(first.codes.height_px);
  camera.set_bits(first.bits);
  camera.set_response("linear");
  std::vector<std::string> warnings;
  if (first.turned) {
    warnings.push_back(fmt::format(
        "EXIF says that the camera was rotated ({}); pictures of a set keep the sensor's orientation",
        list.manifest.frames(0).file()));
  }
  const double black = list.black / list.white.value_or(highest_code(first.bits));
  if (first.raw) {
    GW_RETURN_IF_ERROR(check_raw(list));
    list.response = "linear";
    camera.set_mosaic(first.mosaic);
    camera.set_black_level(first.black_level);
    note_exposures(directory, list.manifest);
  }
  GW_RETURN_IF_ERROR(settle_response(directory, black, std::move(samples), list, warnings));
  absl::StatusOr<PhotographResponse> response = PhotographResponse::create(list.response, black);
  absl::Status status = response.status();
  if (status.ok()) status = check_manifest(list.manifest);
  if (!status.ok())
    return absl::InvalidArgumentError(
        fmt::format("{}: {}", list.path.string(), std::string(status.message())));
  const auto shared = std::make_shared<const PhotographList>(list);
  const auto largest = std::make_shared<int>(0);
  return FrameSource{
      .manifest = std::move(list.manifest),
      .read = [shared, largest, directory, raw = first.raw,
               light = *std::move(response)](int frame) -> absl::StatusOr<Image16> {
        GW_ASSIGN_OR_RETURN(CodedPhotograph photograph, read_listed(directory, *shared, frame));
        Image16& image = photograph.codes;
        const v1::Camera& all = shared->manifest.camera();
        if (image.width_px != all.width_px() || image.height_px != all.height_px() ||
            photograph.bits != all.bits() || photograph.mosaic != all.mosaic() || photograph.raw != raw) {
          return absl::InvalidArgumentError(fmt::format(
              "{}: {} is {}x{} of {} bits{}; it must match the first one, {}, which is {}x{} of {} bits{}",
              shared->place(frame), shared->manifest.frames(frame).file(), image.width_px, image.height_px,
              photograph.bits, mosaic_text(photograph.mosaic), shared->manifest.frames(0).file(),
              all.width_px(), all.height_px(), all.bits(), mosaic_text(all.mosaic())));
        }
        *largest = std::max<int>(*largest, *std::ranges::max_element(image.samples));
        if (photograph.raw) {
          set_black(all.black_level(), photograph);
        } else {
          light.linearise(image);
        }
        return std::move(image);
      },
      .check = [shared, largest, bits = first.bits, raw = first.raw]() -> absl::Status {
        return shared->white || raw ? absl::OkStatus() : check_white(shared->path, *largest, bits);
      },
      .warnings = std::move(warnings)};
}

}  // namespace glasswing
