// Replicas of a session's archive on other nodes: made, listed, found again, removed. A server, two nodes
// that keep archives, and relays that count the bytes between them.
#include "server/archives/replicas.h"
#include "server/services/server.h"
#include "tests/core/archive/made_archive.h"
#include "tests/core/archive/tampering_relay.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class Replicate : public ArchiveTest {
 protected:
  void SetUp() override {
    server_ = open_server();
    camera_ = std::make_unique<ArchiveNode>(root_ / "camera");
    solver_ = std::make_unique<ArchiveNode>(root_ / "solver");
    register_camera(camera_->address());
    v1::BeginImportRequest import;
    import.set_name("s");
    *import.mutable_manifest() = MadeArchive::header();
    ASSERT_OK(server_->importer().begin(import, {}));
    EXPECT_TRUE(absl::IsFailedPrecondition(replicate("solver-2"))) << "it is being imported";
    MadeArchive::fill(camera_->store);
    ASSERT_OK(server_->importer().finish("s"));
    register_node(v1::NODE_KIND_SOLVER, "solver-2", solver_->address());
  }
  void TearDown() override {
    server_ = nullptr;
    camera_ = nullptr;
    solver_ = nullptr;
    ArchiveTest::TearDown();
  }
  std::unique_ptr<Server> open_server() const {
    fs::create_directories(root_ / "server");
    return Server::open({.data = root_ / "server"}).value();
  }
  void register_node(v1::NodeKind kind, const std::string& name, const std::string& address) {
    v1::RegisterRequest node;
    node.set_kind(kind);
    node.set_name(name);
    node.set_address(address);
    ASSERT_OK(server_->rig().add(node, std::nullopt));
  }
  void register_camera(const std::string& address) {
    register_node(v1::NODE_KIND_CAMERA, "camera-1", address);
  }
  absl::Status replicate(const std::string& node, std::vector<v1::ReplicateSessionResponse>* told = nullptr) {
    v1::ReplicateSessionRequest request;
    request.set_name("s");
    request.set_node(node);
    return server_->replicator().replicate(
        request,
        [&](const v1::ReplicateSessionResponse& progress) {
          if (told != nullptr) told->push_back(progress);
          return true;
        },
        [] { return true; });
  }
  v1::Session session() { return server_->sessions().find("s").value(); }
  void expect_whole_copy() const {
    for (int i = 0; i < MadeArchive::kFrames; ++i)
      EXPECT_EQ(bytes_of(solver_->archive() / MadeArchive::file(i)),
                bytes_of(camera_->archive() / MadeArchive::file(i)));
  }

  std::unique_ptr<Server> server_;
  std::unique_ptr<ArchiveNode> camera_, solver_;
};

TEST_F(Replicate, TheCopyIsKnownAndFoundWhereTheNodeIsNow) {
  std::vector<v1::ReplicateSessionResponse> told;
  const absl::Status status = replicate("solver-2", &told);
  ASSERT_OK(status);
  expect_whole_copy();
  EXPECT_EQ(told.back().frames_done(), MadeArchive::kFrames);
  EXPECT_EQ(told.back().bytes_done(), session().archive_bytes());
  ASSERT_EQ(session().copies_size(), 1);
  EXPECT_EQ(session().copies(0).node(), "solver-2");
  EXPECT_EQ(replica_addresses(session(), server_->rig()), std::vector<std::string>{solver_->address()});
  ASSERT_OK(replicate("solver-2")) << "asking for what is so is no error";
  EXPECT_EQ(session().copies_size(), 1);

  // A change of the session keeps its replicas.
  v1::AnnotateSessionRequest note;
  note.set_name("s");
  note.set_note("a copy");
  ASSERT_OK(server_->sessions().annotate(note));
  const std::string old = solver_->address();
  server_ = nullptr;
  server_ = open_server();
  EXPECT_EQ(replica_addresses(session(), server_->rig()), std::vector<std::string>{old})
      << "the last one known";
  register_node(v1::NODE_KIND_SOLVER, "solver-2", "127.0.0.1:1");
  EXPECT_EQ(replica_addresses(session(), server_->rig()), std::vector<std::string>{"127.0.0.1:1"});
}

TEST_F(Replicate, PixelsGoFromNodeToNodeAlone) {
  const auto pass_on = [](std::string&, size_t) { return true; };
  TamperingRelay to_solver(solver_->address(), pass_on);
  server_ = nullptr;
  server_ = open_server();
  register_node(v1::NODE_KIND_SOLVER, "solver-2", to_solver.address());
  ASSERT_OK(replicate("solver-2"));
  expect_whole_copy();
  EXPECT_GT(to_solver.sent() + to_solver.received(), 0u);
  EXPECT_LT(to_solver.sent() + to_solver.received(), MadeArchive::kRowBytes * MadeArchive::kHeight / 10)
      << "less than a frame's";
}

TEST_F(Replicate, APartOfACopyIsNotReadFromAndIsFinishedOrRemoved) {
  const fs::path bad = camera_->archive() / MadeArchive::file(3);
  const std::string good = bytes_of(bad);
  write_over(bad, 1000, static_cast<char>(good[1000] ^ 1));
  const absl::Status status = replicate("solver-2");
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_NE(status.message().find("frames/000003.tif"), std::string::npos) << status;
  ASSERT_EQ(session().copies_size(), 1);
  EXPECT_TRUE(replica_addresses(session(), server_->rig()).empty());
  std::ofstream(bad, std::ios::binary) << good;
  std::vector<v1::ReplicateSessionResponse> told;
  ASSERT_OK(replicate("solver-2", &told));
  EXPECT_EQ(told.front().frames_done(), 3);
  EXPECT_EQ(replica_addresses(session(), server_->rig()).size(), 1u);
  expect_whole_copy();
}

TEST_F(Replicate, NobodyWaitingEndsItAndItIsTakenUp) {
  v1::ReplicateSessionRequest request;
  request.set_name("s");
  request.set_node("solver-2");
  // The node may or may not have finished before; the next call does.
  (void)server_->replicator().replicate(
      request, [](const auto&) { return false; }, [] { return false; });
  EXPECT_EQ(session().copies_size(), 1);
  ASSERT_OK(replicate("solver-2"));
  expect_whole_copy();
}

TEST_F(Replicate, OnlyNodesThatKeepArchivesTakeOne) {
  EXPECT_TRUE(absl::IsNotFound(replicate("nobody")));
  register_node(v1::NODE_KIND_DISPLAY, "display-1", "127.0.0.1:2");
  EXPECT_TRUE(absl::IsFailedPrecondition(replicate("display-1")));
  register_node(v1::NODE_KIND_SOLVER, "solver-3", "");
  EXPECT_TRUE(absl::IsFailedPrecondition(replicate("solver-3")));
  EXPECT_TRUE(absl::IsFailedPrecondition(replicate("camera-1"))) << "it has the frames";
  EXPECT_EQ(session().copies_size(), 0);
  const auto without = ServiceHost::start({}, {}).value();
  register_node(v1::NODE_KIND_SOLVER, "solver-4", without->address());
  const absl::Status status = replicate("solver-4");
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_NE(status.message().find("--archives"), std::string::npos) << status;
  EXPECT_EQ(session().copies_size(), 0) << "nothing was begun there";
}

TEST_F(Replicate, DeletionRemovesCopiesOrNothing) {
  ASSERT_OK(replicate("solver-2"));
  const std::int64_t frames = session().archive_bytes();
  server_ = nullptr;
  server_ = open_server();  // no node has registered with this one yet
  register_camera(camera_->address());
  const absl::StatusOr<std::int64_t> refused = server_->deleter().remove("s");
  EXPECT_TRUE(absl::IsUnavailable(refused.status())) << refused.status();
  EXPECT_NE(refused.status().message().find("\"solver-2\""), std::string::npos) << refused.status();
  EXPECT_NE(refused.status().message().find("nothing was removed"), std::string::npos) << refused.status();
  expect_whole_copy();
  EXPECT_EQ(session().state(), v1::SESSION_STATE_CAPTURED);

  register_node(v1::NODE_KIND_SOLVER, "solver-2", solver_->address());
  const std::string camera_address = camera_->address();
  camera_ = nullptr;
  EXPECT_TRUE(absl::IsUnavailable(server_->deleter().remove("s").status()));
  EXPECT_TRUE(fs::exists(solver_->archive())) << "nothing is removed while the camera is away";
  camera_ = std::make_unique<ArchiveNode>(root_ / "camera", camera_address);
  const absl::StatusOr<std::int64_t> freed = server_->deleter().remove("s");
  ASSERT_OK(freed);
  EXPECT_EQ(*freed, 2 * frames);
  EXPECT_FALSE(fs::exists(solver_->archive()));
  EXPECT_FALSE(fs::exists(camera_->archive()));
  EXPECT_TRUE(absl::IsNotFound(server_->sessions().find("s").status()));
}

}  // namespace
}  // namespace glasswing
