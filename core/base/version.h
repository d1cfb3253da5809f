// The release of all programs.
#pragma once

namespace glasswing {

inline constexpr const char* kVersion = "0.1.0";

}  // namespace glasswing
