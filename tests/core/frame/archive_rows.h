// Rows of an archive's frame as one string, as ReadRows sends them.
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "core/base/status.h"
#include "core/frame/archive.h"

namespace glasswing {

// Rows [first_row, first_row + row_count) of one frame: r, g, b, 16 bit little endian. Errors are those of
// Archive::check_rows() and Archive::map().
inline absl::StatusOr<std::string> read_rows(Archive& archive, const std::string& file, int first_row,
                                             int row_count) {
  GW_RETURN_IF_ERROR(archive.check_rows(first_row, row_count));
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> mapped, archive.map(file));
  return std::string(
      mapped->bytes().substr(kTiffPixelOffset + static_cast<size_t>(first_row) * archive.row_bytes(),
                             static_cast<size_t>(row_count) * archive.row_bytes()));
}

}  // namespace glasswing
