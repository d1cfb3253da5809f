// Arranges a matte's panels on one sheet.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "client/pictures/matte_panels.h"

namespace glasswing {

// Four panels per line (two for wide mattes), each below its title and above its legend. All have one scale:
// small mattes are enlarged by an integer factor, large ones reduced. `heading` is in large letters, `lines`
// below it in small ones; texts that are too long end in "...". Texts are ASCII.
CodeImage contact_sheet(const std::vector<MattePanel>& panels, const std::string& heading,
                        const std::vector<std::string>& lines);

// INTERNAL: it cannot be encoded.
absl::StatusOr<std::string> encode_png8(const CodeImage& image);

}  // namespace glasswing
