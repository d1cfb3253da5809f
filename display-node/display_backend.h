// A kind of display, as a row of the table that --backend chooses from (display-node/backend_table.cpp).
#pragma once

#include <absl/status/statusor.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "display-node/display.h"

namespace glasswing {

// The options that all backends share.
struct DisplaySettings {
  std::vector<std::string> monitors;  // as given, in the backend's own form; empty: the backend's default
  std::optional<int> bits;            // of a code; empty: the backend's default
  nanoseconds lag{}, settle{};
  std::uint64_t fault_seed = 1;
};

struct DisplayBackend {
  std::string_view name;
  std::string_view monitor_form;  // of --monitor, in its help
  std::vector<int> bits;          // that a code may have
  // Adds its own options to the command line.
  std::function<void(CLI::App&)> add_options;
  // Opens the screens that the parsed options name. INVALID_ARGUMENT: an option cannot be read or does not
  // suit the backend; else its own errors.
  std::function<absl::StatusOr<std::unique_ptr<Display>>(const DisplaySettings&)> open;
};

}  // namespace glasswing
