// Matte files read and written by their compressed rows, in memory that does not grow with the matte.
#pragma once

#include <absl/functional/function_ref.h>
#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "core/file/positioned_file.h"
#include "core/matte/matte_file.h"
#include "core/matte/matte_region.h"

namespace glasswing {

class PackedMatteReader {
 public:
  // Reads the headers. Borrows the file. Errors as in outline_of(), and FAILED_PRECONDITION: a delivery file.
  static absl::StatusOr<PackedMatteReader> open(const PositionedFile& file);

  const MatteOutline& outline() const { return outline_; }
  // The file of `count` rows, the first of them counted from the outline's, each `step` below the previous
  // one and numbered consecutively: equals encode_matte() of them if the source is undamaged. Its rows are
  // not verified; decode_matte() of it does. DATA_LOSS: the source's table of rows is damaged.
  absl::StatusOr<std::string> rows(int first, int count, int step = 1) const;
  // Decodes such rows and verifies their checksums: calls `use` with one tile of whole rows after another,
  // numbered from `first`. Errors from `use` end it.
  absl::Status for_rows(int first, int count, absl::FunctionRef<absl::Status(const Matte& rows)> use,
                        int step = 1) const;

 private:
  explicit PackedMatteReader(const PositionedFile& file) : file_(&file) {}
  absl::Status read_chunk(size_t part, int row, std::string& bytes) const;

  const PositionedFile* file_;
  MatteOutline outline_;
  std::string row_checksums_;
  std::vector<std::uint64_t> table_;          // offsets of rows, by part
  std::vector<std::uint32_t> max_row_bytes_;  // of a packed row, by part
};

class PackedMatteWriter {
 public:
  // Writes bytes at an offset of the file.
  using Put = std::function<absl::Status(std::uint64_t offset, std::string_view bytes)>;

  // A file of `whole`'s data window, layers and metadata.
  static absl::StatusOr<PackedMatteWriter> begin(const MatteOutline& whole, Put put);
  // Appends the rows of a tile. DATA_LOSS: damaged headers, partial rows, other layers than the outline's, or
  // rows that do not follow the previous ones, which are named; FAILED_PRECONDITION: a delivery file.
  // Compressed rows are copied unchanged and unchecked.
  absl::Status add(std::string_view tile);
  // Writes the headers; the file then equals encode_matte() of the whole matte, byte for byte, with the
  // metadata of `whole`. DATA_LOSS: rows are missing.
  absl::Status finish();

 private:
  absl::Status check_next(const MatteOutline& tile) const;
  PackedMatteWriter(MatteOutline whole, Put put) : whole_(std::move(whole)), put_(std::move(put)) {}

  MatteOutline whole_;
  Put put_;
  int next_row_ = 0;             // of the outline
  std::uint64_t head_size_ = 0;  // of headers and tables
  std::uint64_t at_ = 0;         // where the next rows go
  std::string row_checksums_;
  std::vector<std::uint64_t> table_;  // offsets of rows, by part
};

// Writes part of a matte as a separate file, verifying the rows that it decodes; others are not read. Its
// data window is the region; if pixels are left out, window and picture count the remaining ones, and the
// metadata's sampling_px is their spacing. INVALID_ARGUMENT: the region is not within the file's data window.
absl::Status write_part(const PackedMatteReader& matte, const MattePart& part, PackedMatteWriter::Put put);

}  // namespace glasswing
