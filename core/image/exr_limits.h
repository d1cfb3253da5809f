// Limits of OpenEXR files, checked before the library reads one: it creates every part that a header names,
// and allocates an attribute's declared size.
#pragma once

#include <absl/status/status.h>

#include <string_view>

namespace glasswing {

// Ten times what renderers write.
inline constexpr int kMaxExrParts = 1024, kMaxExrChannels = 8192;

// INVALID_ARGUMENT: the file has more parts, or more channels in total. DATA_LOSS: its headers are not within
// it. Anything that is not an OpenEXR file is left to the library.
absl::Status check_exr_limits(std::string_view bytes);

}  // namespace glasswing
