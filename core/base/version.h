// The release that this program belongs to.
#pragma once

namespace glasswing {

inline constexpr const char* kVersion = "0.1.0";

}  // namespace glasswing
