// One matte's file out of its tiles' files, none of which is unpacked: the packed rows are copied as they
// are, and the row checksums of their headers with them.
#pragma once

#include <absl/status/statusor.h>

#include <span>
#include <string>
#include <string_view>

namespace glasswing {

// Byte for byte what encode_matte() makes of the whole with the topmost tile's metadata. Tiles are whole
// rows, in any order. DATA_LOSS: damaged headers, or a row that no tile covers, or two, which is named.
// Packed rows are not looked at.
absl::StatusOr<std::string> join_mattes(std::span<const std::string_view> tiles);

}  // namespace glasswing
