// Validates the headers of an untrusted file before OpenEXR reads it.
#pragma once

#include <absl/status/statusor.h>

#include <string_view>

namespace glasswing {

inline constexpr int kMaxTile_px = 256;  // side of a tile

// Walks the headers of a multi-part file. OpenEXR trusts the declared size of an attribute and allocates it
// before reading; so attributes must have the types of a matte, the sizes of these types, and lie within the
// file, as must every part's table of chunks. The library holds whole tiles in memory, whose sides are at
// most kMaxTile_px. Returns the offset where the headers end and the tables begin.
// DATA_LOSS: invalid headers, or more than 64 of them.
absl::StatusOr<size_t> check_exr_header(std::string_view bytes);

}  // namespace glasswing
