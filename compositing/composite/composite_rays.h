// Composites of files of rays (docs/rays.md).
#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <string>

#include "compositing/composite/object.h"
#include "core/image/image.h"

namespace glasswing {

// True if the file begins like a rays file. Read errors are left to the code that reads all of it.
bool holds_rays(const std::string& file);

// One picture. INVALID_ARGUMENT: an option that rays do not support, a plane that is not of the form
// DEPTH_MM[:PICTURE], or nothing to show.
absl::StatusOr<ObjectPicture> composite_of_rays(const CompositeArguments& arguments,
                                                const PictureColours& colours,
                                                const std::function<void(double)>& progress);

}  // namespace glasswing
