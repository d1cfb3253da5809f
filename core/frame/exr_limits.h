// Limits of OpenEXR files, looked at before the library reads one: it makes every part that a header names,
// and allocates an attribute's declared size.
#pragma once

#include <absl/status/status.h>

#include <string_view>

namespace glasswing {

// Ten times what renderers write.
inline constexpr int kMaxExrParts = 1024, kMaxExrChannels = 8192;

// INVALID_ARGUMENT: the file has more parts, or more channels in all of them together. DATA_LOSS: its headers
// do not lie within it. What is no OpenEXR file is left to the library.
absl::Status check_exr_limits(std::string_view bytes);

}  // namespace glasswing
