// Bounds of JSON from browsers, checked before anything is made of it: a few bytes of text make objects of
// hundreds, and parsers recurse.
#pragma once

#include <absl/status/status.h>

#include <string_view>

namespace glasswing {

// A manifest of 20,000 frames has five objects and lists a frame, and some 25 values.
inline constexpr int kMaxJsonDepth = 32, kMaxJsonObjects = 200'000, kMaxJsonValues = 1'000'000;

// INVALID_ARGUMENT: the text nests deeper, or has more objects and lists, or more values. Says nothing else
// of the text, which need not be JSON.
absl::Status check_json_bounds(std::string_view text);

}  // namespace glasswing
