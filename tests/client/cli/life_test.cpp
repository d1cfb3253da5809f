// hold, delete, note, tag, retry, sessions and the dry run against a fake server.
#include <fmt/format.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "core/file/file.h"
#include "core/service/service.h"
#include "glasswing/v1/rig_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"
#include "tests/client/run_glasswing.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

std::string metadata(const grpc::ServerContext& context, const char* key) {
  const auto found = context.client_metadata().find(key);
  return found == context.client_metadata().end() ? ""
                                                  : std::string(found->second.data(), found->second.size());
}

struct Sessions final : v1::SessionService::Service {
  std::map<std::string, v1::Session> sessions;
  std::vector<std::string> deleted;
  std::string undeletable;
  bool allows_actions = true;
  v1::ListSessionsRequest listed;
  v1::AnnotateSessionRequest annotated;
  v1::ResumeSessionRequest resumed;
  v1::EstimateSessionResponse estimate;
  std::string client, hold;  // metadata of the last call

  grpc::Status GetSession(grpc::ServerContext* context, const v1::GetSessionRequest* request,
                          v1::GetSessionResponse* response) override {
    client = metadata(*context, "glasswing-client");
    hold = metadata(*context, "glasswing-hold");
    if (!sessions.contains(request->name()))
      return grpc::Status(grpc::StatusCode::NOT_FOUND, "there is no session " + request->name());
    *response->mutable_session() = sessions[request->name()];
    if (!allows_actions) return grpc::Status::OK;
    const v1::SessionState state = response->session().state();
    if (state == v1::SESSION_STATE_FAILED)
      response->mutable_session()->add_allowed_actions(v1::SESSION_ACTION_RETRY);
    if (state != v1::SESSION_STATE_SOLVING)
      response->mutable_session()->add_allowed_actions(v1::SESSION_ACTION_DELETE);
    return grpc::Status::OK;
  }
  grpc::Status ListSessions(grpc::ServerContext*, const v1::ListSessionsRequest* request,
                            v1::ListSessionsResponse* response) override {
    listed = *request;
    for (const auto& [name, session] : sessions) *response->add_sessions() = session;
    return grpc::Status::OK;
  }
  grpc::Status DeleteSession(grpc::ServerContext*, const v1::DeleteSessionRequest* request,
                             v1::DeleteSessionResponse* response) override {
    if (request->name() == undeletable)
      return grpc::Status(grpc::StatusCode::UNAVAILABLE, "camera node at 1.2.3.4:5 does not answer");
    deleted.push_back(request->name());
    response->set_freed_bytes(2'000'000);
    return grpc::Status::OK;
  }
  grpc::Status AnnotateSession(grpc::ServerContext*, const v1::AnnotateSessionRequest* request,
                               v1::AnnotateSessionResponse* response) override {
    annotated = *request;
    response->mutable_session()->set_note("as kept");
    response->mutable_session()->add_tags("lab3");
    return grpc::Status::OK;
  }
  grpc::Status ResumeSession(grpc::ServerContext*, const v1::ResumeSessionRequest* request,
                             v1::ResumeSessionResponse*) override {
    resumed = *request;
    return grpc::Status::OK;
  }
  grpc::Status EstimateSession(grpc::ServerContext*, const v1::EstimateSessionRequest*,
                               v1::EstimateSessionResponse* response) override {
    *response = estimate;
    return grpc::Status::OK;
  }
};

struct RigOfOne final : v1::RigService::Service {
  std::string reason;
  bool taken = false;
  std::atomic<bool> held = false;

  grpc::Status HoldRig(grpc::ServerContext* context, const v1::HoldRigRequest* request,
                       grpc::ServerWriter<v1::HoldRigResponse>* writer) override {
    if (taken) return grpc::Status(grpc::StatusCode::FAILED_PRECONDITION, "the rig is held by ben@lab4");
    reason = request->reason();
    held = true;
    v1::HoldRigResponse response;
    response.set_token("t0k3n");
    writer->Write(response);
    while (!context->IsCancelled()) std::this_thread::yield();
    held = false;
    return grpc::Status::OK;
  }
};

class LifeCommands : public ScratchTest {
 protected:
  LifeCommands() {
    for (const char* name : {"a", "b", "c"}) {
      sessions_.sessions[name].set_name(name);
      sessions_.sessions[name].set_state(v1::SESSION_STATE_DONE);
    }
  }
  Outcome run(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {"--server", host_->address()});
    return run_glasswing(arguments);
  }

  Sessions sessions_;
  RigOfOne rig_;
  std::unique_ptr<ServiceHost> host_ = ServiceHost::start({}, {&sessions_, &rig_}).value();
};

TEST_F(LifeCommands, EveryCallSaysWhoMakesIt) {
  ASSERT_EQ(run({"show", "a"}).status, 0);
  EXPECT_NE(sessions_.client.find('@'), std::string::npos) << sessions_.client;
  EXPECT_EQ(sessions_.hold, "");
  ::setenv("GLASSWING_HOLD", "t0k3n", 1);
  ASSERT_EQ(run({"show", "a"}).status, 0);
  EXPECT_EQ(sessions_.hold, "t0k3n");
  ::unsetenv("GLASSWING_HOLD");
}

TEST_F(LifeCommands, AHoldLastsAsLongAsItsCommandAndEndsAsIt) {
  const std::string file = (scratch_ / "token").string();
  const Outcome outcome = run({"hold", "--reason", "turntable series", "--", "sh", "-c",
                               "printf %s \"$GLASSWING_HOLD\" >\"$0\"; exit 3", file});
  ::unsetenv("GLASSWING_HOLD");
  EXPECT_EQ(outcome.status, 3) << outcome.err;
  EXPECT_EQ(rig_.reason, "turntable series");
  EXPECT_EQ(read_file(file).value_or(""), "t0k3n");
  while (rig_.held) std::this_thread::yield();

  EXPECT_EQ(run({"hold", "--reason", "x", "--", "sh", "-c", "kill -TERM $$"}).status, 128 + SIGTERM);
  expect_one_line_error(run({"hold", "--reason", "x", "--", (scratch_ / "nothing").string()}), "cannot run");
  ::unsetenv("GLASSWING_HOLD");
  rig_.taken = true;
  const std::string never = (scratch_ / "never").string();
  expect_one_line_error(run({"hold", "--reason", "x", "--", "touch", never}), "held by ben@lab4");
  EXPECT_FALSE(std::filesystem::exists(never));
}

TEST_F(LifeCommands, DeletingIsNeverHalfSilent) {
  // Standard input of a test is not a terminal.
  expect_one_line_error(run({"delete", "a"}), "--yes");
  expect_one_line_error(run({"delete", "a", "nobody", "--yes"}), "no session nobody");
  sessions_.sessions["b"].set_state(v1::SESSION_STATE_SOLVING);
  expect_one_line_error(run({"delete", "a", "b", "--yes"}), "session b is solving");
  EXPECT_TRUE(sessions_.deleted.empty());

  sessions_.sessions["b"].set_state(v1::SESSION_STATE_FAILED);
  sessions_.undeletable = "b";
  const Outcome outcome = run({"delete", "a", "b", "c", "--yes"});
  EXPECT_EQ(outcome.status, 1);
  EXPECT_EQ(outcome.out, "session a is deleted: 2.0 MB freed\n");
  EXPECT_NE(outcome.err.find("session b was not deleted, nor those after it: "), std::string::npos)
      << outcome.err;
  EXPECT_EQ(sessions_.deleted, std::vector<std::string>{"a"});
}

// The state alone allows nothing: the server says what it would accept.
TEST_F(LifeCommands, TheServerSaysWhatIsAllowed) {
  sessions_.allows_actions = false;
  expect_one_line_error(run({"delete", "a", "--yes"}), "nothing was deleted");
  EXPECT_TRUE(sessions_.deleted.empty());
  sessions_.sessions["a"].set_state(v1::SESSION_STATE_FAILED);
  expect_one_line_error(run({"retry", "a"}), "session a is failed");
  EXPECT_EQ(sessions_.resumed.name(), "");
}

TEST_F(LifeCommands, NotesAndTags) {
  EXPECT_EQ(run({"note", "a", "handle to the left"}).out, "as kept\n");
  EXPECT_EQ(sessions_.annotated.note(), "handle to the left");
  EXPECT_EQ(run({"note", "a"}).status, 0);
  EXPECT_FALSE(sessions_.annotated.has_note());
  EXPECT_EQ(run({"note", "a", ""}).status, 0);
  EXPECT_TRUE(sessions_.annotated.has_note());
  EXPECT_EQ(run({"tag", "a", "x", "y", "--remove", "z"}).out, "lab3\n");
  EXPECT_EQ(sessions_.annotated.add_tags_size(), 2);
  EXPECT_EQ(sessions_.annotated.remove_tags(0), "z");
}

TEST_F(LifeCommands, SessionsAreSearched) {
  const Outcome outcome = run({"sessions", "vase", "--tag", "x", "--tag", "y", "--state", "done", "--since",
                               "2026-11-01", "--before", "2026-12-01T00:00:00Z", "--tsv"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(sessions_.listed.text(), "vase");
  EXPECT_EQ(sessions_.listed.tags_size(), 2);
  EXPECT_EQ(sessions_.listed.states(0), v1::SESSION_STATE_DONE);
  EXPECT_EQ(sessions_.listed.created_from(), "2026-11-01T00:00:00Z");
  EXPECT_EQ(sessions_.listed.created_before(), "2026-12-01T00:00:00Z");
  EXPECT_TRUE(outcome.out.starts_with("NAME\tSTATE\t")) << outcome.out;
  EXPECT_NE(outcome.out.find("\na\tdone\t"), std::string::npos) << outcome.out;
  expect_one_line_error(run({"sessions", "--since", "yesterday"}), "--since is \"yesterday\"");
  EXPECT_NE(run({"sessions", "--state", "gone"}).status, 0);
}

TEST_F(LifeCommands, RetryNamesWhatItTriesAgain) {
  expect_one_line_error(run({"retry", "a"}), "session a is done; only a failed one");
  v1::Session& failed = sessions_.sessions["a"];
  failed.set_state(v1::SESSION_STATE_FAILED);
  failed.set_step_count(11);
  failed.set_proven_count(10);
  v1::UnprovenStep& step = *failed.add_unproven();
  step.set_step(7);
  step.set_what("back stripe at 45 deg, r 120.0 px, 4 ms");
  EXPECT_EQ(run({"retry", "a", "--retries", "30"}).out,
            "session a: showing the 1 of 11 steps that are not proven\n"
            "      7  back stripe at 45 deg, r 120.0 px, 4 ms\n");
  EXPECT_EQ(sessions_.resumed.retries(), 30);
  EXPECT_NE(run({"show", "a"}).out.find("unproven      7  back stripe at 45 deg"), std::string::npos);
  failed.set_job(1);
  failed.set_tile_count(96);
  failed.set_tiles_done(90);
  EXPECT_EQ(run({"retry", "a"}).out, "session a: solving the 6 of 96 tiles that are not done\n");
  EXPECT_FALSE(sessions_.resumed.has_retries());
  for (const int frame : {3, 4, 9}) failed.add_refused_frames(frame);
  EXPECT_EQ(run({"retry", "a"}).out, "session a: solving frames 3 to 4, 9 again\n");
}

TEST_F(LifeCommands, ADryRunTellsCostSpaceAndHolder) {
  const std::string plan = (scratch_ / "plan.txtpb").string();
  ASSERT_OK(write_file_durably(plan, "method: \"alpha\"\nsolids { colour: 1 colour: 1 colour: 1 }\n"));
  v1::EstimateSessionResponse& estimate = sessions_.estimate;
  estimate.set_step_count(12);
  estimate.set_bytes(5'000'000);
  estimate.set_free_bytes(7'000'000'000);
  estimate.mutable_holder()->set_client("ben@lab4");
  estimate.mutable_holder()->set_what("doctor");
  estimate.mutable_holder()->set_since("2026-11-22T01:02:03Z");
  estimate.add_warnings("not calibrated");
  const Outcome outcome = run({"capture", plan, "--dry-run"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  for (const char* line :
       {"steps     12", "data      5.0 MB", "space     7.0 GB free",
        "rig       held by ben@lab4 since 2026-11-22T01:02:03Z: doctor", "warning   not calibrated"})
    EXPECT_NE(outcome.out.find(line), std::string::npos) << outcome.out;
  const nlohmann::json json = nlohmann::json::parse(run({"capture", plan, "--dry-run", "--json"}).out);
  EXPECT_EQ(json["step_count"], 12);
  EXPECT_EQ(json["holder"]["what"], "doctor");
}

}  // namespace
}  // namespace glasswing
