// `glasswing fsck --rig` against a fake server and two fake nodes.
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "core/service/service.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/node_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"
#include "tests/client/run_glasswing.h"

namespace glasswing {
namespace {

struct FakeNode : v1::ArchiveService::Service {
  std::map<std::string, int> frames;  // by session

  grpc::Status GetManifest(grpc::ServerContext*, const v1::GetManifestRequest* request,
                           v1::GetManifestResponse* response) override {
    const auto found = frames.find(request->session());
    if (found == frames.end()) return {grpc::StatusCode::NOT_FOUND, "this node holds no archive of it"};
    for (int i = 0; i < found->second; ++i) response->mutable_manifest()->add_frames();
    return grpc::Status::OK;
  }
  grpc::Status ListArchives(grpc::ServerContext*, const v1::ListArchivesRequest*,
                            grpc::ServerWriter<v1::ListArchivesResponse>* writer) override {
    for (const auto& [session, count] : frames) {
      v1::ListArchivesResponse one;
      one.add_sessions(session);
      writer->Write(one);
    }
    return grpc::Status::OK;
  }
};

struct FakeSessions : v1::SessionService::Service {
  std::vector<v1::Session> sessions;
  std::set<std::string> damaged;  // mattes
  std::set<int> damaged_frames;   // of videos

  grpc::Status ListSessions(grpc::ServerContext*, const v1::ListSessionsRequest*,
                            v1::ListSessionsResponse* response) override {
    for (const v1::Session& session : sessions) *response->add_sessions() = session;
    return grpc::Status::OK;
  }
  grpc::Status GetSession(grpc::ServerContext*, const v1::GetSessionRequest* request,
                          v1::GetSessionResponse*) override {
    return {grpc::StatusCode::NOT_FOUND, "there is no session " + request->name()};
  }
  grpc::Status FetchMatte(grpc::ServerContext*, const v1::FetchMatteRequest* request,
                          grpc::ServerWriter<v1::FetchMatteResponse>* writer) override {
    if (request->has_frame() ? damaged_frames.contains(request->frame()) : damaged.contains(request->name()))
      return {grpc::StatusCode::DATA_LOSS, "/data/mattes/x.exr is damaged"};
    v1::FetchMatteResponse response;
    response.set_chunk("matte");
    writer->Write(response);
    return grpc::Status::OK;
  }
};

struct FakeNodes : v1::NodeService::Service {
  std::vector<v1::Node> nodes;

  grpc::Status ListNodes(grpc::ServerContext*, const v1::ListNodesRequest*,
                         v1::ListNodesResponse* response) override {
    for (const v1::Node& node : nodes) *response->add_nodes() = node;
    return grpc::Status::OK;
  }
};

class CompareRig : public testing::Test {
 protected:
  // "still" has a replica on the solver, "film" is a video with frames 0 and 2.
  void SetUp() override {
    add_node(v1::NODE_KIND_CAMERA, "camera-1", camera_host_->address());
    add_node(v1::NODE_KIND_SOLVER, "solver-1", solver_host_->address());
    v1::Session still = session("still", 7);
    v1::ArchiveCopy& copy = *still.add_copies();
    copy.set_node("solver-1");
    copy.set_address(solver_host_->address());
    v1::Session film = session("film", 3);
    film.set_method("ramp");
    film.set_frame_count(3);
    for (const int frame : {0, 2}) film.add_solved_frames(frame);
    sessions_.sessions = {still, film};
    camera_.frames = {{"still", 7}, {"film", 3}};
    solver_.frames = {{"still", 7}};
  }
  v1::Session session(const std::string& name, int frames) const {
    v1::Session session;
    session.set_name(name);
    session.set_state(v1::SESSION_STATE_DONE);
    session.set_archive_address(camera_host_->address());
    session.set_proven_count(frames);
    session.set_matte_ready(true);
    session.add_allowed_actions(v1::SESSION_ACTION_FETCH);
    return session;
  }
  void add_node(v1::NodeKind kind, const std::string& name, const std::string& address) {
    v1::Node node;
    node.set_kind(kind);
    node.set_name(name);
    node.set_address(address);
    node.set_up(true);
    nodes_.nodes.push_back(node);
  }
  Outcome run() const { return run_glasswing({"fsck", "--rig", "--json", "--server", host_->address()}); }
  // Expects one finding of damage, or of what is none, in which all words are found.
  void expect_found(const std::vector<std::string>& words, bool is_damage = true) const {
    const Outcome outcome = run();
    EXPECT_EQ(outcome.status, is_damage ? 3 : 0) << outcome.out << outcome.err;
    const nlohmann::json report = nlohmann::json::parse(outcome.out);
    ASSERT_EQ(report["findings"].size(), 1u) << outcome.out;
    EXPECT_EQ(report["findings"][0]["damage"], is_damage);
    for (const std::string& word : words) EXPECT_NE(outcome.out.find(word), std::string::npos) << outcome.out;
  }

  FakeNode camera_, solver_;
  FakeSessions sessions_;
  FakeNodes nodes_;
  std::unique_ptr<ServiceHost> camera_host_ = ServiceHost::start({}, {&camera_}).value();
  std::unique_ptr<ServiceHost> solver_host_ = ServiceHost::start({}, {&solver_}).value();
  std::unique_ptr<ServiceHost> host_ = ServiceHost::start({}, {&sessions_, &nodes_}).value();
};

TEST_F(CompareRig, WhatAgreesIsGood) {
  const Outcome outcome = run();
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  const nlohmann::json report = nlohmann::json::parse(outcome.out);
  EXPECT_TRUE(report["findings"].empty()) << outcome.out;
  EXPECT_EQ(report["files"], 3 + 1 + 2);  // archives, the still's matte, the film's
}

TEST_F(CompareRig, ADeletedArchiveIsFoundWhereItWas) {
  camera_.frames.erase("film");
  expect_found({"film", "camera-1", "restore the archive from a backup"});
}

TEST_F(CompareRig, ADeletedReplicaIsFoundToo) {
  solver_.frames.erase("still");
  expect_found({"still", "solver-1", "glasswing replicate"});
}

TEST_F(CompareRig, MissingFramesAreCounted) {
  camera_.frames["film"] = 2;
  expect_found({"lists 2 frames; the catalogue counts 3"});
}

TEST_F(CompareRig, CapturesThatRunOrWereGivenUpMayHaveAnyFrames) {
  sessions_.sessions[1].clear_allowed_actions();
  for (const v1::SessionState state : {v1::SESSION_STATE_CAPTURING, v1::SESSION_STATE_CANCELLED}) {
    sessions_.sessions[1].set_state(state);
    camera_.frames["film"] = 0;
    EXPECT_EQ(run().status, 0);
  }
}

TEST_F(CompareRig, DamagedMattesAreFoundFrameByFrame) {
  sessions_.damaged = {"still"};
  expect_found({"matte of session", "still", "/data/mattes/x.exr"});
  sessions_.damaged.clear();
  sessions_.damaged_frames = {2};
  expect_found({"matte of frame 2", "film"});
}

TEST_F(CompareRig, AnArchiveOfNoSessionIsNoDamage) {
  solver_.frames["vase"] = 5;
  expect_found({"vase", "solver-1", "glasswing import"}, false);
}

TEST_F(CompareRig, ASilentNodeIsNotTakenForGood) {
  solver_host_.reset();
  const Outcome outcome = run();
  EXPECT_EQ(outcome.status, kFailure);
  EXPECT_NE(outcome.err.find("solver-1"), std::string::npos) << outcome.err;
  EXPECT_TRUE(nlohmann::json::parse(outcome.out)["findings"].empty()) << outcome.out;
}

TEST_F(CompareRig, ADirectoryOrTheRigButNotBoth) {
  expect_one_line_error(run_glasswing({"fsck"}), "--rig");
  expect_one_line_error(run_glasswing({"fsck", "/tmp", "--rig"}), "--rig");
}

}  // namespace
}  // namespace glasswing
