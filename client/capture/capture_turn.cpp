#include "client/capture/capture_turn.h"

#include <fmt/format.h>
#include <google/protobuf/util/message_differencer.h>

#include <algorithm>
#include <iostream>

#include "client/capture/capture.h"
#include "client/capture/operator.h"
#include "client/capture/watch.h"
#include "client/cli/camera_argument.h"
#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "core/base/utf8.h"
#include "core/cli/interrupt.h"
#include "core/cli/output.h"
#include "core/cli/progress.h"
#include "core/process/pause.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

constexpr std::chrono::minutes kPatience(5);  // with daemons that are away
constexpr std::chrono::seconds kPoll(1);

bool is_captured(const v1::Session& session) {
  return session.state() != v1::SESSION_STATE_CAPTURING && session.step_count() > 0 &&
         session.proven_count() == session.step_count() && session.state() != v1::SESSION_STATE_PAUSED &&
         session.state() != v1::SESSION_STATE_CANCELLED;
}

bool same_plan(v1::Plan a, v1::Plan b) {
  for (v1::Plan* plan : {&a, &b}) {
    plan->clear_rounds();
    plan->clear_retries();
  }
  return google::protobuf::util::MessageDifferencer::Equals(a, b);
}

// The series under way.
class Turn {
 public:
  using Annotate = std::function<absl::StatusOr<v1::Session>(v1::Session, const std::string&)>;
  Turn(const Client& client, const v1::CreateSessionRequest& request, v1::Axis axis, const Poses& poses,
       const Annotate& annotate)
      : client_(client),
        request_(request),
        axis_(std::move(axis)),
        positions_(poses.positions),
        names_(names_of_poses(request.name(), poses.positions)),
        annotate_(annotate) {}

  // The session of a pose, captured.
  absl::StatusOr<v1::Session> capture(size_t pose) {
    driven_ = false;
    heard_ = monotonic_now();
    int proven = -1;
    while (true) {
      absl::StatusOr<v1::Session> session = step(pose);
      if (session.ok() && is_captured(*session)) return session;
      if (session.ok() && session->proven_count() > proven) {
        proven = session->proven_count();
        heard_ = monotonic_now();
      }
      if (!session.ok()) GW_RETURN_IF_ERROR(bear(session.status()));
      if (session.ok() && session->state() == v1::SESSION_STATE_PAUSED && !waits_for_object(*session))
        GW_RETURN_IF_ERROR(bear(absl::UnavailableError(summary_of(*session))));
    }
  }

  // The session when its solve is over.
  absl::StatusOr<v1::Session> solved(const std::string& name) {
    heard_ = monotonic_now();
    while (true) {
      absl::StatusOr<v1::Session> session = follow(client_, name);
      if (session.ok()) return session;
      GW_RETURN_IF_ERROR(bear(session.status()));
    }
  }

  const std::vector<std::string>& names() const { return names_; }

 private:
  // Does what is next for the pose, and returns the session as it is then.
  absl::StatusOr<v1::Session> step(size_t pose) {
    absl::StatusOr<v1::Session> session = find(names_[pose]);
    if (absl::IsNotFound(session.status())) return create(pose);
    GW_RETURN_IF_ERROR(session.status());
    GW_RETURN_IF_ERROR(check_same(*session, positions_[pose]));
    if (std::ranges::count(session->tags(), request_.name()) == 0) {
      GW_ASSIGN_OR_RETURN(session, annotate(*std::move(session), pose));
    }
    if (is_captured(*session)) return session;
    switch (session->state()) {
      case v1::SESSION_STATE_CAPTURING:
        driven_ = true;
        return follow(client_, session->name(), Follow::kUntilCaptured);
      case v1::SESSION_STATE_CREATED:  // the server was killed before the capture began
        return remove(*session);
      case v1::SESSION_STATE_PAUSED:
      case v1::SESSION_STATE_FAILED:
        return resume(*session);
      default:
        return absl::FailedPreconditionError(
            fmt::format("{}; glasswing delete {} --now lets the series capture this pose again",
                        summary_of(*session), session->name()));
    }
  }

  absl::StatusOr<v1::Session> find(const std::string& name) {
    v1::GetSessionRequest request;
    request.set_name(name);
    GW_ASSIGN_OR_RETURN(v1::GetSessionResponse found,
                        call(server_, &v1::SessionService::Stub::GetSession, request));
    return std::move(*found.mutable_session());
  }

  absl::StatusOr<v1::Session> create(size_t pose) {
    v1::CreateSessionRequest request = request_;
    request.set_name(names_[pose]);
    (*request.mutable_axes())[axis_.name()] = positions_[pose];
    if (pose > 0 && !request.plan().skip_empty_stage()) request.set_empty_stage_of(names_[0]);
    driven_ = true;
    absl::StatusOr<v1::Session> session = create_session(client_, std::move(request));
    // It was created, and the answer was lost.
    if (absl::IsAlreadyExists(session.status())) return find(names_[pose]);
    GW_RETURN_IF_ERROR(session.status());
    return annotate(*std::move(session), pose);
  }

  absl::StatusOr<v1::Session> annotate(v1::Session session, size_t pose) {
    return annotate_(std::move(session),
                     fmt::format("{} at {} {}, pose {} of {}", axis_.name(), positions_[pose], axis_.unit(),
                                 pose + 1, names_.size()));
  }

  absl::StatusOr<v1::Session> remove(const v1::Session& session) {
    v1::CancelSessionRequest cancel;
    cancel.set_name(session.name());
    GW_RETURN_IF_ERROR(call(server_, &v1::SessionService::Stub::CancelSession, cancel).status());
    v1::DeleteSessionRequest remove;
    remove.set_name(session.name());
    GW_RETURN_IF_ERROR(
        call(server_, &v1::SessionService::Stub::DeleteSession, remove, kLongCallTimeout).status());
    return session;
  }

  // What failed under our eyes, or what somebody paused, is for people to look at: it may have been the stop.
  absl::StatusOr<v1::Session> resume(const v1::Session& session) {
    if (waits_for_object(session)) {
      if (!can_ask()) return outcome_of(session);
      GW_RETURN_IF_ERROR(ask_operator(what_to_do(session)));
    } else if (driven_ && (session.state() == v1::SESSION_STATE_FAILED ||
                           session.reason().starts_with("paused on request"))) {
      return outcome_of(session);
    }
    driven_ = true;
    v1::ResumeSessionRequest request;
    request.set_name(session.name());
    GW_ASSIGN_OR_RETURN(v1::ResumeSessionResponse resumed,
                        call(server_, &v1::SessionService::Stub::ResumeSession, request, kLongCallTimeout));
    return std::move(*resumed.mutable_session());
  }

  absl::Status check_same(const v1::Session& session, double position) const {
    const auto at = session.axes().find(axis_.name());
    const bool stands = session.axes().size() == 1 && at != session.axes().end() && at->second == position;
    if (stands && same_plan(session.plan(), request_.plan())) return absl::OkStatus();
    return absl::FailedPreconditionError(
        fmt::format("there is a session \"{}\" already, {}; name the series otherwise", session.name(),
                    stands ? "of another plan"
                           : fmt::format("which is not at {} of axis \"{}\"", position, axis_.name())));
  }

  absl::Status with_rest(const absl::Status& status) const {
    return absl::Status(status.code(),
                        std::string(status.message()) +
                            "; what is captured stays, and the same command goes on with the series");
  }

  // An error: OK after a moment, if it is of a daemon that is away, and not for too long.
  absl::Status bear(const absl::Status& error) {
    const bool away = absl::IsUnavailable(error) || absl::IsDeadlineExceeded(error);
    if (!away || interrupted() || monotonic_now() - heard_ > kPatience) return with_rest(error);
    const std::string why(error.message());
    if (why != told_) std::cerr << printable(why) << "; waiting\n";
    told_ = why;
    pause({}, kPoll);
    return absl::OkStatus();
  }

  const Client& client_;
  const v1::CreateSessionRequest& request_;
  const v1::Axis axis_;
  const std::vector<double> positions_;
  const std::vector<std::string> names_;
  const Annotate& annotate_;
  const Peer<v1::SessionService> server_{client_.server_title(), client_.server};
  bool driven_ = false;  // this run has begun or continued the pose
  nanoseconds heard_{};  // when something was last proven
  std::string told_;
};

}  // namespace

absl::Status check_turn(const std::string& session, const Poses& poses) {
  if (session.empty()) {
    return absl::InvalidArgumentError(
        "--turn needs --session: the sessions are called after it and their positions, as vase-010");
  }
  for (const std::string& name : names_of_poses(session, poses.positions))
    GW_RETURN_IF_ERROR(check_name("session", name));
  return absl::OkStatus();
}

absl::Status capture_turn(const Client& client, const v1::CreateSessionRequest& request, const Poses& poses,
                          const Turn::Annotate& annotate) {
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Axis> axes, read_axes(client, first_camera(request.plan())));
  GW_ASSIGN_OR_RETURN(const v1::Axis axis, find_axis(poses.axis, axes, "deg"));
  GW_RETURN_IF_ERROR(check_poses("--turn", poses, axis));
  Turn turn(client, request, axis, poses, annotate);
  v1::ListSessionsResponse captured;
  for (size_t pose = 0; pose < poses.positions.size(); ++pose) {
    std::cerr << fmt::format("pose {} of {}: {}\n", pose + 1, poses.positions.size(), turn.names()[pose]);
    GW_ASSIGN_OR_RETURN(*captured.add_sessions(), turn.capture(pose));
  }
  absl::Status outcome;
  for (v1::Session& session : *captured.mutable_sessions()) {
    if (!request.solve()) continue;
    GW_ASSIGN_OR_RETURN(session, turn.solved(session.name()));
    outcome.Update(outcome_of(session, Goal::kDone));
  }
  if (client.json) {
    print_json(captured);
  } else {
    std::cout << fmt::format("{} poses; glasswing sessions --tag {} lists them\n", captured.sessions_size(),
                             request.name());
  }
  return outcome;
}

}  // namespace glasswing
