// Before OpenEXR reads a file that somebody else wrote.
#pragma once

#include <absl/status/statusor.h>

#include <string_view>

namespace glasswing {

// Walks over the headers of a multi-part file alone. OpenEXR believes what an attribute says of its size and
// allocates it before it reads; a matte's must be of the types that a matte has, be as long as those are, and
// lie within the file, and so must every part's table of chunks. Where the headers end, and the tables begin.
// DATA_LOSS: they are not.
absl::StatusOr<size_t> check_exr_header(std::string_view bytes);

}  // namespace glasswing
