// Joins the files of a matte's tiles without decompressing them: compressed rows are copied as they are, and
// so are the row checksums of the headers.
#pragma once

#include <absl/status/statusor.h>

#include <span>
#include <string>
#include <string_view>

namespace glasswing {

// The result equals, byte for byte, encode_matte() of the whole matte with the topmost tile's metadata. Tiles
// consist of whole rows and may come in any order. DATA_LOSS: damaged headers, or a row that no tile or two
// tiles cover, which is named. Compressed rows are not checked.
absl::StatusOr<std::string> join_mattes(std::span<const std::string_view> tiles);

}  // namespace glasswing
