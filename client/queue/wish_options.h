// What is wished of an item of the queue, as options of a verb.
#pragma once

#include <absl/status/status.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/client.h"
#include "glasswing/v1/queue_service.pb.h"

namespace glasswing {

struct WishOptions {
  std::optional<std::string> session, note, not_before, deadline;
  std::vector<std::string> tags, rail_mm, background;
  std::vector<double> exposure_ms;
  std::optional<bool> solve, approval, doctor, no_warnings, steady, retake_unusual, pause_after;
  std::optional<int> retries;
  std::optional<double> retry_wait_s, give_up_s, warm_up_s;
};

void add_wish_options(CLI::App& command, const std::shared_ptr<WishOptions>& options);

// Enters what was given into the wish, which must have its plan, and uploads the backgrounds.
// INVALID_ARGUMENT: --rail-mm or --background.
absl::Status enter_wish(const Client& client, const WishOptions& options, v1::QueueWish& wish);

}  // namespace glasswing
