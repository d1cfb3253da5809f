#include "client/queue/queue_text.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iostream>
#include <vector>

#include "core/base/utf8.h"
#include "core/cli/output.h"

namespace glasswing {
namespace {

std::string name_of(const v1::QueueItem& item) {
  return item.session().empty() ? item.wish().session() : item.session();
}

// "approval, doctor"
std::string conditions_of(const v1::QueueWish& wish) {
  std::vector<std::string> names;
  if (!wish.not_before().empty()) names.push_back("not before " + wish.not_before());
  if (wish.approval()) names.emplace_back("approval");
  if (wish.steady()) names.emplace_back("steady");
  if (wish.doctor()) names.emplace_back("doctor");
  if (wish.no_warnings()) names.emplace_back("no warnings");
  return fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

std::string state_name(v1::QueueItemState state) {
  switch (state) {
    case v1::QUEUE_ITEM_STATE_WAITING:
      return "waiting";
    case v1::QUEUE_ITEM_STATE_RUNNING:
      return "running";
    case v1::QUEUE_ITEM_STATE_PAUSED:
      return "paused";
    case v1::QUEUE_ITEM_STATE_SOLVING:
      return "solving";
    case v1::QUEUE_ITEM_STATE_DONE:
      return "done";
    case v1::QUEUE_ITEM_STATE_FAILED:
      return "failed";
    default:
      return "unknown";
  }
}

std::string state_text(const v1::QueueState& queue) {
  if (queue.since().empty()) return "the queue is paused; start it with: glasswing queue start";
  return fmt::format("the queue {}{} at {}", queue.running() ? "runs, started" : "is paused",
                     queue.by().empty() ? "" : " by " + queue.by(), queue.since());
}

std::string hold_text(const v1::QueueHold& hold) {
  return fmt::format("hold {}: {} to {}{}{}", hold.number(), hold.from(), hold.to(),
                     hold.by().empty() ? "" : ", for " + hold.by(),
                     hold.why().empty() ? "" : ": " + hold.why());
}

std::string summary_of(const v1::QueueItem& item) {
  const std::string name = name_of(item);
  return fmt::format("item {}{} is {}{}", item.number(), name.empty() ? "" : fmt::format(" ({})", name),
                     state_name(item.state()), item.reason().empty() ? "" : ": " + item.reason());
}

void print_queue(const Client& client, const v1::GetQueueResponse& queue) {
  if (client.json) return print_json(queue);
  if (!client.tsv) {
    std::cout << printable(state_text(queue.queue())) << "\n";
    for (const v1::QueueHold& hold : queue.queue().holds()) std::cout << printable(hold_text(hold)) << "\n";
  }
  if (queue.items().empty() && !client.tsv) {
    std::cout << "it has no items; add one with: glasswing queue add PLAN --session NAME\n";
    return;
  }
  std::vector<std::vector<std::string>> rows;
  for (const v1::QueueItem& item : queue.items()) {
    rows.push_back({std::to_string(item.number()), state_name(item.state()), name_of(item), item.added_by(),
                    conditions_of(item.wish()), item.reason()});
  }
  print_table(client, {{"ITEM", true}, {"STATE"}, {"SESSION"}, {"ADDED BY"}, {"CONDITIONS"}, {"REASON"}},
              rows);
}

void print_item(const Client& client, const v1::QueueItem& item) {
  if (client.json) return print_json(item);
  std::cout << printable(summary_of(item)) << "\n";
}

void print_history(const Client& client, const v1::ListQueueHistoryResponse& history) {
  if (client.json) return print_json(history);
  std::vector<std::vector<std::string>> rows;
  for (const v1::QueueEvent& event : history.events()) {
    rows.push_back({event.time(), event.item() == 0 ? "" : std::to_string(event.item()),
                    event.who().empty() ? "the queue" : event.who(), event.what()});
  }
  print_table(client, {{"TIME"}, {"ITEM", true}, {"WHO"}, {"WHAT"}}, rows);
}

}  // namespace glasswing
