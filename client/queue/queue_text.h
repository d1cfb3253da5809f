// The queue of captures in words.
#pragma once

#include <string>

#include "client/cli/client.h"
#include "glasswing/v1/queue_service.pb.h"

namespace glasswing {

// "waiting"
std::string state_name(v1::QueueItemState state);

// "the queue runs, started by anna@lab3 at 2026-11-01T20:00:00Z"
std::string state_text(const v1::QueueState& queue);

// "hold 2: 2026-11-30T13:00:00Z to 2026-11-30T15:00:00Z, for anna@lab3: visitors"
std::string hold_text(const v1::QueueHold& hold);

// Each prints as the command line wishes: JSON, tab-separated, or a table.
void print_queue(const Client& client, const v1::GetQueueResponse& queue);
void print_item(const Client& client, const v1::QueueItem& item);
void print_history(const Client& client, const v1::ListQueueHistoryResponse& history);

// "item 7 is waiting: waits for an approval"
std::string summary_of(const v1::QueueItem& item);

}  // namespace glasswing
