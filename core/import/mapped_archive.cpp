#include "core/import/mapped_archive.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cassert>
#include <cstring>

#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/frame/archive.h"
#include "core/import/foreign_manifest.h"

namespace glasswing {

absl::StatusOr<std::shared_ptr<MappedArchive>> MappedArchive::map(const std::filesystem::path& directory) {
  std::shared_ptr<MappedArchive> archive(new MappedArchive());
  archive->directory_ = directory;
  GW_ASSIGN_OR_RETURN(archive->manifest_, read_any_manifest(directory));
  const v1::Camera& camera = archive->manifest_.camera();
  const FrameShape shape = shape_of(camera);
  archive->last_strips_ =
      std::make_unique<LastStrip[]>(static_cast<size_t>(archive->manifest_.frames_size()));
  for (const v1::Frame& frame : archive->manifest_.frames()) {
    const std::filesystem::path path = directory / frame.file();
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // a FIFO has another size
    struct stat status {};
    const bool known = file >= 0 && ::fstat(file, &status) == 0;
    const size_t size = status.st_size;
    // A frame's file of the camera is this long, or compressed.
    const bool fits = known && size >= kTiffPixelOffset && size <= tiff_size_bytes(shape);
    void* mapping = fits ? ::mmap(nullptr, size, PROT_READ, MAP_SHARED, file, 0) : MAP_FAILED;
    if (file >= 0) ::close(file);
    if (mapping == MAP_FAILED) {
      return absl::DataLossError(
          fmt::format("{} is not a frame of {} x {} px ({} bytes, or fewer if compressed): {}", path.string(),
                      camera.width_px(), camera.height_px(), tiff_size_bytes(shape),
                      file < 0 ? std::strerror(errno) : fmt::format("it has {} bytes", status.st_size)));
    }
    const std::string_view bytes = archive->mappings_.emplace_back(static_cast<const char*>(mapping), size);
    const absl::StatusOr<TiffRows> rows = TiffRows::open(bytes, shape);
    if (!rows.ok()) {
      return absl::DataLossError(fmt::format(
          "{} is not in the format of archive frames ({}); `glasswing import` converts other formats",
          path.string(), std::string(rows.status().message())));
    }
    archive->files_.push_back(*rows);
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
  std::vector<Image16> all(archive->files_.size());
  for (size_t i = 0; i < all.size(); ++i) {
    if (!mosaic && !archive->files_[i].plain().empty()) continue;
    GW_ASSIGN_OR_RETURN(const FrameSamples stored, archive->read(static_cast<int>(i), 0, camera.height_px()));
    Image16 frame(camera.width_px(), camera.height_px(), mosaic ? 1 : 3);
    std::ranges::copy(stored.samples, frame.samples.begin());
    all[i] = interpolated(frame, mosaic);
  }
  archive->in_memory_ = std::move(all);
  camera.clear_mosaic();
  return archive;
}

MappedArchive::~MappedArchive() {
  for (const std::string_view mapping : mappings_)
    ::munmap(const_cast<char*>(mapping.data()), mapping.size());
}

std::span<const std::uint16_t> MappedArchive::samples_of(int frame) const {
  const size_t at = frame;
  if (!in_memory_.empty() && !in_memory_[at].empty()) return in_memory_[at].samples;
  return files_[at].plain();
}

std::span<const std::uint16_t> MappedArchive::rows(int frame, int first_row, int row_count) const {
  const size_t row = shape_of(manifest_.camera()).row_samples();
  const std::span<const std::uint16_t> samples = samples_of(frame);
  assert(!samples.empty());
  return samples.subspan(row * static_cast<size_t>(first_row), row * static_cast<size_t>(row_count));
}

absl::StatusOr<FrameSamples> MappedArchive::read(int frame, int first_row, int row_count) const {
  if (!samples_of(frame).empty()) return FrameSamples{rows(frame, first_row, row_count), nullptr};
  const int strip_rows = files_[frame].strip_rows(), end_row = first_row + row_count;
  if (first_row / strip_rows == (end_row - 1) / strip_rows) return read_in_strip(frame, first_row, row_count);
  const size_t row = shape_of(manifest_.camera()).row_samples();
  const auto samples = std::make_shared_for_overwrite<std::uint16_t[]>(row * static_cast<size_t>(row_count));
  for (int begin = first_row, end = 0; begin < end_row; begin = end) {
    const int strip_end = std::min((begin / strip_rows + 1) * strip_rows, manifest_.camera().height_px());
    end = std::min(strip_end, end_row);
    std::uint16_t* const to = samples.get() + row * static_cast<size_t>(begin - first_row);
    if (begin % strip_rows == 0 && end == strip_end) {
      GW_RETURN_IF_ERROR(decompress(frame, begin, end - begin, to));
    } else {
      GW_ASSIGN_OR_RETURN(const FrameSamples part, read_in_strip(frame, begin, end - begin));
      std::ranges::copy(part.samples, to);
    }
  }
  return FrameSamples{{samples.get(), row * static_cast<size_t>(row_count)}, samples};
}

absl::StatusOr<FrameSamples> MappedArchive::read_in_strip(int frame, int first_row, int row_count) const {
  const size_t row = shape_of(manifest_.camera()).row_samples();
  const int strip_rows = files_[frame].strip_rows(), strip = first_row / strip_rows * strip_rows,
            strip_end = std::min(strip + strip_rows, manifest_.camera().height_px());
  LastStrip& last = last_strips_[frame];
  const std::lock_guard lock(last.mutex);
  if (last.first_row != strip) {
    const auto samples =
        std::make_shared_for_overwrite<std::uint16_t[]>(row * static_cast<size_t>(strip_end - strip));
    GW_RETURN_IF_ERROR(decompress(frame, strip, strip_end - strip, samples.get()));
    last.first_row = strip;
    last.samples = samples;
  }
  return FrameSamples{{last.samples.get() + row * static_cast<size_t>(first_row - strip),
                       row * static_cast<size_t>(row_count)},
                      last.samples};
}

absl::Status MappedArchive::decompress(int frame, int first_row, int row_count,
                                       std::uint16_t* samples) const {
  const absl::Status status = files_[frame].read(first_row, row_count, samples);
  if (status.ok()) return status;
  return absl::DataLossError(fmt::format("{} is damaged: {}",
                                         (directory_ / manifest_.frames(frame).file()).string(),
                                         std::string(status.message())));
}

}  // namespace glasswing
