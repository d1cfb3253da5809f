// Arranges a matte's panels, or pictures, on one sheet.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "compositing/view/matte_panels.h"

namespace glasswing {

// `columns` panels per line (0: four, or two for wide pictures), each below its title and above its legend.
// All have the size of the first and one scale: small ones are enlarged by an integer factor, large ones
// reduced. `heading` is in large letters, `lines` below it in small ones; texts that are too long are cut off
// with "...". Texts are ASCII.
CodeImage contact_sheet(const std::vector<MattePanel>& panels, const std::string& heading,
                        const std::vector<std::string>& lines, int columns = 0);

// INTERNAL: it cannot be encoded.
absl::StatusOr<std::string> encode_png8(const CodeImage& image);

}  // namespace glasswing
