// Reads the headers of a matte file.
#pragma once

#include <OpenEXR/ImfForward.h>
#include <absl/status/statusor.h>

#include <string>
#include <string_view>

#include "core/matte/matte_file.h"

namespace glasswing {

struct MatteHead {
  MatteOutline outline;
  std::string row_checksums;  // see matte_layers.h; one per row
};

// Ensures that later reads are bounded by `file_bytes`, whatever the headers promise. DATA_LOSS: altered, or
// not a matte; FAILED_PRECONDITION: a newer format_version.
absl::StatusOr<MatteHead> read_matte_head(const Imf::MultiPartInputFile& file, size_t file_bytes);
// The same from a file's bytes.
absl::StatusOr<MatteHead> read_matte_head(std::string_view bytes);

}  // namespace glasswing
