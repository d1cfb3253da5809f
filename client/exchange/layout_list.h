// The list for a folder of photographs that follow a layout (client/layouts).
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <optional>
#include <string>

#include "client/exchange/photograph_list.h"
#include "client/layouts/photograph_layout.h"
#include "client/layouts/stack_samples.h"

namespace glasswing {

struct LaidOutList {
  PhotographList list;
  std::optional<StackSamples> samples;  // where the pictures were looked at
};

// Writes the layout that --layout auto detects, and why, to standard error. INVALID_ARGUMENT and NOT_FOUND
// name the invalid option and what is accepted. `files`: a glob; empty: all pictures of the directory itself.
absl::StatusOr<LaidOutList> list_by_layout(const std::filesystem::path& directory, const std::string& files,
                                           const LayoutOptions& layout, const PhotographOptions& options);

}  // namespace glasswing
