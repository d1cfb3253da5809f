// The queue as it outlasts restarts: items in their order, whether the queue runs, and its history, in
// DATA/queue.sqlite. A change is durable before it shows.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "glasswing/v1/queue_service.pb.h"
#include "server/storage/database.h"
#include "server/storage/problems.h"

namespace glasswing {

inline constexpr int kMaxQueueItems = 1000;     // that have not ended, and that have
inline constexpr int kMaxQueueEvents = 10'000;  // of the history

// DONE or FAILED.
bool has_ended(const v1::QueueItem& item);

// Its owner serialises access.
class QueueStore {
 public:
  // What is damaged is set aside, and `problems` says so.
  static absl::StatusOr<std::unique_ptr<QueueStore>> open(const std::filesystem::path& data,
                                                          Problems& problems);

  // In the order of work; those that have ended first, in the order in which they did.
  const std::vector<v1::QueueItem>& items() const { return items_; }
  const v1::QueueState& state() const { return state_; }
  // NOT_FOUND: "the queue has no item 7".
  absl::StatusOr<v1::QueueItem> find(std::int64_t number) const;
  // The events of an item, or of all (0), newest first: `count` after the first `skipped`.
  absl::StatusOr<std::vector<v1::QueueEvent>> history(std::int64_t item, int skipped, int count);

  // Each change is made with its event of the history, or not at all.
  // Adds an item, whose number it gives, behind all others; returns the one that the request added before.
  // RESOURCE_EXHAUSTED: kMaxQueueItems have not ended.
  absl::StatusOr<v1::QueueItem> add(v1::QueueItem item, const std::string& request_id, v1::QueueEvent event);
  // Without an event for what history need not know.
  absl::Status change(const v1::QueueItem& item, const std::optional<v1::QueueEvent>& event);
  // `before`: of items(); 0: to the end. NOT_FOUND.
  absl::Status move(std::int64_t number, std::int64_t before, const v1::QueueEvent& event);
  absl::Status remove(std::int64_t number, const v1::QueueEvent& event);
  absl::Status set_state(const v1::QueueState& state, const v1::QueueEvent& event);

 private:
  explicit QueueStore(Database database) : database_(std::move(database)) {}
  static absl::StatusOr<std::unique_ptr<QueueStore>> read(const std::filesystem::path& file);
  std::vector<v1::QueueItem>::iterator at(std::int64_t number);
  // Makes the changes atomically.
  template <typename Changes>
  absl::Status commit(const Changes& changes);
  absl::Status note(const v1::QueueEvent& event);
  absl::Status store_places(std::span<const v1::QueueItem> items);
  absl::Status forget_oldest();

  Database database_;
  std::vector<v1::QueueItem> items_;
  v1::QueueState state_;
};

}  // namespace glasswing
