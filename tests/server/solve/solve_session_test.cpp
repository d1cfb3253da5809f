#include "server/solve/solve_session.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class SolveSession : public testing::Test {
 protected:
  void SetUp() override {
    store_ = SessionStore::open(data_).value();
    v1::Session session;
    session.set_name("vase");
    session.set_state(v1::SESSION_STATE_SOLVING);
    session.set_job(7);
    ASSERT_OK(store_->edit().insert(session, ""));
  }

  absl::Status ask(const std::string& session, std::int64_t job) {
    v1::TileLease lease;
    lease.set_session(session);
    lease.set_job(job);
    SessionStore::Edit edit = store_->edit();
    return session_of(edit, lease).status();
  }

  const TemporaryDirectory data_;
  std::unique_ptr<SessionStore> store_;
};

// A tile is a matte's rows, and never a file that is packed for other programs.
TEST(TileRows, DeliveryFilesAreNoTiles) {
  MatteOutline tile;
  tile.width_px = 4;
  tile.height_px = 3;
  tile.metadata.set_height_px(3);
  v1::Session session;
  session.set_name("vase");
  session.set_pixel_count(12);
  EXPECT_OK(check_rows(tile, {.first = 0, .count = 3}, session));
  tile.delivery = true;
  EXPECT_TRUE(absl::IsInvalidArgument(check_rows(tile, {.first = 0, .count = 3}, session)));
}

TEST_F(SolveSession, IsThatOfTheLeasesJob) {
  EXPECT_OK(ask("vase", 7));
}

TEST_F(SolveSession, LeasesOfAnEarlierJobAreOver) {
  EXPECT_TRUE(absl::IsAborted(ask("vase", 6)));
  EXPECT_TRUE(absl::IsAborted(ask("vase", 0)));
  EXPECT_TRUE(absl::IsAborted(ask("bowl", 7)));
  EXPECT_TRUE(absl::IsInvalidArgument(ask("../vase", 7)));
  // A session that is not solved has job 0, which is no job.
  v1::Session session;
  session.set_name("cup");
  session.set_state(v1::SESSION_STATE_CAPTURED);
  ASSERT_OK(store_->edit().insert(session, ""));
  EXPECT_TRUE(absl::IsAborted(ask("cup", 0)));
}

}  // namespace
}  // namespace glasswing
