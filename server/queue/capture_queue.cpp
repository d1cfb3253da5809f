#include "server/queue/capture_queue.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/base/time.h"
#include "core/file/fault_point.h"
#include "core/process/pause.h"
#include "server/queue/queue_wish.h"
#include "server/rig/rig_link.h"
#include "server/rig/static_pattern.h"
#include "server/selftest/rig_check.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds kLookEvery(200);
constexpr int kMaxHolds = 100;
// Until then a node that was up may not have registered again with a server that was restarted.
constexpr std::chrono::seconds kNodesRegister(5);

v1::QueueEvent event_of(const std::string& who, std::int64_t item, const std::string& what) {
  v1::QueueEvent event;
  event.set_time(utc_now_rfc3339());
  event.set_who(who);
  event.set_item(item);
  event.set_what(what);
  return event;
}

absl::Time time_of(const std::string& text) {
  absl::Time time = absl::Now();
  (void)absl::ParseTime(absl::RFC3339_full, text, &time, nullptr);
  return time;
}

std::string state_of(const v1::QueueItem& item) {
  switch (item.state()) {
    case v1::QUEUE_ITEM_STATE_WAITING:
      return "waiting";
    case v1::QUEUE_ITEM_STATE_RUNNING:
      return "running";
    case v1::QUEUE_ITEM_STATE_PAUSED:
      return "paused";
    case v1::QUEUE_ITEM_STATE_SOLVING:
      return "being solved";
    case v1::QUEUE_ITEM_STATE_DONE:
      return "done";
    default:
      return "failed";
  }
}

bool has_rig(const v1::QueueItem& item) {
  return item.state() == v1::QUEUE_ITEM_STATE_RUNNING || item.state() == v1::QUEUE_ITEM_STATE_PAUSED;
}

// "item 7 (vase-7)"
std::string title(const v1::QueueItem& item) {
  const std::string& name = item.session().empty() ? item.wish().session() : item.session();
  return name.empty() ? fmt::format("item {}", item.number())
                      : fmt::format("item {} ({})", item.number(), name);
}

// The request that makes the item's session. The time tells it from an item of a queue that was lost.
std::string request_id(const v1::QueueItem& item) {
  return fmt::format("queue item {} of {}", item.number(), item.added());
}

bool may_pass(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kNotFound:
    case absl::StatusCode::kAlreadyExists:
    case absl::StatusCode::kFailedPrecondition:
    case absl::StatusCode::kOutOfRange:
    case absl::StatusCode::kUnimplemented:
    case absl::StatusCode::kDataLoss:
      return false;
    default:
      return true;
  }
}

}  // namespace

void CaptureQueue::start() {
  thread_ = std::jthread([this](std::stop_token stop) { run(std::move(stop)); });
}

// --- calls of people

absl::Status CaptureQueue::check(const v1::QueueWish& wish) const {
  GW_RETURN_IF_ERROR(check_wish(wish));
  for (const std::string& image : images_of(wish)) {
    if (!parts_.images.has(image))
      return absl::InvalidArgumentError(fmt::format("picture \"{}\" has not been uploaded", image));
  }
  return wish.background().empty() ? absl::OkStatus() : Composites::check_installed();
}

void CaptureQueue::release(const v1::QueueWish& wish) {
  const std::set<std::string> images = images_of(wish);
  if (!images.empty()) parts_.images.release(images, parts_.sessions.photos());
}

absl::StatusOr<v1::QueueItem> CaptureQueue::add(const v1::AddQueueItemRequest& request,
                                                const Caller& caller) {
  GW_RETURN_IF_ERROR(check(request.wish()));
  v1::QueueItem item;
  item.set_state(v1::QUEUE_ITEM_STATE_WAITING);
  *item.mutable_wish() = request.wish();
  item.set_added(utc_now_rfc3339());
  item.set_added_by(caller.client);
  absl::StatusOr<v1::QueueItem> added;
  {
    const std::lock_guard lock(mutex_);
    added = store_.add(std::move(item), request.request_id(), event_of(caller.client, 0, "added"));
    wake();
  }
  if (added.ok()) parts_.images.use(images_of(request.wish()));
  return added;
}

absl::StatusOr<v1::QueueItem> CaptureQueue::duplicate(const v1::DuplicateQueueItemRequest& request,
                                                      const Caller& caller) {
  v1::AddQueueItemRequest copy;
  copy.set_request_id(request.request_id());
  GW_ASSIGN_OR_RETURN(const v1::QueueItem item, find(request.number()));
  *copy.mutable_wish() = copied_wish(item.wish());
  return add(copy, caller);
}

absl::StatusOr<v1::QueueItem> CaptureQueue::find_waiting(std::int64_t number, const std::string& verb) const {
  GW_ASSIGN_OR_RETURN(v1::QueueItem item, store_.find(number));
  if (item.state() == v1::QUEUE_ITEM_STATE_WAITING) return item;
  return absl::FailedPreconditionError(
      fmt::format("{} is {}; only one that waits can be {}", title(item), state_of(item), verb));
}

absl::StatusOr<v1::QueueItem> CaptureQueue::change_waiting(std::int64_t number, const std::string& verb,
                                                           const std::string& what, const Caller& caller,
                                                           const Change& change) {
  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(v1::QueueItem item, find_waiting(number, verb));
  change(item);
  item.clear_reason();
  item.clear_waits_since();
  GW_RETURN_IF_ERROR(store_.change(item, event_of(caller.client, number, what)));
  wake();
  return item;
}

absl::StatusOr<v1::QueueItem> CaptureQueue::edit(const v1::EditQueueItemRequest& request,
                                                 const Caller& caller) {
  v1::QueueWish wish = request.wish(), before;
  if (!wish.has_plan()) {
    GW_ASSIGN_OR_RETURN(*wish.mutable_plan(), [&]() -> absl::StatusOr<v1::Plan> {
      GW_ASSIGN_OR_RETURN(const v1::QueueItem item, find(request.number()));
      return item.wish().plan();
    }());
  }
  GW_RETURN_IF_ERROR(check(wish));
  absl::StatusOr<v1::QueueItem> edited =
      change_waiting(request.number(), "edited", "edited", caller, [&](v1::QueueItem& item) {
        before = item.wish();
        *item.mutable_wish() = wish;
        item.clear_approved_by();  // what was approved is not what would run
      });
  if (!edited.ok()) return edited;
  parts_.images.use(images_of(wish));
  release(before);
  return edited;
}

absl::StatusOr<v1::QueueItem> CaptureQueue::move(const v1::MoveQueueItemRequest& request,
                                                 const Caller& caller) {
  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(v1::QueueItem item, find_waiting(request.number(), "moved"));
  std::string where = "moved to the end";
  if (request.before() != 0) {
    GW_RETURN_IF_ERROR(find_waiting(request.before(), "moved before").status());
    where = fmt::format("moved before item {}", request.before());
  }
  GW_RETURN_IF_ERROR(
      store_.move(item.number(), request.before(), event_of(caller.client, item.number(), where)));
  wake();
  return item;
}

absl::Status CaptureQueue::remove(std::int64_t number, const Caller& caller) {
  std::unique_lock lock(mutex_);
  GW_ASSIGN_OR_RETURN(const v1::QueueItem item, store_.find(number));
  if (item.state() == v1::QUEUE_ITEM_STATE_RUNNING) {
    return absl::FailedPreconditionError(
        item.session().empty() ? fmt::format("{} is about to be captured; ask again", title(item))
                               : fmt::format("{0} is being captured; cancel that first: glasswing cancel {1}",
                                             title(item), item.session()));
  }
  GW_RETURN_IF_ERROR(store_.remove(number, event_of(caller.client, number, "removed: " + title(item))));
  lock.unlock();
  release(item.wish());
  return absl::OkStatus();
}

absl::StatusOr<v1::QueueItem> CaptureQueue::run_now(std::int64_t number, const Caller& caller) {
  return change_waiting(number, "run", "to be run next", caller, [&](v1::QueueItem& item) {
    item.set_run_now(true);
    item.set_approved_by(caller.client.empty() ? "somebody" : caller.client);
  });
}

absl::StatusOr<v1::QueueItem> CaptureQueue::approve(std::int64_t number, const Caller& caller) {
  return change_waiting(number, "approved", "approved", caller, [&](v1::QueueItem& item) {
    item.set_approved_by(caller.client.empty() ? "somebody" : caller.client);
  });
}

absl::StatusOr<v1::QueueState> CaptureQueue::set(const v1::SetQueueRequest& request, const Caller& caller) {
  const std::lock_guard lock(mutex_);
  v1::QueueState state = current_state();
  if (state.running() == request.running()) return state;
  state.set_running(request.running());
  state.set_since(utc_now_rfc3339());
  state.set_by(caller.client);
  const std::string what = fmt::format("{}{}{}", request.running() ? "started" : "paused",
                                       request.why().empty() ? "" : ": ", request.why());
  GW_RETURN_IF_ERROR(store_.set_state(state, event_of(caller.client, 0, what)));
  wake();
  return state;
}

absl::StatusOr<v1::QueueItem> CaptureQueue::find(std::int64_t number) {
  const std::lock_guard lock(mutex_);
  return store_.find(number);
}

std::vector<v1::QueueItem> CaptureQueue::list(bool ended) {
  const std::lock_guard lock(mutex_);
  std::vector<v1::QueueItem> items;
  for (const v1::QueueItem& item : store_.items()) {
    if (has_ended(item) && !ended) continue;
    items.push_back(item);
    items.back().mutable_wish()->clear_plan();
  }
  return items;
}

v1::QueueState CaptureQueue::current_state() const {
  v1::QueueState state = store_.state();
  const absl::Time now = absl::Now();
  auto& holds = *state.mutable_holds();
  holds.erase(std::remove_if(holds.begin(), holds.end(),
                             [&](const v1::QueueHold& hold) { return time_of(hold.to()) <= now; }),
              holds.end());
  return state;
}

v1::QueueState CaptureQueue::state() {
  const std::lock_guard lock(mutex_);
  return current_state();
}

// --- times for people

absl::StatusOr<v1::QueueHold> CaptureQueue::hold(const v1::HoldQueueRequest& request, const Caller& caller) {
  absl::Time from, to;
  if (!absl::ParseTime(absl::RFC3339_full, request.from(), &from, nullptr) ||
      !absl::ParseTime(absl::RFC3339_full, request.to(), &to, nullptr) || to <= from || to <= absl::Now()) {
    return absl::InvalidArgumentError(
        fmt::format("the rig cannot be held from \"{}\" to \"{}\"; these must be times such as "
                    "2026-11-01T20:00:00Z, the second after the first and in the future",
                    request.from(), request.to()));
  }
  const auto text = [](absl::Time time) {
    return absl::FormatTime(absl::RFC3339_sec, time, absl::UTCTimeZone());
  };
  const std::lock_guard lock(mutex_);
  v1::QueueState state = current_state();
  if (state.holds_size() >= kMaxHolds)
    return absl::ResourceExhaustedError(fmt::format("the queue has {} such times, the maximum", kMaxHolds));
  v1::QueueHold hold;
  hold.set_number(state.last_hold() + 1);
  hold.set_from(text(from));
  hold.set_to(text(to));
  hold.set_why(request.why());
  hold.set_by(caller.client);
  state.set_last_hold(hold.number());
  *state.add_holds() = hold;
  std::ranges::sort(*state.mutable_holds(), {}, [](const v1::QueueHold& each) { return each.from(); });
  GW_RETURN_IF_ERROR(
      store_.set_state(state, event_of(caller.client, 0,
                                       fmt::format("held from {} to {}{}{}", hold.from(), hold.to(),
                                                   hold.why().empty() ? "" : ": ", hold.why()))));
  wake();
  return hold;
}

absl::Status CaptureQueue::release(std::int64_t number, const Caller& caller) {
  const std::lock_guard lock(mutex_);
  v1::QueueState state = current_state();
  auto& holds = *state.mutable_holds();
  const auto found =
      std::ranges::find(holds, number, [](const v1::QueueHold& each) { return each.number(); });
  if (found == holds.end())
    return absl::NotFoundError(
        fmt::format("the queue is not held by a hold {}; `glasswing queue list` lists them", number));
  const std::string what = fmt::format("free again from {} to {}", found->from(), found->to());
  holds.erase(found);
  GW_RETURN_IF_ERROR(store_.set_state(state, event_of(caller.client, 0, what)));
  wake();
  return absl::OkStatus();
}

absl::Duration CaptureQueue::expected(const v1::QueueItem& item) {
  constexpr std::chrono::seconds kAskAgain(60);
  const auto [known, is_new] = expected_.try_emplace(item.number());
  if (!is_new && Clock::now() - known->second.asked < kAskAgain) return known->second.takes;
  v1::EstimateSessionRequest request;
  *request.mutable_plan() = item.wish().plan();
  const absl::StatusOr<v1::EstimateSessionResponse> estimate = parts_.captures.estimate(request);
  known->second = {.asked = Clock::now(),
                   .takes = estimate.ok() ? absl::Seconds(estimate->seconds()) : absl::ZeroDuration()};
  return known->second.takes;
}

std::string CaptureQueue::held_for_people(const v1::QueueItem& item) {
  const absl::Time now = absl::Now();
  const v1::QueueState queue = state();
  for (const v1::QueueHold& hold : queue.holds()) {
    if (time_of(hold.from()) > now && time_of(hold.from()) - now >= expected(item)) continue;
    return fmt::format("waits until {}: the rig is held for people{}{}", hold.to(),
                       hold.why().empty() ? "" : ": ", hold.why());
  }
  return "";
}

absl::StatusOr<std::vector<v1::QueueEvent>> CaptureQueue::history(std::int64_t item) {
  const std::lock_guard lock(mutex_);
  return store_.history(item, 0, kMaxQueueEvents);
}

absl::StatusOr<PositionedFile> CaptureQueue::composite(const std::string& session) {
  GW_RETURN_IF_ERROR(parts_.sessions.find(session).status());
  absl::StatusOr<PositionedFile> file = PositionedFile::open(parts_.mattes.composite(session));
  if (!absl::IsNotFound(file.status())) return file;
  return absl::NotFoundError(fmt::format(
      "session \"{}\" has no composite; items of the queue with --background make some", session));
}

std::set<std::string> CaptureQueue::images() {
  const std::lock_guard lock(mutex_);
  std::set<std::string> images;
  for (const v1::QueueItem& item : store_.items()) images.merge(images_of(item.wish()));
  return images;
}

void CaptureQueue::observe(std::function<void(const Event&)> observer) {
  const std::lock_guard lock(mutex_);
  observer_ = std::move(observer);
}

// --- the thread

void CaptureQueue::wake() {
  woken_ = true;
  wake_.notify_all();
}

void CaptureQueue::run(std::stop_token stop) {
  while (!stop.stop_requested()) {
    look(stop);
    std::unique_lock lock(mutex_);
    wake_.wait_for(lock, stop, kLookEvery, [this] { return woken_; });
    woken_ = false;
  }
}

std::vector<v1::QueueItem> CaptureQueue::active() {
  const std::lock_guard lock(mutex_);
  std::vector<v1::QueueItem> items;
  for (const v1::QueueItem& item : store_.items()) {
    if (has_rig(item) || item.state() == v1::QUEUE_ITEM_STATE_SOLVING) items.push_back(item);
  }
  return items;
}

void CaptureQueue::look(const std::stop_token& stop) {
  for (const v1::QueueItem& item : active()) {
    if (!item.session().empty()) {
      follow(item, stop);
    } else if (const auto due = due_.find(item.number()); due == due_.end() || Clock::now() >= due->second) {
      drive(item, stop);
    }
    if (stop.stop_requested()) return;
  }
  if (std::ranges::none_of(active(), has_rig)) begin_next(stop);
}

absl::Status CaptureQueue::update(std::int64_t number, std::initializer_list<v1::QueueItemState> in,
                                  const std::string& what, const Change& change) {
  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(v1::QueueItem item, store_.find(number));
  if (std::ranges::find(in, item.state()) == in.end())
    return absl::AbortedError(title(item) + " has changed");
  change(item);
  std::optional<v1::QueueEvent> event;
  if (!what.empty()) event = event_of("", number, what);
  const absl::Status stored = store_.change(item, event);
  // It is met again, and tried again, at the next look.
  if (!stored.ok()) spdlog::error("not stored item={} error=\"{}\"", number, std::string(stored.message()));
  if (stored.ok() && event) spdlog::info("queue item={} session={} {}", number, item.session(), what);
  return stored;
}

void CaptureQueue::says(const v1::QueueItem& item, const std::string& reason) {
  if (item.reason() == reason) return;
  (void)update(item.number(), {item.state()}, "", [&](v1::QueueItem& now) { now.set_reason(reason); });
}

void CaptureQueue::follow(const v1::QueueItem& item, const std::stop_token& stop) {
  const absl::StatusOr<v1::Session> session = parts_.sessions.find_any(item.session());
  if (absl::IsNotFound(session.status())) return has_failed(item, "its session was deleted");
  if (!session.ok()) return has_failed(item, std::string(session.status().message()));
  switch (session->state()) {
    case v1::SESSION_STATE_CREATED:
    case v1::SESSION_STATE_CAPTURING:
      driven_.insert(item.number());
      if (item.state() == v1::QUEUE_ITEM_STATE_RUNNING) return says(item, session->reason());
      (void)update(item.number(), {item.state()}, "goes on", [](v1::QueueItem& now) {
        now.set_state(v1::QUEUE_ITEM_STATE_RUNNING);
        now.clear_waits_since();
        now.clear_reason();
      });
      return;
    case v1::SESSION_STATE_CAPTURED:
      if (session->solve_follows()) return is_captured(item);
      if (!item.wish().background().empty()) return has_failed(item, "its solve was cancelled; no composite");
      return is_done(item);
    case v1::SESSION_STATE_SOLVING:
      is_captured(item);
      date(item, *session);
      return says(item, session->reason());
    case v1::SESSION_STATE_DONE:
      return is_solved(item, *session);
    case v1::SESSION_STATE_CANCELLED:
      return has_failed(item, "its session was cancelled");
    case v1::SESSION_STATE_FAILED:
    case v1::SESSION_STATE_PAUSED:
      if (!rests_in_solve(*session)) return broke_off(item, *session, stop);
      is_captured(item);
      if (session->state() == v1::SESSION_STATE_FAILED) return has_failed(item, session->reason());
      return says(item, session->reason());
    default:
      return has_failed(item, session->reason());
  }
}

void CaptureQueue::broke_off(const v1::QueueItem& item, const v1::Session& session,
                             const std::stop_token& stop) {
  if (waits_for_person(session) &&
      (driven_.contains(item.number()) || item.state() != v1::QUEUE_ITEM_STATE_RUNNING)) {
    (void)wait_for_person(item, session.reason());
    return;
  }
  // It was the server that ended.
  if (item.state() == v1::QUEUE_ITEM_STATE_RUNNING && !driven_.contains(item.number()))
    return drive(item, stop);
  try_again(item, session.reason(), stop);
}

void CaptureQueue::try_again(const v1::QueueItem& item, const std::string& why, const std::stop_token& stop) {
  const v1::QueueWish& wish = item.wish();
  if (item.tries() > wish.retries()) {
    return has_failed(item, item.tries() > 1 ? fmt::format("{} (tried {} times)", why, item.tries()) : why);
  }
  const auto [due, is_new] =
      due_.try_emplace(item.number(), Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                                         std::chrono::duration<double>(wish.retry_wait_s())));
  if (is_new) says(item, fmt::format("is tried again in {:.0f} s: {}", wish.retry_wait_s(), why));
  if (Clock::now() < due->second) return;
  const absl::Status counted = update(
      item.number(), {item.state()},
      fmt::format("tried again ({} of {}): {}", item.tries(), wish.retries(), why), [](v1::QueueItem& now) {
        now.set_state(v1::QUEUE_ITEM_STATE_RUNNING);
        now.set_tries(now.tries() + 1);
        now.clear_waits_since();
      });
  if (!counted.ok()) return;
  due_.erase(due);
  if (const absl::StatusOr<v1::QueueItem> now = find(item.number()); now.ok()) drive(*now, stop);
}

std::optional<v1::QueueItem> CaptureQueue::next() {
  const std::lock_guard lock(mutex_);
  const std::vector<v1::QueueItem>& items = store_.items();
  const auto waits = [](const v1::QueueItem& item) { return item.state() == v1::QUEUE_ITEM_STATE_WAITING; };
  auto found =
      std::ranges::find_if(items, [&](const v1::QueueItem& item) { return waits(item) && item.run_now(); });
  if (found == items.end() && store_.state().running()) found = std::ranges::find_if(items, waits);
  return found == items.end() ? std::nullopt : std::optional(*found);
}

void CaptureQueue::begin_next(const std::stop_token& stop) {
  const std::optional<v1::QueueItem> item = next();
  if (!item || !may_begin(*item)) return;
  const absl::Status begun =
      update(item->number(), {v1::QUEUE_ITEM_STATE_WAITING}, "begun", [](v1::QueueItem& now) {
        now.set_state(v1::QUEUE_ITEM_STATE_RUNNING);
        now.set_began(utc_now_rfc3339());
        now.set_tries(1);
        now.clear_reason();
        now.clear_waits_since();
      });
  if (!begun.ok()) return;
  fault_point("queue item begun");
  if (const absl::StatusOr<v1::QueueItem> now = find(item->number()); now.ok()) drive(*now, stop);
}

std::string CaptureQueue::unsteady(const v1::QueueItem& item) {
  std::string last;
  {
    const std::lock_guard lock(mutex_);
    std::string began;
    for (const v1::QueueItem& other : store_.items()) {
      if (other.session().empty() || other.number() == item.number() || other.began() < began) continue;
      began = other.began();
      last = other.session();
    }
  }
  const absl::StatusOr<v1::Session> session = parts_.sessions.find_any(last);
  if (!session.ok() || session->rig_changes().empty()) return "";
  return fmt::format("session {}: {}", last, session->rig_changes().rbegin()->what());
}

bool CaptureQueue::wait_for_person(const v1::QueueItem& item, const std::string& why) {
  if (!item.waits_since().empty()) {
    const double give_up_s = item.wish().give_up_s();
    if (give_up_s > 0.0 && absl::Now() - time_of(item.waits_since()) >= absl::Seconds(give_up_s))
      has_failed(item, fmt::format("nobody came within {:.0f} s: {}", give_up_s, why));
    return false;
  }
  const absl::Status stored = update(item.number(), {item.state()}, why, [&](v1::QueueItem& now) {
    if (now.state() != v1::QUEUE_ITEM_STATE_WAITING) now.set_state(v1::QUEUE_ITEM_STATE_PAUSED);
    now.set_reason(why);
    now.set_waits_since(utc_now_rfc3339());
  });
  if (stored.ok())
    tell({.what = "needs-operator",
          .session = item.session(),
          .text = title(item) + " of the queue waits: " + why,
          .advice = fmt::format("glasswing queue show {}", item.number())});
  return false;
}

bool CaptureQueue::may_begin(const v1::QueueItem& item) {
  const v1::QueueWish& wish = item.wish();
  if (absl::Now() < earliest_start(wish)) {
    says(item, "waits until " + wish.not_before());
    return false;
  }
  if (!item.run_now()) {
    if (const std::string held = held_for_people(item); !held.empty()) {
      says(item, held);
      return false;
    }
  }
  if (item.approved_by().empty()) {
    const std::string approve = fmt::format("; approve it: glasswing queue approve {}", item.number());
    if (wish.approval()) return wait_for_person(item, "waits for an approval" + approve);
    if (const std::string change = wish.steady() ? unsteady(item) : ""; !change.empty())
      return wait_for_person(item, fmt::format("the rig changed in {}{}", change, approve));
  }
  if (const auto holder = parts_.rig_lock.holder()) {
    says(item, fmt::format("waits for the rig: {}{}", holder->what(),
                           holder->client().empty() ? "" : ", of " + holder->client()));
    return false;
  }
  return true;
}

// --- driving the rig

absl::Status CaptureQueue::place_monitors(const v1::QueueItem& item, const Caller& holding,
                                          const std::stop_token& stop) {
  MonitorNames wanted;
  for (const auto& [monitor, position_mm] : item.wish().rail_mm()) wanted.push_back(monitor);
  if (wanted.empty()) return absl::OkStatus();
  GW_ASSIGN_OR_RETURN(const RigLock::Drive drive, parts_.rig_lock.drive(holding, "placing monitors"));
  GW_ASSIGN_OR_RETURN(const RigLinks rig, connect_displays(parts_.nodes, parts_.calibrations, wanted, stop));
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Monitor> monitors, rig.monitors());
  GW_RETURN_IF_ERROR(check_monitors(wanted, monitors));
  for (const auto& display : rig.displays) {
    for (const auto& [name, position_mm] : item.wish().rail_mm()) {
      const v1::DisplayMonitor* const monitor = display->monitor(name);
      if (monitor == nullptr || !monitor->has_rail()) continue;
      GW_RETURN_IF_ERROR(display->move_monitor(name, position_mm, stop).status());
    }
  }
  return absl::OkStatus();
}

absl::Status CaptureQueue::warm_up(const v1::QueueItem& item, const Caller& holding,
                                   const std::stop_token& stop) {
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                      std::chrono::duration<double>(item.wish().warm_up_s()));
  GW_ASSIGN_OR_RETURN(const RigLock::Drive drive, parts_.rig_lock.drive(holding, "warming up"));
  MonitorNames wanted;
  for (const v1::PlanMonitor& monitor : item.wish().plan().monitors()) wanted.push_back(monitor.name());
  GW_ASSIGN_OR_RETURN(const RigLinks rig, connect_displays(parts_.nodes, parts_.calibrations, wanted, stop));
  GW_ASSIGN_OR_RETURN(std::vector<v1::Monitor> monitors, rig.monitors());
  GW_RETURN_IF_ERROR(check_monitors(wanted, monitors));
  std::erase_if(monitors, [&](const v1::Monitor& monitor) {
    return !wanted.empty() && std::ranges::count(wanted, monitor.name()) == 0;
  });
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Stimulus> white, test_pattern("white", monitors));
  says(item, fmt::format("warms up the monitors for {:.0f} s", item.wish().warm_up_s()));
  GW_ASSIGN_OR_RETURN(const auto showing, StaticPattern::start(rig, white, {}, stop));
  while (Clock::now() < end) {
    GW_RETURN_IF_ERROR(showing->check());
    const auto left = std::min<Clock::duration>(end - Clock::now(), kLookEvery);
    if (!pause(stop, std::chrono::duration_cast<std::chrono::milliseconds>(left)))
      return absl::CancelledError("the server is stopping");
  }
  return absl::OkStatus();
}

// UNAVAILABLE: what is wrong, which may pass.
absl::Status CaptureQueue::check_rig_for(const v1::QueueItem& item, const Caller& holding,
                                         const std::stop_token& stop) {
  const v1::QueueWish& wish = item.wish();
  if (wish.no_warnings()) {
    v1::EstimateSessionRequest request;
    *request.mutable_plan() = wish.plan();
    GW_ASSIGN_OR_RETURN(const v1::EstimateSessionResponse estimate, parts_.captures.estimate(request));
    if (!estimate.warnings().empty())
      return absl::UnavailableError("a dry run warns: " + estimate.warnings(0));
  }
  if (!wish.doctor()) return absl::OkStatus();
  GW_ASSIGN_OR_RETURN(const RigLock::Drive drive, parts_.rig_lock.drive(holding, "doctor"));
  std::string problem;
  GW_RETURN_IF_ERROR(check_rig(
      parts_.nodes, parts_.calibrations, wish.plan(),
      [&](const v1::Finding& finding) {
        if (finding.level() == v1::FINDING_LEVEL_PROBLEM && problem.empty()) problem = finding.text();
      },
      stop));
  return problem.empty() ? absl::OkStatus() : absl::UnavailableError("the rig's self-test: " + problem);
}

absl::StatusOr<v1::Session> CaptureQueue::created(const v1::QueueItem& item, const std::string& id,
                                                  const Caller& holding, const std::stop_token& stop) {
  if (item.wish().warm_up_s() > 0.0) GW_RETURN_IF_ERROR(warm_up(item, holding, stop));
  GW_RETURN_IF_ERROR(check_rig_for(item, holding, stop));
  const v1::QueueWish& wish = item.wish();
  v1::CreateSessionRequest request;
  request.set_request_id(id);
  GW_ASSIGN_OR_RETURN(*request.mutable_name(),
                      session_name(wish.session(), item.number(), time_of(item.began())));
  *request.mutable_plan() = wish.plan();
  request.set_solve(wish.solve());
  *request.mutable_axes() = wish.axes();
  if (!wish.empty_stage_of().empty()) {
    const absl::StatusOr<v1::Session> before = parts_.sessions.find_any(wish.empty_stage_of());
    if (before.ok() && is_wholly_proven(*before)) request.set_empty_stage_of(wish.empty_stage_of());
  }
  if (!wish.rail_mm().empty()) {
    GW_ASSIGN_OR_RETURN(const RigLinks rig, connect_displays(parts_.nodes, parts_.calibrations, {}, stop));
    for (const auto& display : rig.displays) {
      for (const auto& [name, position_mm] : wish.rail_mm()) {
        const v1::DisplayMonitor* const monitor = display->monitor(name);
        if (monitor != nullptr && !monitor->has_rail()) (*request.mutable_rail_mm())[name] = position_mm;
      }
    }
  }
  return parts_.captures.create(request, holding);
}

absl::StatusOr<v1::Session> CaptureQueue::driven(const v1::QueueItem& item, const Caller& holding,
                                                 const std::stop_token& stop) {
  const std::string id = request_id(item);
  absl::StatusOr<v1::Session> session = parts_.sessions.find_request(id);
  if (session.ok()) session = parts_.sessions.find_any(session->name());  // as it is now
  const bool rests = session.ok() && (session->state() == v1::SESSION_STATE_PAUSED ||
                                      session->state() == v1::SESSION_STATE_FAILED);
  if (!session.ok() || rests) GW_RETURN_IF_ERROR(place_monitors(item, holding, stop));
  if (absl::IsNotFound(session.status())) session = created(item, id, holding, stop);
  GW_RETURN_IF_ERROR(session.status());
  fault_point("queue session created");
  v1::AnnotateSessionRequest annotation;
  annotation.set_name(session->name());
  if (!item.wish().note().empty()) annotation.set_note(item.wish().note());
  *annotation.mutable_add_tags() = item.wish().tags();
  GW_RETURN_IF_ERROR(parts_.sessions.annotate(annotation).status());
  if (!rests) return session;
  SessionStore::Edit edit = parts_.sessions.edit();
  GW_ASSIGN_OR_RETURN(v1::Session now, edit.find_any(session->name()));
  if (is_already(now, v1::SESSION_ACTION_RESUME)) return now;
  GW_RETURN_IF_ERROR(edit.check_stays(now.name()));
  GW_RETURN_IF_ERROR(check_allows(now, v1::SESSION_ACTION_RESUME));
  return parts_.captures.resume(edit, std::move(now), {}, holding);
}

void CaptureQueue::drive(const v1::QueueItem& item, const std::stop_token& stop) {
  // Only until the capture runs: it may be paused and cancelled by others.
  const absl::StatusOr<RigLock::Hold> hold = parts_.rig_lock.hold(
      {.client = item.added_by(), .hold = ""}, fmt::format("queue item {}", item.number()));
  if (!hold.ok()) return says(item, "waits for the rig: " + std::string(hold.status().message()));
  const absl::StatusOr<v1::Session> session =
      driven(item, {.client = item.added_by(), .hold = hold->get_deleter().token}, stop);
  if (stop.stop_requested() && !session.ok()) return;
  if (!session.ok()) {
    const bool nodes_may_come = Clock::now() < started_ + kNodesRegister;
    const std::string why(session.status().message());
    if (nodes_may_come) return says(item, why);
    return may_pass(session.status()) ? try_again(item, why, stop) : has_failed(item, why);
  }
  driven_.insert(item.number());
  due_.erase(item.number());
  if (item.session() == session->name() && item.reason().empty()) return;
  (void)update(item.number(), {v1::QUEUE_ITEM_STATE_RUNNING},
               item.session().empty() ? "captured as session " + session->name() : "",
               [&](v1::QueueItem& now) {
                 now.set_session(session->name());
                 now.clear_reason();
               });
}

// --- outcomes

std::string CaptureQueue::unusual(const std::string& name) {
  absl::StatusOr<v1::Session> session = parts_.sessions.find(name);
  if (session.ok()) session = parts_.sessions.judged(*std::move(session));
  return session.ok() && session->verdict().outlier() ? "unusual: " + session->verdict().text() : "";
}

void CaptureQueue::is_captured(const v1::QueueItem& item) {
  if (!has_rig(item)) return;
  leave_the_rig(item);
  (void)update(item.number(), {item.state()}, "captured", [](v1::QueueItem& now) {
    now.set_state(v1::QUEUE_ITEM_STATE_SOLVING);
    now.clear_reason();
    now.clear_waits_since();
  });
}

void CaptureQueue::date(const v1::QueueItem& item, const v1::Session& session) {
  if (item.wish().deadline().empty() || dated_.contains(item.number())) return;
  const std::vector<v1::Session> views(session.views().begin(), session.views().end());
  for (const v1::Session& each : views.empty() ? std::vector{session} : views) {
    const absl::Status dated = parts_.jobs.set_deadline(each.job(), time_of(item.wish().deadline()));
    if (!dated.ok() && !absl::IsNotFound(dated)) return;  // NOT_FOUND: it is solved
  }
  dated_.insert(item.number());
}

void CaptureQueue::is_solved(const v1::QueueItem& item, const v1::Session& session) {
  if (item.wish().background().empty()) return is_done(item);
  if (has_rig(item)) return is_captured(item);  // and looked at again
  std::vector<std::string> mattes;
  for (const v1::Session& view : session.views()) mattes.push_back(view.name());
  if (mattes.empty()) mattes.push_back(session.name());
  const std::optional<absl::Status> made =
      composites_.outcome(mattes, {item.wish().background().begin(), item.wish().background().end()});
  if (!made) return says(item, "is composited");
  if (!made->ok()) return has_failed(item, "solved, but not composited: " + std::string(made->message()));
  const absl::Status noted =
      update(item.number(), {item.state()}, "composited", [](v1::QueueItem& now) { now.clear_reason(); });
  if (noted.ok()) is_done(item);
}

void CaptureQueue::is_done(const v1::QueueItem& item) {
  is_over(item);
  tell_if_over();
}

void CaptureQueue::is_over(const v1::QueueItem& item) {
  const std::string unusual = this->unusual(item.session());
  if (has_rig(item)) leave_the_rig(item);
  (void)update(item.number(), {item.state()}, unusual.empty() ? "done" : "done; " + unusual,
               [&](v1::QueueItem& now) {
                 now.set_state(v1::QUEUE_ITEM_STATE_DONE);
                 now.set_reason(unusual);
                 now.clear_waits_since();
                 now.set_ended(utc_now_rfc3339());
               });
}

void CaptureQueue::has_failed(const v1::QueueItem& item, const std::string& why) {
  if (item.state() != v1::QUEUE_ITEM_STATE_SOLVING) leave_the_rig(item);
  const absl::Status stored = update(item.number(),
                                     {v1::QUEUE_ITEM_STATE_WAITING, v1::QUEUE_ITEM_STATE_RUNNING,
                                      v1::QUEUE_ITEM_STATE_PAUSED, v1::QUEUE_ITEM_STATE_SOLVING},
                                     "failed: " + why, [&](v1::QueueItem& now) {
                                       now.set_state(v1::QUEUE_ITEM_STATE_FAILED);
                                       now.set_reason(why);
                                       now.clear_waits_since();
                                       now.set_ended(utc_now_rfc3339());
                                     });
  if (!stored.ok()) return;
  tell({.what = "needs-operator",
        .session = item.session(),
        .text = title(item) + " of the queue failed: " + why,
        .advice = fmt::format("glasswing queue show {}", item.number())});
  tell_if_over();
}

void CaptureQueue::leave_the_rig(const v1::QueueItem& item) {
  due_.erase(item.number());
  if (!item.wish().pause_after()) return;
  v1::SetQueueRequest request;
  request.set_why(fmt::format("as wished after item {}", item.number()));
  if (const absl::Status set = this->set(request, {}).status(); !set.ok())
    spdlog::error("the queue is not paused after item={} error=\"{}\"", item.number(),
                  std::string(set.message()));
}

void CaptureQueue::tell(const Event& event) {
  std::function<void(const Event&)> observer;
  {
    const std::lock_guard lock(mutex_);
    observer = observer_;
  }
  if (observer) observer(event);
}

bool CaptureQueue::retake_unusual() {
  std::vector<v1::QueueItem> asking;
  {
    const std::lock_guard lock(mutex_);
    for (const v1::QueueItem& item : store_.items()) {
      if (!has_ended(item)) return false;
      if (item.state() == v1::QUEUE_ITEM_STATE_DONE && item.wish().retake_unusual()) asking.push_back(item);
    }
  }
  bool any = false;
  for (const v1::QueueItem& item : asking) {
    const std::string why = unusual(item.session());  // its series has grown since
    std::string copied;
    if (!why.empty()) {
      v1::AddQueueItemRequest copy;
      copy.set_request_id(fmt::format("retake of {}", request_id(item)));
      *copy.mutable_wish() = copied_wish(item.wish());
      copy.mutable_wish()->clear_retake_unusual();
      const absl::StatusOr<v1::QueueItem> added = add(copy, {.client = item.added_by(), .hold = ""});
      copied = added.ok() ? fmt::format("; captured again as item {}", added->number())
                          : fmt::format("; not captured again: {}", std::string(added.status().message()));
      any = any || added.ok();
    }
    (void)update(item.number(), {item.state()}, why + copied, [&](v1::QueueItem& now) {
      now.mutable_wish()->clear_retake_unusual();
      now.set_reason(why + copied);
    });
  }
  return any;
}

void CaptureQueue::tell_if_over() {
  if (retake_unusual()) return;
  int done = 0;
  std::string failed, unusual;
  {
    const std::lock_guard lock(mutex_);
    for (const v1::QueueItem& item : store_.items()) {
      if (!has_ended(item)) return;
      if (item.ended() < store_.state().since()) continue;
      const bool is_done = item.state() == v1::QUEUE_ITEM_STATE_DONE;
      if (is_done) ++done;
      if (!item.reason().empty())
        (is_done ? unusual : failed) += fmt::format("; {}: {}", title(item), item.reason());
    }
  }
  tell({.what = "queue-done",
        .session = "",
        .text = fmt::format("the queue is done: {} captured{}{}", done, failed, unusual),
        .advice = "glasswing queue list --all"});
}

}  // namespace glasswing
