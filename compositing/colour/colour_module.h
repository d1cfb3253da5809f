// Colour spaces through OpenColorIO, which is in a separate module that is loaded with the first one.
#pragma once

#include <absl/status/statusor.h>

#include <span>
#include <string>

namespace glasswing {

class ColourConversion {
 public:
  virtual ~ColourConversion() = default;
  // Converts samples r, g, b, r, ... in place.
  virtual void apply(std::span<float> rgb) const = 0;
};

// What the module exports.
struct ColourModule {
  // A conversion between a space of a config (its file; empty: $OCIO) and linear Rec. 709, owned by the
  // caller; or null, and the error.
  ColourConversion* (*conversion)(const std::string& config, const std::string& space, bool to_linear,
                                  std::string& error);
};

// UNIMPLEMENTED: the module is not installed.
absl::StatusOr<const ColourModule*> colour_module();

}  // namespace glasswing
