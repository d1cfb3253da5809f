#include "server/queue/capture_queue.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/base/time.h"
#include "core/file/fault_point.h"
#include "server/queue/queue_wish.h"
#include "server/rig/rig_link.h"
#include "server/selftest/rig_check.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds kLookEvery(200);
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

absl::StatusOr<v1::QueueItem> CaptureQueue::add(const v1::AddQueueItemRequest& request,
                                                const Caller& caller) {
  GW_RETURN_IF_ERROR(check_wish(request.wish()));
  v1::QueueItem item;
  item.set_state(v1::QUEUE_ITEM_STATE_WAITING);
  *item.mutable_wish() = request.wish();
  item.set_added(utc_now_rfc3339());
  item.set_added_by(caller.client);
  const std::lock_guard lock(mutex_);
  absl::StatusOr<v1::QueueItem> added =
      store_.add(std::move(item), request.request_id(), event_of(caller.client, 0, "added"));
  wake();
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
  v1::QueueWish wish = request.wish();
  if (!wish.has_plan()) {
    GW_ASSIGN_OR_RETURN(*wish.mutable_plan(), [&]() -> absl::StatusOr<v1::Plan> {
      GW_ASSIGN_OR_RETURN(const v1::QueueItem item, find(request.number()));
      return item.wish().plan();
    }());
  }
  GW_RETURN_IF_ERROR(check_wish(wish));
  return change_waiting(request.number(), "edited", "edited", caller, [&](v1::QueueItem& item) {
    *item.mutable_wish() = wish;
    item.clear_approved_by();  // what was approved is not what would run
  });
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
  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(const v1::QueueItem item, store_.find(number));
  if (item.state() == v1::QUEUE_ITEM_STATE_RUNNING) {
    return absl::FailedPreconditionError(
        item.session().empty() ? fmt::format("{} is about to be captured; ask again", title(item))
                               : fmt::format("{0} is being captured; cancel that first: glasswing cancel {1}",
                                             title(item), item.session()));
  }
  return store_.remove(number, event_of(caller.client, number, "removed: " + title(item)));
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
  if (store_.state().running() == request.running()) return store_.state();
  v1::QueueState state;
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

v1::QueueState CaptureQueue::state() {
  const std::lock_guard lock(mutex_);
  return store_.state();
}

absl::StatusOr<std::vector<v1::QueueEvent>> CaptureQueue::history(std::int64_t item) {
  const std::lock_guard lock(mutex_);
  return store_.history(item, 0, kMaxQueueEvents);
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
  const absl::StatusOr<v1::Session> session = parts_.sessions.find(item.session());
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
      return session->solve_follows() ? is_captured(item, true) : is_done(item);
    case v1::SESSION_STATE_SOLVING:
      is_captured(item, true);
      return says(item, session->reason());
    case v1::SESSION_STATE_DONE:
      return is_done(item);
    case v1::SESSION_STATE_CANCELLED:
      return has_failed(item, "its session was cancelled");
    case v1::SESSION_STATE_FAILED:
    case v1::SESSION_STATE_PAUSED:
      if (!rests_in_solve(*session)) return broke_off(item, *session, stop);
      is_captured(item, true);
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
  const absl::StatusOr<v1::Session> session = parts_.sessions.find(last);
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
    const absl::StatusOr<v1::Session> before = parts_.sessions.find(wish.empty_stage_of());
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
  if (session.ok()) session = parts_.sessions.find(session->name());  // as it is now
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
  GW_ASSIGN_OR_RETURN(v1::Session now, edit.find(session->name()));
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

void CaptureQueue::is_captured(const v1::QueueItem& item, bool solving) {
  if (!has_rig(item)) return;
  const absl::Status stored =
      update(item.number(), {item.state()}, solving ? "captured" : "done", [&](v1::QueueItem& now) {
        now.set_state(solving ? v1::QUEUE_ITEM_STATE_SOLVING : v1::QUEUE_ITEM_STATE_DONE);
        now.clear_reason();
        now.clear_waits_since();
        if (!solving) now.set_ended(utc_now_rfc3339());
      });
  if (stored.ok()) left_the_rig(item);
}

void CaptureQueue::is_done(const v1::QueueItem& item) {
  if (has_rig(item)) {
    is_captured(item, false);
  } else {
    (void)update(item.number(), {v1::QUEUE_ITEM_STATE_SOLVING}, "done", [](v1::QueueItem& now) {
      now.set_state(v1::QUEUE_ITEM_STATE_DONE);
      now.clear_reason();
      now.set_ended(utc_now_rfc3339());
    });
  }
  tell_if_over();
}

void CaptureQueue::has_failed(const v1::QueueItem& item, const std::string& why) {
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
  due_.erase(item.number());
  tell({.what = "needs-operator",
        .session = item.session(),
        .text = title(item) + " of the queue failed: " + why,
        .advice = fmt::format("glasswing queue show {}", item.number())});
  if (item.state() != v1::QUEUE_ITEM_STATE_SOLVING) left_the_rig(item);
  tell_if_over();
}

void CaptureQueue::left_the_rig(const v1::QueueItem& item) {
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

void CaptureQueue::tell_if_over() {
  int done = 0;
  std::string failed;
  {
    const std::lock_guard lock(mutex_);
    for (const v1::QueueItem& item : store_.items()) {
      if (!has_ended(item)) return;
      if (item.ended() < store_.state().since()) continue;
      if (item.state() == v1::QUEUE_ITEM_STATE_DONE) ++done;
      if (item.state() == v1::QUEUE_ITEM_STATE_FAILED)
        failed += fmt::format("; {}: {}", title(item), item.reason());
    }
  }
  tell({.what = "queue-done",
        .session = "",
        .text = fmt::format("the queue is done: {} captured{}", done, failed),
        .advice = "glasswing queue list --all"});
}

}  // namespace glasswing
