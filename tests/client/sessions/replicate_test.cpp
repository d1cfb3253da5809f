// `glasswing replicate`, and copies in `show`, against a fake server.
#include <nlohmann/json.hpp>

#include "core/service/service.h"
#include "glasswing/v1/session_service.grpc.pb.h"
#include "tests/client/run_glasswing.h"

namespace glasswing {
namespace {

struct Sessions final : v1::SessionService::Service {
  v1::ReplicateSessionRequest asked;
  grpc::Status answer;
  v1::Session session;

  grpc::Status ReplicateSession(grpc::ServerContext*, const v1::ReplicateSessionRequest* request,
                                grpc::ServerWriter<v1::ReplicateSessionResponse>* writer) override {
    asked = *request;
    v1::ReplicateSessionResponse progress;
    progress.set_frame_count(311);
    progress.set_byte_count(22'900'000);
    for (const int done : {0, 200, 311}) {
      if (done == 311 && !answer.ok()) break;
      progress.set_frames_done(done);
      progress.set_bytes_done(progress.byte_count() * done / 311);
      writer->Write(progress);
    }
    return answer;
  }
  grpc::Status GetSession(grpc::ServerContext*, const v1::GetSessionRequest*,
                          v1::GetSessionResponse* response) override {
    *response->mutable_session() = session;
    return grpc::Status::OK;
  }
};

class ReplicateCommand : public ScratchTest {
 protected:
  Outcome run(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {"--server", host_->address()});
    return run_glasswing(arguments);
  }
  Sessions sessions_;
  std::unique_ptr<ServiceHost> host_ = ServiceHost::start({}, {&sessions_}).value();
};

TEST_F(ReplicateCommand, SaysWhatIsThere) {
  Outcome outcome = run({"replicate", "vase", "solver-2"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(outcome.out, "session vase is on node solver-2 too: 311 frames, 22.9 MB\n");
  EXPECT_EQ(sessions_.asked.name(), "vase");
  EXPECT_EQ(sessions_.asked.node(), "solver-2");
  outcome = run({"--json", "replicate", "vase", "solver-2"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(
      nlohmann::json::parse(outcome.out),
      (nlohmann::json{{"session", "vase"}, {"node", "solver-2"}, {"frames", 311}, {"bytes", 22'900'000}}));
}

TEST_F(ReplicateCommand, SaysWhatWentWrong) {
  sessions_.answer =
      grpc::Status(grpc::StatusCode::UNAVAILABLE, "node \"solver-2\" does not answer; start it again");
  expect_one_line_error(run({"replicate", "vase", "solver-2"}), "node \"solver-2\" does not answer");
  sessions_.answer = grpc::Status(grpc::StatusCode::NOT_FOUND, "there is no node \"nobody\"");
  expect_one_line_error(run({"replicate", "vase", "nobody"}), "there is no node \"nobody\"");
  expect_one_line_error(run({"replicate", "vase"}), "node is required");
}

TEST_F(ReplicateCommand, ShowListsCopies) {
  sessions_.session.set_name("vase");
  sessions_.session.set_archive_address("10.0.0.1:7442");
  for (const auto& [node, address] : {std::pair("solver-2", "10.0.0.2:7450"), std::pair("solver-3", "")}) {
    v1::ArchiveCopy& copy = *sessions_.session.add_copies();
    copy.set_node(node);
    copy.set_address(address);
  }
  const Outcome outcome = run({"show", "vase"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("copies    solver-2 at 10.0.0.2:7450\n"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("solver-3, incomplete; finish it with: glasswing replicate vase solver-3\n"),
            std::string::npos)
      << outcome.out;
}

}  // namespace
}  // namespace glasswing
