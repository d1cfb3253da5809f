// The trash and the rules over time: a server, and a node that keeps archives.
#include "server/archives/storage_keeper.h"

#include <gmock/gmock.h>

#include <fstream>

#include "server/services/server.h"
#include "server/sessions/session_state.h"
#include "tests/core/archive/made_archive.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class StorageKeeperTest : public ArchiveTest {
 protected:
  void SetUp() override {
    fs::create_directories(root_ / "server");
    server_ = Server::open(
                  {.data = root_ / "server", .storage = {.rules = {.frames_days = 1.0, .exempt_tags = {}}}})
                  .value();
    camera_ = std::make_unique<ArchiveNode>(root_ / "camera");
    v1::RegisterRequest node;
    node.set_kind(v1::NODE_KIND_CAMERA);
    node.set_name("camera-1");
    node.set_address(camera_->address());
    ASSERT_OK(server_->rig().add(node, std::nullopt));
    v1::BeginImportRequest import;
    import.set_name("s");
    *import.mutable_manifest() = MadeArchive::header();
    ASSERT_OK(server_->importer().begin(import, {}));
    MadeArchive::fill(camera_->store);
    ASSERT_OK(server_->importer().finish("s"));
  }
  void TearDown() override {
    server_ = nullptr;
    camera_ = nullptr;
    ArchiveTest::TearDown();
  }
  StorageKeeper& storage() { return server_->storage(); }
  absl::StatusOr<v1::Session> found() { return server_->sessions().find("s"); }
  bool has_frames() const { return fs::exists(root_ / "camera/s/frames"); }
  // As if it were solved now.
  void solve() {
    std::ofstream(root_ / "server/mattes/s.exr") << "a matte";
    v1::Session session = found().value();
    session.set_state(v1::SESSION_STATE_DONE);
    session.set_matte_ready(true);
    ASSERT_OK(server_->sessions().edit().change(session));
  }

  std::unique_ptr<Server> server_;
  std::unique_ptr<ArchiveNode> camera_;
};

TEST_F(StorageKeeperTest, EmptiesTheTrashAfterADay) {
  std::string ends;
  ASSERT_OK(storage().remove("s", true, ends));
  EXPECT_TRUE(absl::IsNotFound(found().status()));
  const absl::Time now = absl::Now();
  storage().empty_trash(now + absl::Hours(23));
  EXPECT_TRUE(has_frames());
  ASSERT_OK(storage().undelete("s"));
  EXPECT_OK(found());
  EXPECT_TRUE(found()->kept());
  ASSERT_OK(storage().remove("s", true, ends));
  ASSERT_EQ(storage().usage()->size(), 1u);
  EXPECT_EQ(storage().usage()->at(0).ends(), ends);
  storage().empty_trash(now + absl::Hours(25));
  EXPECT_FALSE(has_frames());
  EXPECT_TRUE(storage().usage()->empty());
  EXPECT_TRUE(absl::IsNotFound(storage().undelete("s")));
}

TEST_F(StorageKeeperTest, KeepsWhatANodeThatIsAwayHolds) {
  std::string ends;
  ASSERT_OK(storage().remove("s", true, ends));
  camera_ = nullptr;
  storage().empty_trash(absl::Now() + absl::Hours(25));
  ASSERT_OK(storage().undelete("s"));
  EXPECT_EQ(found()->state(), v1::SESSION_STATE_CAPTURED);
  EXPECT_TRUE(has_frames());
}

TEST_F(StorageKeeperTest, RemovesFramesADayAfterTheirTime) {
  const absl::Time now = absl::Now();
  EXPECT_TRUE(storage().apply_rules(false, now + absl::Hours(48))->empty());  // it is not solved
  solve();
  EXPECT_TRUE(storage().apply_rules(true, now + absl::Hours(23))->empty());
  EXPECT_EQ(storage().apply_rules(true, now + absl::Hours(25))->size(), 1u);
  EXPECT_EQ(found()->frames_deleted(), "");  // a dry run
  ASSERT_EQ(storage().apply_rules(false, now + absl::Hours(25))->size(), 1u);
  EXPECT_NE(found()->frames_deleted(), "");
  storage().empty_trash(now + absl::Hours(23));
  EXPECT_TRUE(has_frames());
  storage().empty_trash(now + absl::Hours(25));
  EXPECT_FALSE(has_frames());
  const v1::Session session = found().value();
  EXPECT_NE(session.frames_gone(), "");
  EXPECT_EQ(session.archive_bytes(), 0);
  EXPECT_TRUE(allows(session, v1::SESSION_ACTION_FETCH));
  EXPECT_FALSE(allows(session, v1::SESSION_ACTION_REPLICATE));
  const absl::Status solved = check_allows(session, v1::SESSION_ACTION_SOLVE);
  EXPECT_THAT(std::string(solved.message()), HasSubstr("has no frames"));
}

TEST_F(StorageKeeperTest, FramesThatAPersonKeepsStay) {
  const absl::Time now = absl::Now();
  solve();
  ASSERT_EQ(storage().apply_rules(false, now + absl::Hours(25))->size(), 1u);
  ASSERT_OK(storage().undelete("s"));
  storage().empty_trash(now + absl::Hours(1000));
  EXPECT_TRUE(has_frames());
  EXPECT_TRUE(storage().apply_rules(false, now + absl::Hours(1000))->empty());
}

}  // namespace
}  // namespace glasswing
