#include "client/capture/watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <iostream>
#include <optional>
#include <string>
#include <vector>

#include "client/capture/commands.h"
#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/interrupt.h"
#include "core/cli/output.h"
#include "core/cli/progress.h"
#include "core/pattern/draft_stages.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

// A session at rest can be deleted; a failed solve can be cancelled too, to return to its previous matte.
bool is_under_way(const v1::Session& session) {
  return allows(session, v1::SESSION_ACTION_CANCEL) && !allows(session, v1::SESSION_ACTION_DELETE);
}

class SessionProgress {
 public:
  void update(const v1::Session& session) {
    if (session.state() != state_) progress_.emplace(state_name(session.state()));
    state_ = session.state();
    if (is_under_way(session) && session.waiting().what() != told_) tell(session);
    if (session.draft().image_count() != drafted_) tell_draft(session);
    if (session.adapted_size() != rounds_told_) tell_rounds(session);
    if (changes_of(session) != changes_told_) tell_changes(session);
    const bool solving = state_ == v1::SESSION_STATE_SOLVING,
               frames = solving && is_video(session) && !session.matte_ready();
    const int done = frames    ? session.solved_frames_size()
                     : solving ? session.tiles_done()
                               : session.proven_count();
    const int count = frames    ? frames_to_solve(session)
                      : solving ? session.tile_count()
                                : session.step_count();
    if (!told_.empty() && done == done_) return;
    done_ = done;
    const std::string retaken =
        !solving && session.retaken_count() > 0 ? fmt::format(", {} retaken", session.retaken_count()) : "";
    if (solving && count == 0) return progress_->update_unknown(tiles_text(session));
    progress_->update(count > 0 ? static_cast<double>(done) / count : 0.0,
                      fmt::format("{} of {} {}{}", done, count,
                                  frames    ? "frames"
                                  : solving ? "tiles"
                                            : "steps",
                                  retaken));
  }

 private:
  // Prints what the session waits for, or that it continues, on a separate line. The time left counts from
  // when the work continues.
  void tell(const v1::Session& session) {
    told_ = session.waiting().what();
    progress_.emplace(state_name(state_));
    std::cerr << printable(summary_of(session)) << "\n";
  }

  // Also on a separate line.
  void tell_draft(const v1::Session& session) {
    drafted_ = session.draft().image_count();
    if (!session.has_draft()) return;
    progress_.emplace(state_name(state_));
    done_ = -1;
    std::cerr << fmt::format("{}: glasswing fetch {} -o {}.exr --partial\n", describe(session.draft()),
                             session.name(), session.name());
  }

  // Also on separate lines.
  void tell_rounds(const v1::Session& session) {
    progress_.emplace(state_name(state_));
    done_ = -1;
    for (; rounds_told_ < session.adapted_size(); ++rounds_told_)
      std::cerr << describe(session.adapted(rounds_told_)) << "\n";
  }

  // Without numbers that change while the condition lasts.
  static std::vector<std::string> changes_of(const v1::Session& session) {
    std::vector<std::string> changes;
    for (const v1::RigChange& change : session.rig_changes()) changes.push_back(change.what());
    return changes;
  }

  // Also on separate lines.
  void tell_changes(const v1::Session& session) {
    progress_.emplace(state_name(state_));
    done_ = -1;
    for (const v1::RigChange& change : session.rig_changes()) {
      if (std::ranges::count(changes_told_, change.what()) == 0)
        std::cerr << printable("warning: " + describe(change)) << "\n";
    }
    changes_told_ = changes_of(session);
  }

  int rounds_told_ = 0;
  std::vector<std::string> changes_told_;
  int drafted_ = 0;   // images of the newest draft
  std::string told_;  // what it waits for
  int done_ = -1;
  v1::SessionState state_ = v1::SESSION_STATE_UNSPECIFIED;
  std::optional<Progress> progress_;
};

}  // namespace

absl::StatusOr<v1::Session> follow(const Client& client, const std::string& name, Follow until) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  v1::WatchSessionRequest request;
  request.set_name(name);
  SessionProgress progress;
  while (true) {
    grpc::ClientContext context;
    set_deadline(context, kLongCallTimeout);  // renewed, so that a hanging server is noticed
    const auto reader = server.stub->WatchSession(&context, request);
    const Interruptible ctrl_c([&context] { context.TryCancel(); });
    v1::WatchSessionResponse response;
    bool heard = false;
    while (reader->Read(&response)) {
      heard = true;
      progress.update(response.session());
      if (until == Follow::kUntilCaptured && response.session().state() == v1::SESSION_STATE_SOLVING) {
        context.TryCancel();
        (void)reader->Finish();
        return response.session();
      }
    }
    const grpc::Status status = reader->Finish();
    if (heard && status.ok()) return response.session();  // the server ends the stream when the session rests
    if (interrupted()) {
      return absl::CancelledError(
          fmt::format("session {} continues; glasswing watch {} shows it, glasswing cancel {} ends it", name,
                      name, name));
    }
    const bool renew = heard && status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
    if (!renew) return status_from(status, server.title);
  }
}

absl::Status outcome_of(const v1::Session& session, Goal goal) {
  switch (session.state()) {
    case v1::SESSION_STATE_CAPTURED:
      if (goal == Goal::kCapturedOrDone) return absl::OkStatus();
      return absl::FailedPreconditionError(
          fmt::format("{}; solve it with: glasswing solve {} --watch", summary_of(session), session.name()));
    case v1::SESSION_STATE_DONE:
      return absl::OkStatus();
    case v1::SESSION_STATE_PAUSED: {
      const std::string summary = summary_of(session);
      const std::string how = "glasswing resume " + session.name();
      const bool told = summary.find(how) != std::string::npos;
      return absl::FailedPreconditionError(told ? summary : summary + "; resume with: " + how);
    }
    default:
      return absl::FailedPreconditionError(summary_of(session));
  }
}

absl::Status follow_to_outcome(const Client& client, const std::string& name, Goal goal) {
  GW_ASSIGN_OR_RETURN(const v1::Session session, follow(client, name));
  const absl::Status outcome = outcome_of(session, goal);
  if (outcome.ok() || client.json) print_session(session, client.json);
  return outcome;
}

void add_watch_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand(
      "watch",
      "Show a session's progress until it comes to rest; succeeds only if it is then captured or "
      "done.");
  command.footer("Example:\n  glasswing watch vase");
  auto name = std::make_shared<std::string>();
  command.add_option("session", *name, "the session's name")->required();
  command.callback(
      [&client, name] { client.run = [&client, name] { return follow_to_outcome(client, *name); }; });
}

}  // namespace glasswing
