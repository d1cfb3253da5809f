#include "server/sessions/session_store.h"

#include <fmt/format.h>

#include <utility>

#include "core/base/status.h"
#include "core/base/time.h"
#include "server/sessions/session_state.h"
#include "server/sessions/verdict.h"

namespace glasswing {

namespace {

void enter_verdict(const Verdicts& verdicts, v1::Session& session) {
  v1::SessionVerdict verdict = verdicts.of(session);
  if (!verdict.measures().empty()) *session.mutable_verdict() = std::move(verdict);
}

}  // namespace

absl::StatusOr<std::unique_ptr<SessionStore>> SessionStore::open(const std::filesystem::path& data) {
  GW_ASSIGN_OR_RETURN(std::unique_ptr<Catalogue> catalogue, Catalogue::open(data / "catalogue.sqlite"));
  return std::unique_ptr<SessionStore>(new SessionStore(std::move(catalogue)));
}

absl::StatusOr<v1::Session> SessionStore::Edit::find(const std::string& name) const {
  GW_ASSIGN_OR_RETURN(const v1::Session stored, store_.catalogue_->find(name));
  const auto live = store_.live_.find(name);
  if (live == store_.live_.end()) return stored;
  // These change independently of the capture or solve that shows the live view.
  v1::Session session = live->second;
  session.set_note(stored.note());
  *session.mutable_tags() = stored.tags();
  *session.mutable_copies() = stored.copies();
  return session;
}

absl::Status SessionStore::Edit::insert(const v1::Session& session, const std::string& request_id) {
  return store_.catalogue_->insert(session, request_id);
}

absl::Status SessionStore::Edit::change(const v1::Session& session) {
  GW_RETURN_IF_ERROR(store_.catalogue_->update(session));
  store_.live_.erase(session.name());
  if (store_.observer_) store_.observer_(session);
  announce();
  return absl::OkStatus();
}

void SessionStore::Edit::show(const v1::Session& session) {
  v1::Session& live = store_.live_[session.name()];
  const std::string since = live.reason() == session.reason() ? live.waiting().since() : utc_now_rfc3339();
  live = session;
  live.clear_waiting();
  if (!session.reason().empty()) live.mutable_waiting()->set_since(since);
  if (store_.observer_) store_.observer_(session);
  announce();
}

absl::Status SessionStore::Edit::save_progress(const v1::Session& session) {
  return store_.catalogue_->update(session);
}

absl::Status SessionStore::Edit::note_progress(const v1::Session& session) {
  return store_.catalogue_->note(session);
}

absl::Status SessionStore::Edit::remove(const std::string& name) {
  GW_RETURN_IF_ERROR(store_.catalogue_->remove(name));
  store_.live_.erase(name);
  return absl::OkStatus();
}

void SessionStore::Edit::announce() {
  ++store_.change_count_;
  store_.changed_.notify_all();
}

absl::Status SessionStore::Edit::keep_finished(const v1::Session& session) {
  return store_.catalogue_->keep_finished(session);
}

absl::Status SessionStore::Edit::drop_finished(const std::string& name) {
  return store_.catalogue_->drop_finished(name);
}

absl::StatusOr<v1::Session> SessionStore::Edit::finished(const std::string& name) {
  return store_.catalogue_->finished(name);
}

absl::Status SessionStore::Edit::check_stays(const std::string& name) const {
  if (!store_.deleting_.contains(name)) return absl::OkStatus();
  return absl::FailedPreconditionError(fmt::format("session \"{}\" is being deleted", name));
}

absl::Status SessionStore::Edit::check_unused(const std::string& name) const {
  GW_RETURN_IF_ERROR(check_stays(name));
  if (store_.replicating_.contains(name)) {
    return absl::FailedPreconditionError(
        fmt::format("session \"{}\" is being replicated; wait for it, or interrupt that first", name));
  }
  return absl::OkStatus();
}

absl::Status SessionStore::Edit::begin_deleting(const std::string& name) {
  GW_RETURN_IF_ERROR(check_unused(name));
  store_.deleting_.insert(name);
  return absl::OkStatus();
}

void SessionStore::Edit::end_deleting(const std::string& name) {
  store_.deleting_.erase(name);
  announce();
}

void SessionStore::Edit::begin_replicating(const std::string& name) {
  store_.replicating_.insert(name);
}

void SessionStore::Edit::end_replicating(const std::string& name) {
  store_.replicating_.erase(store_.replicating_.find(name));
  announce();
}

absl::StatusOr<v1::Session> SessionStore::find(const std::string& name) {
  return edit().find(name);
}

absl::StatusOr<std::vector<v1::Session>> SessionStore::list(const v1::ListSessionsRequest& request) {
  GW_RETURN_IF_ERROR(matches({}, request).status());  // also where there is no session
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> stored, all_stored());
  const Verdicts verdicts(stored);
  std::vector<v1::Session> sessions;
  for (const v1::Session& each : stored) {
    absl::StatusOr<v1::Session> session =
        each.state() == v1::SESSION_STATE_DAMAGED ? each : find(each.name());
    if (absl::IsNotFound(session.status())) continue;  // deleted just now
    GW_RETURN_IF_ERROR(session.status());
    GW_ASSIGN_OR_RETURN(const bool wanted, matches(*session, request));
    if (!wanted) continue;
    v1::Session listed = with_allowed_actions(*std::move(session));  // they depend on the plan
    enter_verdict(verdicts, listed);
    if (listed.has_verdict()) listed.mutable_verdict()->clear_measures();
    // Long, and useless in a list, except for what distinguishes a calibration from a session with an object.
    v1::Plan plan;
    if (listed.plan().has_calibration()) *plan.mutable_calibration() = listed.plan().calibration();
    listed.clear_plan();
    if (plan.has_calibration()) *listed.mutable_plan() = std::move(plan);
    listed.clear_unproven();
    sessions.push_back(std::move(listed));
  }
  return sessions;
}

absl::StatusOr<v1::Session> SessionStore::judged(v1::Session session) {
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> stored, all_stored());
  enter_verdict(Verdicts(stored), session);
  return session;
}

std::optional<std::set<std::string>> SessionStore::photos() {
  std::set<std::string> photos;
  for (const auto& sessions : {all_stored(), trash()}) {
    if (!sessions.ok()) return std::nullopt;
    for (const v1::Session& session : *sessions) {
      if (session.state() == v1::SESSION_STATE_DAMAGED) return std::nullopt;
      photos.merge(photos_of(session));
    }
  }
  return photos;
}

std::set<std::string> photos_of(const v1::Session& session) {
  std::set<std::string> photos;
  for (const v1::Photo& photo : session.plan().photos()) photos.insert(photo.file());
  return photos;
}

absl::StatusOr<v1::Session> SessionStore::annotate(const v1::AnnotateSessionRequest& request) {
  Edit edit = this->edit();
  GW_RETURN_IF_ERROR(catalogue_->annotate(request).status());
  edit.announce();
  return edit.find(request.name());
}

void SessionStore::observe(std::function<void(const v1::Session&)> observer) {
  const std::lock_guard lock(mutex_);
  observer_ = std::move(observer);
}

std::int64_t SessionStore::wait_change(std::int64_t seen, std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, timeout, [&] { return change_count_ > seen; });
  return change_count_;
}

}  // namespace glasswing
