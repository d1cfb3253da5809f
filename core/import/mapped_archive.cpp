#include "core/import/mapped_archive.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstring>

#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/frame/archive.h"
#include "core/import/foreign_manifest.h"

namespace glasswing {

absl::StatusOr<std::shared_ptr<MappedArchive>> MappedArchive::map(const std::filesystem::path& directory) {
  std::shared_ptr<MappedArchive> archive(new MappedArchive());
  GW_ASSIGN_OR_RETURN(archive->manifest_, read_any_manifest(directory));
  const v1::Camera& camera = archive->manifest_.camera();
  const FrameShape shape = shape_of(camera);
  archive->file_bytes_ = tiff_size_bytes(shape);
  for (const v1::Frame& frame : archive->manifest_.frames()) {
    const std::filesystem::path path = directory / frame.file();
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // a FIFO has another size
    struct stat status {};
    const bool whole = file >= 0 && ::fstat(file, &status) == 0 &&
                       static_cast<size_t>(status.st_size) == archive->file_bytes_;
    void* mapping =
        whole ? ::mmap(nullptr, archive->file_bytes_, PROT_READ, MAP_SHARED, file, 0) : MAP_FAILED;
    if (file >= 0) ::close(file);
    if (mapping == MAP_FAILED) {
      return absl::DataLossError(
          fmt::format("{} is not a frame of {} x {} px ({} bytes): {}", path.string(), camera.width_px(),
                      camera.height_px(), archive->file_bytes_,
                      file < 0 ? std::strerror(errno) : fmt::format("it has {} bytes", status.st_size)));
    }
    archive->mappings_.push_back(mapping);
    const std::string_view header(static_cast<const char*>(mapping), kTiffPixelOffset);
    if (!check_tiff_header(header, shape).ok()) {
      return absl::DataLossError(
          fmt::format("{} is not in the format of archive frames; `glasswing import` converts other formats",
                      path.string()));
    }
    const std::string_view bytes(static_cast<const char*>(mapping), archive->file_bytes_);
    if (!frame.checksum().empty() && checksum_of(bytes) != frame.checksum()) {
      return absl::DataLossError(fmt::format("{} is damaged: its checksum is {} instead of {}", path.string(),
                                             checksum_of(bytes), frame.checksum()));
    }
  }
  return archive;
}

absl::StatusOr<std::shared_ptr<const MappedArchive>> MappedArchive::open(
    const std::filesystem::path& directory) {
  return map(directory);
}

absl::StatusOr<std::shared_ptr<const MappedArchive>> MappedArchive::open_interpolated(
    const std::filesystem::path& directory) {
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<MappedArchive> archive, map(directory));
  v1::Camera& camera = *archive->manifest_.mutable_camera();
  const std::optional<Mosaic> mosaic = mosaic_of(camera);
  if (!mosaic) return archive;
  std::vector<Image16> all;
  Image16 frame(camera.width_px(), camera.height_px(), 1);
  for (int i = 0; i < archive->manifest_.frames_size(); ++i) {
    const std::span<const std::uint16_t> samples = archive->rows(i, 0, frame.height_px);
    frame.samples.assign(samples.begin(), samples.end());
    all.push_back(interpolated(frame, mosaic));
  }
  archive->interpolated_ = std::move(all);
  camera.clear_mosaic();
  return archive;
}

MappedArchive::~MappedArchive() {
  for (void* mapping : mappings_) ::munmap(mapping, file_bytes_);
}

std::span<const std::uint16_t> MappedArchive::rows(int frame, int first_row, int row_count) const {
  const size_t row = shape_of(manifest_.camera()).row_samples();
  if (!interpolated_.empty()) {
    return std::span(interpolated_[static_cast<size_t>(frame)].samples)
        .subspan(row * static_cast<size_t>(first_row), row * static_cast<size_t>(row_count));
  }
  const auto* bytes = static_cast<const char*>(mappings_[static_cast<size_t>(frame)]) + kTiffPixelOffset;
  return {reinterpret_cast<const std::uint16_t*>(bytes) + row * static_cast<size_t>(first_row),
          row * static_cast<size_t>(row_count)};
}

}  // namespace glasswing
