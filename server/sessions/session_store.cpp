#include "server/sessions/session_store.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/base/status.h"
#include "core/base/time.h"
#include "server/sessions/series.h"
#include "server/sessions/session_state.h"
#include "server/sessions/verdict.h"
#include "server/sessions/views.h"

namespace glasswing {
namespace {

// Of a session with views also theirs; then it is unusual if one of them is.
void enter_verdict(const Verdicts& verdicts, const std::vector<v1::Session>& stored, v1::Session& session) {
  if (session.views().empty()) {
    v1::SessionVerdict verdict = verdicts.of(session);
    if (!verdict.measures().empty()) *session.mutable_verdict() = std::move(verdict);
    return;
  }
  std::string all, unusual;
  for (v1::Session& view : *session.mutable_views()) {
    const auto whole = std::ranges::find(stored, view.name(), &v1::Session::name);
    if (whole == stored.end()) continue;
    v1::SessionVerdict verdict = verdicts.of(*whole);
    if (verdict.measures().empty()) continue;
    std::string& text = verdict.outlier() ? unusual : all;
    text += fmt::format("{}camera {}: {}", text.empty() ? "" : "; ", view.view_camera(), verdict.text());
    session.mutable_verdict()->set_others(verdict.others());
    *view.mutable_verdict() = std::move(verdict);
  }
  if (!session.has_verdict()) return;
  session.mutable_verdict()->set_outlier(!unusual.empty());
  session.mutable_verdict()->set_text(unusual.empty() ? all : unusual);
}

}  // namespace

absl::StatusOr<std::unique_ptr<SessionStore>> SessionStore::open(const std::filesystem::path& data) {
  GW_ASSIGN_OR_RETURN(std::unique_ptr<Catalogue> catalogue, Catalogue::open(data / "catalogue.sqlite"));
  return std::unique_ptr<SessionStore>(new SessionStore(std::move(catalogue)));
}

v1::Session SessionStore::Edit::live(const v1::Session& stored) const {
  const auto live = store_.live_.find(stored.name());
  if (live == store_.live_.end()) return stored;
  // These change independently of the capture or solve that shows the live view.
  v1::Session session = live->second;
  session.set_note(stored.note());
  *session.mutable_tags() = stored.tags();
  *session.mutable_copies() = stored.copies();
  return session;
}

absl::StatusOr<v1::Session> SessionStore::Edit::find(const std::string& name) const {
  GW_ASSIGN_OR_RETURN(v1::Session session, find_any(name));
  if (!session.views().empty()) return choose_view(session);
  return session;
}

absl::StatusOr<v1::Session> SessionStore::Edit::find_any(const std::string& name) const {
  GW_ASSIGN_OR_RETURN(std::vector<v1::Session> sessions, find_each(name));
  return sessions.front().name() == name ? std::move(sessions.front()) : sum_of(sessions);
}

absl::StatusOr<std::vector<v1::Session>> SessionStore::Edit::find_each(const std::string& name) const {
  GW_ASSIGN_OR_RETURN(std::vector<v1::Session> sessions, find_each_anywhere(name));
  const absl::Status first = check_not_in_trash(sessions.front());
  std::erase_if(sessions, [](const v1::Session& session) { return !session.deleted().empty(); });
  if (sessions.empty()) return first;
  return sessions;
}

absl::StatusOr<std::vector<v1::Session>> SessionStore::Edit::find_each_anywhere(
    const std::string& name) const {
  const absl::StatusOr<v1::Session> stored = store_.catalogue_->find_anywhere(name);
  if (stored.ok()) return std::vector<v1::Session>{live(*stored)};
  if (!absl::IsNotFound(stored.status())) return stored.status();
  GW_ASSIGN_OR_RETURN(std::vector<v1::Session> views, store_.catalogue_->views_anywhere(name));
  if (views.empty()) return stored.status();
  for (v1::Session& view : views) view = live(view);
  return views;
}

absl::Status SessionStore::Edit::insert(const std::vector<v1::Session>& sessions,
                                        const std::string& request_id) {
  // A session and views of its name exclude each other.
  for (const v1::Session& session : sessions) {
    GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> views,
                        store_.catalogue_->views_anywhere(session.name()));
    if (!views.empty()) return name_taken(views.front());
    if (session.view_of().empty()) continue;
    const absl::StatusOr<v1::Session> other = store_.catalogue_->find_anywhere(session.view_of());
    if (other.ok()) return name_taken(*other);
    if (!absl::IsNotFound(other.status())) return other.status();
  }
  return store_.catalogue_->insert(sessions, request_id);
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

absl::Status SessionStore::check_free(const std::string& name) {
  const absl::StatusOr<std::vector<v1::Session>> found = edit().find_each_anywhere(name);
  if (absl::IsNotFound(found.status())) return absl::OkStatus();
  return found.ok() ? name_taken(found->front()) : found.status();
}

absl::StatusOr<v1::Session> SessionStore::find_request(const std::string& request_id) {
  GW_ASSIGN_OR_RETURN(v1::Session session, catalogue_->find_request(request_id));
  if (!session.view_of().empty()) return find_any(session.view_of());
  return session;
}

absl::StatusOr<std::vector<v1::Session>> SessionStore::list(const v1::ListSessionsRequest& request) {
  GW_RETURN_IF_ERROR(matches({}, request).status());  // also where there is no session
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> stored, all_stored());
  GW_ASSIGN_OR_RETURN(auto qualities, catalogue_->qualities(""));
  const Verdicts verdicts(stored, std::move(qualities));
  std::vector<v1::Session> sessions;
  std::set<std::string> summed;
  for (const v1::Session& each : stored) {
    if (!each.view_of().empty() && !summed.insert(each.view_of()).second) continue;
    absl::StatusOr<v1::Session> session =
        each.state() == v1::SESSION_STATE_DAMAGED ? each : find_any(capture_name(each));
    if (absl::IsNotFound(session.status())) continue;  // deleted just now
    GW_RETURN_IF_ERROR(session.status());
    GW_ASSIGN_OR_RETURN(const bool wanted, matches(*session, request));
    if (!wanted) continue;
    v1::Session listed = with_allowed_actions(*std::move(session));  // they depend on the plan
    enter_verdict(verdicts, stored, listed);
    if (listed.has_verdict()) listed.mutable_verdict()->clear_measures();
    for (v1::Session& view : *listed.mutable_views()) {
      if (view.has_verdict()) view.mutable_verdict()->clear_measures();
    }
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
  if (session.views().empty() && !Verdicts::judges(session)) return session;  // without reading any other
  const std::string series = series_of(capture_name(session));
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> stored, catalogue_->named(series));
  GW_ASSIGN_OR_RETURN(auto qualities, catalogue_->qualities(series));
  enter_verdict(Verdicts(stored, std::move(qualities)), stored, session);
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
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> sessions, edit.find_each(request.name()));
  for (const v1::Session& session : sessions) {
    v1::AnnotateSessionRequest own = request;
    own.set_name(session.name());
    GW_RETURN_IF_ERROR(catalogue_->annotate(own).status());
  }
  edit.announce();
  return edit.find_any(request.name());
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
