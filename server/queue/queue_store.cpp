#include "server/queue/queue_store.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "server/storage/row_checksums.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

absl::StatusOr<Database> open_database(const fs::path& file) {
  GW_ASSIGN_OR_RETURN(Database database, Database::open(file));
  // Request ids are empty of copies and of calls that name none.
  GW_RETURN_IF_ERROR(database.run(
      "CREATE TABLE IF NOT EXISTS items (number INTEGER PRIMARY KEY AUTOINCREMENT, place INTEGER NOT NULL, "
      "request_id TEXT NOT NULL, item BLOB NOT NULL); "
      "CREATE TABLE IF NOT EXISTS queue (one INTEGER PRIMARY KEY, state BLOB NOT NULL); "
      "CREATE TABLE IF NOT EXISTS history (number INTEGER PRIMARY KEY AUTOINCREMENT, item INTEGER NOT NULL, "
      "event BLOB NOT NULL); "
      "CREATE INDEX IF NOT EXISTS history_of_items ON history (item, number)"));
  GW_RETURN_IF_ERROR(protect_rows(database, "items", kQueueColumns));
  GW_RETURN_IF_ERROR(database.check_structure());
  GW_RETURN_IF_ERROR(check_rows(database, "items", kQueueColumns));
  return database;
}

absl::Status unreadable(const char* what) {
  return absl::DataLossError(fmt::format("{}: {} cannot be read", kQueueFile, what));
}

}  // namespace

bool has_ended(const v1::QueueItem& item) {
  return item.state() == v1::QUEUE_ITEM_STATE_DONE || item.state() == v1::QUEUE_ITEM_STATE_FAILED;
}

absl::StatusOr<std::unique_ptr<QueueStore>> QueueStore::open(const fs::path& data, Problems& problems) {
  const fs::path file = data / kQueueFile;
  absl::StatusOr<std::unique_ptr<QueueStore>> store = read(file);
  if (!absl::IsDataLoss(store.status())) return store;
  GW_RETURN_IF_ERROR(problems.set_aside_database(
      data, file, store.status(), "captures that were queued must be added again: glasswing queue add"));
  return read(file);
}

absl::StatusOr<std::unique_ptr<QueueStore>> QueueStore::read(const fs::path& file) {
  GW_ASSIGN_OR_RETURN(Database database, open_database(file));
  std::unique_ptr<QueueStore> store(new QueueStore(std::move(database)));
  Database::Query items = store->database_.query("SELECT item FROM items ORDER BY place, number");
  while (items.next()) {
    if (!store->items_.emplace_back().ParseFromString(items.text(0))) return unreadable("an item");
  }
  GW_RETURN_IF_ERROR(items.status());
  Database::Query state = store->database_.query("SELECT state FROM queue");
  if (state.next() && !store->state_.ParseFromString(state.text(0))) return unreadable("the queue's state");
  GW_RETURN_IF_ERROR(state.status());
  return store;
}

std::vector<v1::QueueItem>::iterator QueueStore::at(std::int64_t number) {
  return std::ranges::find(items_, number, &v1::QueueItem::number);
}

absl::StatusOr<v1::QueueItem> QueueStore::find(std::int64_t number) const {
  const auto found = std::ranges::find(items_, number, &v1::QueueItem::number);
  if (found != items_.end()) return *found;
  return absl::NotFoundError(
      fmt::format("the queue has no item {}; `glasswing queue list --all` lists them", number));
}

absl::StatusOr<std::vector<v1::QueueEvent>> QueueStore::history(std::int64_t item, int skipped, int count) {
  Database::Query query =
      database_.query(fmt::format("SELECT event FROM history {} ORDER BY number DESC LIMIT ? OFFSET ?",
                                  item == 0 ? "" : fmt::format("WHERE item = {}", item)));
  query.bind(count).bind(skipped);
  std::vector<v1::QueueEvent> events;
  while (query.next()) {
    if (!events.emplace_back().ParseFromString(query.text(0))) return unreadable("an event of the history");
  }
  GW_RETURN_IF_ERROR(query.status());
  return events;
}

template <typename Changes>
absl::Status QueueStore::commit(const Changes& changes) {
  GW_RETURN_IF_ERROR(database_.run("BEGIN IMMEDIATE"));
  absl::Status status = changes();
  if (status.ok()) status = database_.run("COMMIT");
  if (!status.ok()) (void)database_.run("ROLLBACK");
  return status;
}

absl::Status QueueStore::note(const v1::QueueEvent& event) {
  GW_RETURN_IF_ERROR(database_.query("INSERT INTO history (item, event) VALUES (?, ?)")
                         .bind(event.item())
                         .bind(event.SerializeAsString())
                         .finish());
  return database_.query("DELETE FROM history WHERE number <= (SELECT max(number) FROM history) - ?")
      .bind(kMaxQueueEvents)
      .finish();
}

absl::Status QueueStore::store_places(std::span<const v1::QueueItem> items) {
  std::int64_t place = 0;
  for (const v1::QueueItem& item : items) {
    GW_RETURN_IF_ERROR(database_.query("UPDATE items SET place = ? WHERE number = ?")
                           .bind(++place)
                           .bind(item.number())
                           .finish());
  }
  return absl::OkStatus();
}

absl::StatusOr<v1::QueueItem> QueueStore::add(v1::QueueItem item, const std::string& request_id,
                                              v1::QueueEvent event) {
  if (!request_id.empty()) {
    Database::Query before = database_.query("SELECT number FROM items WHERE request_id = ?");
    before.bind(request_id);
    if (before.next()) return find(before.integer(0));
    GW_RETURN_IF_ERROR(before.status());
  }
  if (std::ranges::count(items_, false, has_ended) >= kMaxQueueItems) {
    return absl::ResourceExhaustedError(fmt::format(
        "the queue has {} items, the maximum; remove some, or wait until some have ended", kMaxQueueItems));
  }
  const absl::Status stored = commit([&]() -> absl::Status {
    Database::Query added = database_.query(
        "INSERT INTO items (place, request_id, item) VALUES "
        "((SELECT coalesce(max(place), 0) + 1 FROM items), ?, '') RETURNING number");
    added.bind(request_id);
    if (!added.next()) return added.status();
    item.set_number(added.integer(0));
    GW_RETURN_IF_ERROR(added.finish());
    event.set_item(item.number());
    GW_RETURN_IF_ERROR(database_.query("UPDATE items SET item = ? WHERE number = ?")
                           .bind(item.SerializeAsString())
                           .bind(item.number())
                           .finish());
    return note(event);
  });
  GW_RETURN_IF_ERROR(stored);
  items_.push_back(item);
  GW_RETURN_IF_ERROR(forget_oldest());
  return item;
}

// Of those that have ended; what the history says of them stays.
absl::Status QueueStore::forget_oldest() {
  const auto ended = std::ranges::count(items_, true, has_ended);
  if (ended <= kMaxQueueItems) return absl::OkStatus();
  const auto oldest = std::ranges::find(items_, true, has_ended);
  GW_RETURN_IF_ERROR(database_.query("DELETE FROM items WHERE number = ?").bind(oldest->number()).finish());
  items_.erase(oldest);
  return absl::OkStatus();
}

absl::Status QueueStore::change(const v1::QueueItem& item, const std::optional<v1::QueueEvent>& event) {
  const auto known = at(item.number());
  if (known == items_.end()) return find(item.number()).status();
  const absl::Status stored = commit([&]() -> absl::Status {
    GW_RETURN_IF_ERROR(database_.query("UPDATE items SET item = ? WHERE number = ?")
                           .bind(item.SerializeAsString())
                           .bind(item.number())
                           .finish());
    return event ? note(*event) : absl::OkStatus();
  });
  GW_RETURN_IF_ERROR(stored);
  *known = item;
  return absl::OkStatus();
}

absl::Status QueueStore::move(std::int64_t number, std::int64_t before, const v1::QueueEvent& event) {
  GW_ASSIGN_OR_RETURN(const v1::QueueItem moved, find(number));
  if (number == before) return absl::OkStatus();
  if (before != 0) GW_RETURN_IF_ERROR(find(before).status());
  std::vector<v1::QueueItem> next = items_;
  std::erase_if(next, [&](const v1::QueueItem& item) { return item.number() == number; });
  next.insert(std::ranges::find(next, before, &v1::QueueItem::number), moved);
  const absl::Status stored = commit([&]() -> absl::Status {
    GW_RETURN_IF_ERROR(store_places(next));
    return note(event);
  });
  GW_RETURN_IF_ERROR(stored);
  items_ = std::move(next);
  return absl::OkStatus();
}

absl::Status QueueStore::remove(std::int64_t number, const v1::QueueEvent& event) {
  GW_RETURN_IF_ERROR(find(number).status());
  const absl::Status stored = commit([&]() -> absl::Status {
    GW_RETURN_IF_ERROR(database_.query("DELETE FROM items WHERE number = ?").bind(number).finish());
    return note(event);
  });
  GW_RETURN_IF_ERROR(stored);
  items_.erase(at(number));
  return absl::OkStatus();
}

absl::Status QueueStore::set_state(const v1::QueueState& state, const v1::QueueEvent& event) {
  const absl::Status stored = commit([&]() -> absl::Status {
    GW_RETURN_IF_ERROR(database_.query("INSERT OR REPLACE INTO queue (one, state) VALUES (1, ?)")
                           .bind(state.SerializeAsString())
                           .finish());
    return note(event);
  });
  GW_RETURN_IF_ERROR(stored);
  state_ = state;
  return absl::OkStatus();
}

}  // namespace glasswing
