// A matte's panels on one sheet, for people.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "client/pictures/matte_panels.h"

namespace glasswing {

// Four panels a line (fewer of a wide matte), each below its title and above its legend, all at one scale:
// small mattes are enlarged a whole number of times, large ones reduced. `heading` is large, `lines` below it
// small; what is too long for the sheet ends in "...". Texts are ASCII.
CodeImage contact_sheet(const std::vector<MattePanel>& panels, const std::string& heading,
                        const std::vector<std::string>& lines);

// INTERNAL: it cannot be encoded.
absl::StatusOr<std::string> encode_png8(const CodeImage& image);

}  // namespace glasswing
