#include "server/archives/storage_keeper.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>

#include "core/base/status.h"
#include "core/process/pause.h"
#include "server/archives/replicas.h"
#include "server/sessions/series.h"

namespace glasswing {
namespace {

constexpr std::chrono::seconds kLookEvery(60);
constexpr int kRulesEvery = 60;  // looks

void note_failure(const char* what, const std::string& session, const absl::Status& status) {
  if (!status.ok()) spdlog::warn("{} session={} error=\"{}\"", what, session, std::string(status.message()));
}

}  // namespace

void StorageKeeper::start() {
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

void StorageKeeper::run(const std::stop_token& stop) {
  for (int look = 1; pause(stop, kLookEvery); ++look) {
    const absl::Time now = absl::Now();
    empty_trash(now);
    if (options_.rules.any() && look % kRulesEvery == 1)
      note_failure("rules not applied", "", apply_rules(false, now).status());
  }
}

absl::Time StorageKeeper::end_of(const std::string& since) const {
  absl::Time time = absl::InfiniteFuture();
  (void)absl::ParseTime(absl::RFC3339_full, since, &time, nullptr);
  return time + absl::Hours(options_.trash_hours);
}

v1::SessionUsage StorageKeeper::usage_of(const v1::Session& session,
                                         const std::vector<v1::Node>& nodes) const {
  v1::SessionUsage usage;
  usage.set_name(session.name());
  usage.set_series(series_of(session.name()));
  *usage.mutable_tags() = session.tags();
  usage.set_frame_bytes(session.archive_bytes());
  if (const std::string& address = session.archive_address(); !address.empty()) {
    const auto node = std::ranges::find(nodes, address, [](const v1::Node& each) { return each.address(); });
    usage.add_nodes(node == nodes.end() ? address : node->name());
  }
  for (const v1::ArchiveCopy& copy : session.copies()) {
    if (is_whole(copy)) usage.add_nodes(copy.node());
  }
  usage.set_matte_bytes(mattes_.bytes(session.name()));
  usage.set_deleted(session.deleted());
  const std::string& since = session.deleted().empty() ? session.frames_deleted() : session.deleted();
  if (!since.empty()) usage.set_ends(absl::FormatTime(absl::RFC3339_sec, end_of(since), absl::UTCTimeZone()));
  return usage;
}

absl::StatusOr<std::vector<v1::SessionUsage>> StorageKeeper::usage() {
  const std::vector<v1::Node> nodes = nodes_.nodes();
  std::vector<v1::SessionUsage> usage;
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> sessions, sessions_.all_stored());
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> trash, sessions_.trash());
  for (const auto* list : {&sessions, &trash}) {
    for (const v1::Session& session : *list) usage.push_back(usage_of(session, nodes));
  }
  return usage;
}

absl::StatusOr<std::int64_t> StorageKeeper::remove(const std::string& session, bool trash,
                                                   std::string& ends) {
  if (!trash || options_.trash_hours <= 0.0) return deleter_.remove(session);
  GW_ASSIGN_OR_RETURN(const std::string since, deleter_.put_into_trash(session));
  ends = absl::FormatTime(absl::RFC3339_sec, end_of(since), absl::UTCTimeZone());
  return 0;
}

absl::StatusOr<std::vector<StoredSession>> StorageKeeper::stored() {
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> sessions, sessions_.all_stored());
  std::vector<StoredSession> stored;
  for (const v1::Session& session : sessions) {
    stored.push_back({.session = session,
                      .matte_bytes = mattes_.bytes(session.name()),
                      .solved = mattes_.finished_at(session.name())});
  }
  return stored;
}

absl::StatusOr<std::vector<v1::SessionEnding>> StorageKeeper::apply_rules(bool dry_run, absl::Time now) {
  if (!options_.rules.any()) {
    return absl::FailedPreconditionError(
        "the server has no rules by which sessions end; start it with --keep-newest or --keep-frames-days");
  }
  GW_ASSIGN_OR_RETURN(const std::vector<StoredSession> all, stored());
  std::vector<v1::SessionEnding> found = endings(options_.rules, all, now);
  if (dry_run) return found;
  std::vector<v1::SessionEnding> ended;
  for (v1::SessionEnding& ending : found) {
    const std::string& name = ending.session();
    std::string ends;
    const absl::Status status =
        ending.frames_only() ? deleter_.mark_frames(name) : remove(name, true, ends).status();
    note_failure("not ended", name, status);
    if (!status.ok()) continue;
    spdlog::info("ended session={} frames_only={} bytes={} rule=\"{}\"", name, ending.frames_only(),
                 ending.bytes(), ending.why());
    ended.push_back(std::move(ending));
  }
  return ended;
}

void StorageKeeper::empty_trash(absl::Time now) {
  const absl::StatusOr<std::vector<v1::Session>> trash = sessions_.trash();
  note_failure("trash not read", "", trash.status());
  for (const v1::Session& session : trash.ok() ? *trash : std::vector<v1::Session>()) {
    if (end_of(session.deleted()) <= now)
      note_failure("not removed", session.name(), deleter_.remove(session.name()).status());
  }
  const absl::StatusOr<std::vector<StoredSession>> all = stored();
  note_failure("sessions not read", "", all.status());
  for (const auto& [session, bytes, solved] : all.ok() ? *all : std::vector<StoredSession>()) {
    if (session.frames_deleted().empty() || end_of(session.frames_deleted()) > now) continue;
    note_failure("frames not removed", session.name(), deleter_.remove_frames(session.name()));
  }
}

}  // namespace glasswing
