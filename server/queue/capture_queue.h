// Captures that wait for the rig and for their conditions, and run one after the other without a client. An
// item becomes one session, which its request id names, so that no restart captures it twice; a capture that
// broke off is continued.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "server/capture/capture_runner.h"
#include "server/events/session_events.h"
#include "server/jobs/job_store.h"
#include "server/queue/composites.h"
#include "server/queue/queue_store.h"
#include "server/rig/calibration_store.h"
#include "server/rig/node_registry.h"
#include "server/rig/rig_lock.h"
#include "server/sessions/session_store.h"

namespace glasswing {

// Thread-safe. Errors are those that queue_service.proto lists.
class CaptureQueue {
 public:
  struct Parts {
    SessionStore& sessions;
    CaptureRunner& captures;
    RigLock& rig_lock;
    const NodeRegistry& nodes;
    const CalibrationStore& calibrations;
    ImageFiles& images;
    const MatteFiles& mattes;
    JobStore& jobs;
  };
  CaptureQueue(QueueStore& store, const Parts& parts)
      : parts_(parts), store_(store), composites_(parts.mattes, parts.images) {}
  // Ends its thread; what it captures is left to the CaptureRunner, and goes on after a restart.
  ~CaptureQueue() = default;

  // Begins to run items, once the sessions are taken up.
  void start();

  absl::StatusOr<v1::QueueItem> add(const v1::AddQueueItemRequest& request, const Caller& caller);
  absl::StatusOr<v1::QueueItem> edit(const v1::EditQueueItemRequest& request, const Caller& caller);
  absl::StatusOr<v1::QueueItem> move(const v1::MoveQueueItemRequest& request, const Caller& caller);
  absl::StatusOr<v1::QueueItem> duplicate(const v1::DuplicateQueueItemRequest& request, const Caller& caller);
  absl::Status remove(std::int64_t number, const Caller& caller);
  absl::StatusOr<v1::QueueItem> run_now(std::int64_t number, const Caller& caller);
  absl::StatusOr<v1::QueueItem> approve(std::int64_t number, const Caller& caller);
  absl::StatusOr<v1::QueueState> set(const v1::SetQueueRequest& request, const Caller& caller);

  absl::StatusOr<v1::QueueHold> hold(const v1::HoldQueueRequest& request, const Caller& caller);
  absl::Status release(std::int64_t hold, const Caller& caller);

  absl::StatusOr<v1::QueueItem> find(std::int64_t number);
  // Without plans.
  std::vector<v1::QueueItem> list(bool ended);
  v1::QueueState state();
  // Newest first.
  absl::StatusOr<std::vector<v1::QueueEvent>> history(std::int64_t item);

  // The composite of a session, or of one of its views. NOT_FOUND: it has none.
  absl::StatusOr<PositionedFile> composite(const std::string& session);
  // That items name.
  std::set<std::string> images();

  // Calls `observer` with what people want to be told of; it must be quick. One at a time; null: none.
  void observe(std::function<void(const Event&)> observer);

 private:
  using Change = std::function<void(v1::QueueItem&)>;

  // `what` goes into the history, with who; of the queue itself: nobody.
  absl::StatusOr<v1::QueueItem> change_waiting(std::int64_t number, const std::string& verb,
                                               const std::string& what, const Caller& caller,
                                               const Change& change);
  // INVALID_ARGUMENT: the wish, or it names images that are not there.
  absl::Status check(const v1::QueueWish& wish) const;
  // What an item named no longer.
  void release(const v1::QueueWish& wish);
  absl::StatusOr<v1::QueueItem> find_waiting(std::int64_t number, const std::string& verb) const;
  // Changes the item if it is in one of the states; `what` empty: history need not know.
  absl::Status update(std::int64_t number, std::initializer_list<v1::QueueItemState> in,
                      const std::string& what, const Change& change);
  void wake();

  void run(std::stop_token stop);
  void look(const std::stop_token& stop);
  std::vector<v1::QueueItem> active();  // that run, are paused or are solved
  // What became of the item's session.
  void follow(const v1::QueueItem& item, const std::stop_token& stop);
  void broke_off(const v1::QueueItem& item, const v1::Session& session, const std::stop_token& stop);
  std::optional<v1::QueueItem> next();
  void begin_next(const std::stop_token& stop);
  // True: a person need not act, or has.
  bool may_begin(const v1::QueueItem& item);
  bool wait_for_person(const v1::QueueItem& item, const std::string& why);
  std::string unsteady(const v1::QueueItem& item);
  // Why the rig must be free for people while the item would be captured; empty: it need not.
  std::string held_for_people(const v1::QueueItem& item);
  // How long its capture takes; 0: unknown now.
  absl::Duration expected(const v1::QueueItem& item);
  // Its state, without holds that are over. Call it with mutex_ held.
  v1::QueueState current_state() const;

  // Creates the item's session, or lets it go on.
  void drive(const v1::QueueItem& item, const std::stop_token& stop);
  absl::StatusOr<v1::Session> driven(const v1::QueueItem& item, const Caller& holding,
                                     const std::stop_token& stop);
  absl::StatusOr<v1::Session> created(const v1::QueueItem& item, const std::string& request_id,
                                      const Caller& holding, const std::stop_token& stop);
  absl::Status check_rig_for(const v1::QueueItem& item, const Caller& holding, const std::stop_token& stop);
  // Lights the plan's monitors for as long as the wish says.
  absl::Status warm_up(const v1::QueueItem& item, const Caller& holding, const std::stop_token& stop);
  absl::Status place_monitors(const v1::QueueItem& item, const Caller& holding, const std::stop_token& stop);
  void try_again(const v1::QueueItem& item, const std::string& why, const std::stop_token& stop);

  void is_captured(const v1::QueueItem& item);
  // Gives the session's solve the item's deadline.
  void date(const v1::QueueItem& item, const v1::Session& session);
  void is_solved(const v1::QueueItem& item, const v1::Session& session);
  void is_done(const v1::QueueItem& item);
  void is_over(const v1::QueueItem& item);
  void has_failed(const v1::QueueItem& item, const std::string& why);
  void says(const v1::QueueItem& item, const std::string& reason);
  // Called before that is stored: a server that is killed between the two pauses the queue all the same.
  void leave_the_rig(const v1::QueueItem& item);
  void tell(const Event& event);
  void tell_if_over();
  // Adds copies of items that are unusual and shall be captured again then. True: it added one.
  bool retake_unusual();
  // "unusual: ..." of an outlier of its series (SessionVerdict).
  std::string unusual(const std::string& session);

  const Parts parts_;
  const std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();

  std::mutex mutex_;  // guards the next four
  QueueStore& store_;
  std::function<void(const Event&)> observer_;
  bool woken_ = false;
  std::condition_variable_any wake_;

  // Of the thread alone.
  Composites composites_;
  std::set<std::int64_t> dated_;   // items whose solves have their deadline
  std::set<std::int64_t> driven_;  // items whose capture this process began, or let go on
  std::map<std::int64_t, std::chrono::steady_clock::time_point> due_;  // when an item is tried again

  struct Expected {
    std::chrono::steady_clock::time_point asked;
    absl::Duration takes;
  };
  std::map<std::int64_t, Expected> expected_;  // by item

  std::jthread thread_;
};

}  // namespace glasswing
