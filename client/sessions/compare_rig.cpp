#include "client/sessions/compare_rig.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "core/base/status.h"
#include "core/cli/interrupt.h"
#include "core/cli/output.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/node_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"
#include "glasswing/v1/storage_service.grpc.pb.h"

namespace glasswing {
namespace {

// A node's archives. Stays connected, since it is needed for each session.
struct Keeper {
  explicit Keeper(const std::string& title_in, const std::string& address)
      : title(title_in), archives(title_in, address) {}

  const std::string title;  // "camera node camera-1 at 127.0.0.1:7442"
  const Peer<v1::ArchiveService> archives;
  bool answers = true;
};

bool is_away(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status);
}

// Whether the archive has the frames that the catalogue counts. A running or abandoned capture may have any
// number.
bool has_settled_frames(const v1::Session& session) {
  return session.proven_count() > 0 && session.state() != v1::SESSION_STATE_CREATED &&
         session.state() != v1::SESSION_STATE_CAPTURING && session.state() != v1::SESSION_STATE_CANCELLED;
}

class Comparison {
 public:
  Comparison(const Client& client, RigReport& report)
      : report_(report),
        server_(client.server_title(), client.server),
        nodes_(server_.title, client.server),
        storage_(server_.title, client.server) {}

  absl::Status run(const std::function<void(double)>& tell) {
    GW_ASSIGN_OR_RETURN(const v1::ListNodesResponse nodes,
                        call(nodes_, &v1::NodeService::Stub::ListNodes, {}));
    for (const v1::Node& node : nodes.nodes()) {
      if (!node.up() || node.kind() == v1::NODE_KIND_DISPLAY || node.address().empty()) continue;
      addresses_[node.name()] = node.address();
      const char* kind = node.kind() == v1::NODE_KIND_CAMERA ? "camera node" : "solver";
      keepers_.try_emplace(node.address(), fmt::format("{} {} at {}", kind, node.name(), node.address()),
                           node.address());
    }
    GW_ASSIGN_OR_RETURN(const v1::ListSessionsResponse listed,
                        call(server_, &v1::SessionService::Stub::ListSessions, {}));
    for (int i = 0; i < listed.sessions_size(); ++i) {
      if (interrupted()) return absl::CancelledError("the comparison was interrupted");
      known_.insert(listed.sessions(i).name());
      compare_archives(listed.sessions(i));
      GW_RETURN_IF_ERROR(compare_mattes(listed.sessions(i)));
      tell((i + 1.0) / listed.sessions_size());
    }
    // A server of an earlier version has no trash.
    const absl::StatusOr<v1::GetUsageResponse> usage =
        call_pages(storage_, &v1::StorageService::Stub::GetUsage, {}, kLongCallTimeout);
    if (usage.ok())
      for (const v1::SessionUsage& session : usage->sessions()) known_.insert(session.name());
    // After the sessions: one that began meanwhile is looked up by name.
    for (auto& [address, keeper] : keepers_) GW_RETURN_IF_ERROR(find_strangers(keeper));
    return absl::OkStatus();
  }

 private:
  Keeper& keeper_at(const std::string& address) {
    return keepers_.try_emplace(address, "node at " + address, address).first->second;
  }
  void is_silent(Keeper& keeper, const absl::Status& why) {
    keeper.answers = false;
    report_.unanswered.push_back(fmt::format("{}: {}", keeper.title, std::string(why.message())));
  }

  void compare_archives(const v1::Session& session) {
    if (!has_settled_frames(session)) return;
    if (!session.archive_address().empty())
      compare_archive(session, keeper_at(session.archive_address()), !session.copies().empty());
    for (const v1::ArchiveCopy& copy : session.copies()) {
      if (copy.address().empty()) continue;  // never completed
      const auto now = addresses_.find(copy.node());
      compare_archive(session, keeper_at(now == addresses_.end() ? copy.address() : now->second), true);
    }
  }

  // `elsewhere`: another node may also have the frames.
  void compare_archive(const v1::Session& session, Keeper& keeper, bool elsewhere) {
    if (!keeper.answers) return;
    v1::GetManifestRequest request;
    request.set_session(session.name());
    const absl::StatusOr<v1::GetManifestResponse> archive =
        call(keeper.archives, &v1::ArchiveService::Stub::GetManifest, request, kLongCallTimeout);
    if (is_away(archive.status())) return is_silent(keeper, archive.status());
    ++report_.found.file_count;
    std::string what(archive.status().message());
    if (absl::IsNotFound(archive.status()))
      what = "the catalogue has the session, but this node has no archive of it";
    if (archive.ok()) {
      const int frames = archive->manifest().frames_size();
      if (frames >= session.proven_count()) return;
      what = fmt::format("it lists {} frames; the catalogue counts {}", frames, session.proven_count());
    }
    report_.found.findings.push_back(
        {.file = fmt::format("archive of session \"{}\" on {}", session.name(), keeper.title),
         .what = what,
         .meaning = elsewhere
                        ? "solves read another copy, if one is complete; glasswing replicate makes new copies"
                        : fmt::format("its frames cannot be read: restore the archive from a backup, or give "
                                      "up the session with glasswing delete {} --now",
                                      session.name()),
         .repair = ""});
  }

  absl::Status compare_mattes(const v1::Session& session) {
    if (!allows(session, v1::SESSION_ACTION_FETCH)) return absl::OkStatus();
    if (!is_video(session)) return compare_matte(session, std::nullopt);
    for (const int frame : session.solved_frames()) {
      if (interrupted()) break;
      GW_RETURN_IF_ERROR(compare_matte(session, frame));
    }
    return absl::OkStatus();
  }

  // The server verifies a whole matte before it sends the first chunk.
  absl::Status compare_matte(const v1::Session& session, std::optional<int> frame) {
    v1::FetchMatteRequest request;
    request.set_name(session.name());
    if (frame) request.set_frame(*frame);
    grpc::ClientContext context;
    set_deadline(context, kLongCallTimeout);
    const auto reader = server_.stub->FetchMatte(&context, request);
    v1::FetchMatteResponse first;
    const bool is_whole = reader->Read(&first);
    if (is_whole) context.TryCancel();
    const grpc::Status status = reader->Finish();
    if (!is_whole && is_away(from_grpc(status))) return status_from(status, server_.title);
    // Another solve may have begun, or the session may be deleted.
    if (!is_whole && status.error_code() != grpc::StatusCode::DATA_LOSS) return absl::OkStatus();
    ++report_.found.file_count;
    if (is_whole) return absl::OkStatus();
    report_.found.findings.push_back(
        {.file = frame ? fmt::format("matte of frame {} of session \"{}\"", *frame, session.name())
                       : fmt::format("matte of session \"{}\"", session.name()),
         .what = status.error_message(),
         .meaning = "it cannot be fetched; solve it again from its frames",
         .repair = ""});
    return absl::OkStatus();
  }

  absl::Status find_strangers(Keeper& keeper) {
    if (!keeper.answers) return absl::OkStatus();
    grpc::ClientContext context;
    set_deadline(context, kLongCallTimeout);
    const auto reader = keeper.archives.stub->ListArchives(&context, {});
    std::vector<std::string> strangers;
    for (v1::ListArchivesResponse some; reader->Read(&some);) {
      for (const std::string& name : some.sessions())
        if (!known_.contains(name)) strangers.push_back(name);
    }
    const absl::Status status = from_grpc(reader->Finish());
    if (absl::IsUnimplemented(status)) return absl::OkStatus();  // a solver without archives
    if (!status.ok()) is_silent(keeper, status);
    for (const std::string& name : strangers) {
      v1::GetSessionRequest request;
      request.set_name(name);
      if (!absl::IsNotFound(call(server_, &v1::SessionService::Stub::GetSession, request).status())) continue;
      report_.found.findings.push_back(
          {.file = fmt::format("archive of session \"{}\" on {}", name, keeper.title),
           .what = "the catalogue has no such session",
           .meaning = "it belongs to another server, or to an earlier catalogue; to make it a session, run "
                      "glasswing import on the archive's directory, on the node's machine",
           .repair = "",
           .is_damage = false});
    }
    return absl::OkStatus();
  }

  RigReport& report_;
  const Peer<v1::SessionService> server_;
  const Peer<v1::NodeService> nodes_;
  const Peer<v1::StorageService> storage_;
  std::map<std::string, std::string> addresses_;  // by node
  std::map<std::string, Keeper> keepers_;         // by address
  std::set<std::string> known_;                   // sessions
};

}  // namespace

absl::StatusOr<RigReport> compare_rig(const Client& client,
                                      const std::function<void(double fraction)>& tell) {
  RigReport report;
  report.found.kind = "rig";
  GW_RETURN_IF_ERROR(Comparison(client, report).run(tell));
  return report;
}

}  // namespace glasswing
