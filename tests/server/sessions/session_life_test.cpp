// A session's life on a simulated rig: estimated, captured, solved again, paused, cancelled, retried,
// deleted.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <semaphore>
#include <set>

#include "core/base/time.h"
#include "core/file/fault_point.h"
#include "core/file/file.h"
#include "core/image/image_file.h"
#include "server/sessions/session_state.h"
#include "tests/faults/capture/rig.h"
#include "tests/server/dispatch/idle_solver.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
constexpr int kWidth = FaultyRig::kWidth_px, kHeight = FaultyRig::kHeight_px;

v1::Plan small_plan() {
  v1::Plan plan;
  plan.set_method("alpha");
  for (const double value : {0.2, 0.8}) {
    v1::Solid& solid = *plan.add_solids();
    for (int c = 0; c < 3; ++c) solid.add_colour(value);
  }
  plan.add_exposure_ms(FaultyRig::kExposure_ms);
  plan.set_hold_refreshes(4);
  return plan;
}

class SessionLife : public testing::Test {
 protected:
  void start(const RigFaults& faults = {.name = "none"}) {
    rig_ = std::make_unique<FaultyRig>(faults, 1, 16, data_);
    solver_ = std::make_unique<IdleSolver>(rig_->server());
  }
  void TearDown() override {
    solver_ = nullptr;
    rig_ = nullptr;
  }
  Server& server() { return rig_->server(); }

  // Waits until the session rests, or is solved.
  v1::Session capture(const v1::Plan& plan, bool solve = false) {
    v1::CreateSessionRequest create;
    create.set_name("s");
    *create.mutable_plan() = plan;
    create.set_solve(solve);
    const absl::StatusOr<v1::Session> created =
        server().captures().create(create, {.client = "anna@lab3", .hold = ""});
    EXPECT_OK(created);
    return rested();
  }
  v1::Session wait_until(const std::function<bool(const v1::Session&)>& is_so) {
    const nanoseconds deadline = monotonic_now() + std::chrono::seconds(20);
    while (true) {
      const std::int64_t seen = server().sessions().wait_change(0, std::chrono::milliseconds(0));
      const v1::Session session = server().sessions().find("s").value();
      if (is_so(session)) return session;
      if (monotonic_now() > deadline) {
        ADD_FAILURE() << state_of(session) << " " << session.reason();
        return session;
      }
      server().sessions().wait_change(seen, std::chrono::milliseconds(100));
    }
  }
  v1::Session rested() {
    while (true) {
      const std::int64_t seen = server().sessions().wait_change(0, std::chrono::milliseconds(0));
      const v1::Session session = server().sessions().find("s").value();
      if (session.state() != v1::SESSION_STATE_CAPTURING) return session;
      server().sessions().wait_change(seen, std::chrono::seconds(1));
    }
  }
  v1::Session solve(const std::string& method, std::map<std::string, std::string> options = {}) {
    v1::SolveSessionRequest request;
    request.set_name("s");
    request.set_method(method);
    request.mutable_options()->insert(options.begin(), options.end());
    const absl::StatusOr<v1::Session> session = server().solves().solve(request);
    EXPECT_OK(session);
    return session.ok() ? *session : v1::Session();
  }
  // As solve(), then does the survey. Returns the number of tiles.
  int solve_in_tiles(const std::string& method, std::map<std::string, std::string> options = {}) {
    solve(method, std::move(options));
    v1::ClaimTileResponse survey;
    EXPECT_OK(solver_->try_to_claim(IdleSolver::request(), survey));
    EXPECT_GT(survey.survey_rows_size(), 0);
    EXPECT_OK(solver_->complete_survey(survey));
    return server().sessions().find("s")->tile_count();
  }
  // Waits until all tiles are done, or the solve has failed.
  v1::Session settled() {
    while (true) {
      const std::int64_t seen = server().sessions().wait_change(0, std::chrono::milliseconds(0));
      const v1::Session session = server().sessions().find("s").value();
      if (session.state() != v1::SESSION_STATE_SOLVING) return session;
      server().sessions().wait_change(seen, std::chrono::seconds(1));
    }
  }
  absl::StatusOr<v1::Session> resume(std::optional<int> retries = std::nullopt) {
    v1::ResumeSessionRequest request;
    request.set_name("s");
    if (retries) request.set_retries(*retries);
    return server().control().resume(request, {});
  }
  // What a server that starts with the captured session, which shall be solved, makes of it.
  v1::Session followed_after_restart() {
    v1::Session session = server().sessions().find("s").value();
    session.set_solve_follows(true);
    EXPECT_OK(server().sessions().edit().change(session));
    const auto again = Server::open({.data = data_ / "server"}).value();
    const nanoseconds deadline = monotonic_now() + std::chrono::seconds(20);
    std::int64_t seen = 0;
    while ((session = again->sessions().find("s").value()).solve_follows() && monotonic_now() < deadline)
      seen = again->sessions().wait_change(seen, std::chrono::milliseconds(100));
    EXPECT_FALSE(session.solve_follows());
    return session;
  }
  // Completes at most so many tiles.
  int complete(float mark, int most = 1 << 20) {
    int count = 0;
    for (; count < most; ++count) {
      const v1::ClaimTileResponse tile = solver_->claim();
      if (!tile.has_lease()) break;
      EXPECT_OK(solver_->complete_rows(tile, kWidth, kHeight, mark));
    }
    return count;
  }
  // The mark of the matte that can be fetched, in its first and its last row.
  std::pair<float, float> marks() {
    const absl::StatusOr<Matte> matte = read_matte(server().solves().matte("s", std::nullopt).value());
    EXPECT_OK(matte);
    return {matte->foreground(0, 0)[0], matte->foreground(0, kHeight - 1)[0]};
  }

  const TemporaryDirectory data_;
  std::unique_ptr<FaultyRig> rig_;
  std::unique_ptr<IdleSolver> solver_;
};

using Marks = std::pair<float, float>;

// All bytes of a matte that is sent.
absl::StatusOr<std::string> sent(const absl::StatusOr<StoredMatte>& matte) {
  if (!matte.ok()) return matte.status();
  std::string bytes;
  const absl::Status status = matte->send([&](std::string_view chunk) { return !(bytes += chunk).empty(); });
  return status.ok() ? absl::StatusOr<std::string>(bytes) : status;
}

TEST_F(SessionLife, TheDryRunSaysWhatTheCaptureCosts) {
  start();
  v1::EstimateSessionRequest request;
  request.set_name("s");
  *request.mutable_plan() = small_plan();
  const absl::StatusOr<v1::EstimateSessionResponse> estimate = server().captures().estimate(request);
  ASSERT_OK(estimate);
  EXPECT_FALSE(estimate->has_holder());
  EXPECT_EQ(estimate->warnings_size(), 1) << "sync was not measured";
  EXPECT_GE(estimate->free_bytes(), estimate->bytes());
  EXPECT_DOUBLE_EQ(estimate->seconds(), estimate->step_count() * 4 / FaultyRig::kRefresh_hz);
  EXPECT_FALSE(fs::exists(rig_->archive("s")));

  const v1::Session session = capture(small_plan());
  ASSERT_EQ(session.state(), v1::SESSION_STATE_CAPTURED) << session.reason();
  EXPECT_EQ(session.step_count(), estimate->step_count());
  // The estimate counts plain frames; those of this test compress well.
  EXPECT_GT(session.archive_bytes(), 0);
  EXPECT_LT(session.archive_bytes(), estimate->bytes());
  EXPECT_EQ(session.started_by(), "anna@lab3");
  EXPECT_TRUE(absl::IsAlreadyExists(server().captures().estimate(request).status()));

  // An estimate reports the rig's holder; only a real capture is refused.
  const auto drive = server().rig_lock().drive({.client = "ben@lab4", .hold = ""}, "doctor");
  request.clear_name();
  EXPECT_EQ(server().captures().estimate(request)->holder().client(), "ben@lab4");
  v1::CreateSessionRequest create;
  *create.mutable_plan() = small_plan();
  EXPECT_TRUE(absl::IsFailedPrecondition(server().captures().create(create, {}).status()));
  EXPECT_EQ(server().list({})->size(), 1u);
}

TEST_F(SessionLife, TheFinishedMatteStaysUntilAnotherIs) {
  start();
  ASSERT_EQ(capture(small_plan()).state(), v1::SESSION_STATE_CAPTURED);
  EXPECT_TRUE(absl::IsFailedPrecondition(server().solves().matte("s", std::nullopt).status()));
  const int tiles = solve_in_tiles("alpha", {{"backings", "1"}});
  EXPECT_FALSE(server().sessions().find("s")->matte_ready());
  EXPECT_EQ(complete(1.0f), tiles);
  const v1::Session first = settled();
  EXPECT_EQ(first.state(), v1::SESSION_STATE_DONE) << first.reason();
  EXPECT_TRUE(first.matte_ready());
  EXPECT_EQ(marks(), Marks(1.0f, 1.0f));
  EXPECT_THAT(first.matte_warnings(), testing::ElementsAre("mark 1"));

  // An unknown option, or a value that it does not take, is refused before anything changes.
  const auto refused = [&](const std::string& option, const std::string& value) {
    v1::SolveSessionRequest request;
    request.set_name("s");
    request.set_method("gaussian");
    (*request.mutable_options())[option] = value;
    const absl::Status status = server().solves().solve(request).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
    EXPECT_EQ(server().sessions().find("s")->SerializeAsString(), first.SerializeAsString());
    return std::string(status.message());
  };
  EXPECT_NE(refused("backings", "1").find("it has: modes, "), std::string::npos);
  EXPECT_EQ(refused("modes", "99"), "modes is \"99\"; it must be a whole number, 1 to 8");

  // Once cancelled, the session is as before.
  solve("gaussian");
  complete(2.0f, 3);
  EXPECT_EQ(marks(), Marks(1.0f, 1.0f));
  ASSERT_OK(server().control().cancel("s", {}));
  EXPECT_EQ(server().sessions().find("s")->SerializeAsString(), first.SerializeAsString());
  EXPECT_EQ(complete(2.0f), 0);
  EXPECT_EQ(marks(), Marks(1.0f, 1.0f));

  // When the solve fails, the session has the old matte; a retry does not repeat tiles that are done.
  solve("hierarchical");
  EXPECT_EQ(complete(3.0f, 5), 5);
  ASSERT_OK(solver_->fail(solver_->claim(), "row 5: torn"));
  v1::Session session = server().sessions().find("s").value();
  EXPECT_EQ(session.state(), v1::SESSION_STATE_FAILED);
  EXPECT_TRUE(session.matte_ready());
  EXPECT_EQ(marks(), Marks(1.0f, 1.0f));
  EXPECT_EQ(complete(4.0f), 0);
  {
    const auto again = Server::open({.data = data_ / "server"}).value();
    EXPECT_OK(again->solves().matte("s", std::nullopt));
  }
  ASSERT_EQ(resume()->state(), v1::SESSION_STATE_SOLVING);
  EXPECT_EQ(complete(4.0f), tiles - 5);
  session = settled();
  EXPECT_EQ(session.state(), v1::SESSION_STATE_DONE) << session.reason();
  EXPECT_EQ(session.method(), "hierarchical");
  EXPECT_EQ(marks(), Marks(3.0f, 4.0f));
  EXPECT_THAT(session.matte_warnings(), testing::ElementsAre("mark 3"));

  // A solve that names no method is by the plan's, whatever the last one used.
  session = solve("");
  EXPECT_EQ(session.method(), "alpha");
  EXPECT_TRUE(session.options().empty());
}

// Free space as the camera node reports it: none once so many frames of a session are there.
struct Disk {
  fs::path frames;
  std::atomic<int> max_frames = std::numeric_limits<int>::max();
  SpaceOf space() {
    return [this](const fs::path&) -> absl::StatusOr<fs::space_info> {
      std::error_code none;
      const auto count = std::distance(fs::directory_iterator(frames, none), fs::directory_iterator());
      const std::uintmax_t now = count >= max_frames ? 0 : 1 << 30;
      return fs::space_info{.capacity = 1 << 30, .free = now, .available = now};
    };
  }
};

bool waits_for_room(const v1::Session& session) {
  return session.reason().starts_with("waiting for room") &&
         session.reason().find("frames remain") != std::string::npos;
}

TEST_F(SessionLife, ACaptureWaitsForRoomAndGoesOnByItself) {
  Disk disk{.frames = data_ / "archives/s/frames"};
  start({.name = "full disk", .space = disk.space()});
  disk.max_frames = 3;
  v1::CreateSessionRequest create;
  create.set_name("s");
  *create.mutable_plan() = small_plan();
  ASSERT_OK(server().captures().create(create, {}));
  const v1::Session waiting = wait_until(waits_for_room);
  EXPECT_EQ(waiting.state(), v1::SESSION_STATE_CAPTURING);
  EXPECT_GT(waiting.proven_count(), 0);
  EXPECT_LT(waiting.proven_count(), waiting.step_count());
  EXPECT_NE(waiting.reason().find("camera-1"), std::string::npos) << waiting.reason();
  EXPECT_NE(waiting.reason().find("MB of disk space are missing"), std::string::npos) << waiting.reason();
  const std::string first = read_file(rig_->archive("s") / "frames.jsonl").value();

  disk.max_frames = std::numeric_limits<int>::max();
  const v1::Session done =
      wait_until([](const v1::Session& session) { return session.state() == v1::SESSION_STATE_CAPTURED; });
  EXPECT_EQ(done.proven_count(), done.step_count());
  EXPECT_EQ(done.reason(), "");
  EXPECT_TRUE(read_file(rig_->archive("s") / "frames.jsonl")->starts_with(first)) << "what was kept stays";
}

TEST_F(SessionLife, ACaptureThatWaitsForRoomCanBePausedAndCancelled) {
  Disk disk{.frames = data_ / "archives/s/frames"};
  start({.name = "full disk", .space = disk.space()});
  disk.max_frames = 1;
  v1::CreateSessionRequest create;
  create.set_name("s");
  *create.mutable_plan() = small_plan();
  ASSERT_OK(server().captures().create(create, {}));
  wait_until(waits_for_room);
  EXPECT_EQ(server().control().pause("s", {})->state(), v1::SESSION_STATE_PAUSED);
  EXPECT_EQ(server().control().cancel("s", {})->state(), v1::SESSION_STATE_CANCELLED);
}

TEST_F(SessionLife, APausedSolveKeepsItsTilesAlsoPastTheServersEnd) {
  start();
  ASSERT_EQ(capture(small_plan()).state(), v1::SESSION_STATE_CAPTURED);
  const int tiles = solve_in_tiles("alpha");
  EXPECT_EQ(complete(1.0f, 2), 2);
  const v1::ClaimTileResponse under_way = solver_->claim();
  const absl::StatusOr<v1::Session> paused = server().control().pause("s", {});
  ASSERT_OK(paused);
  EXPECT_EQ(paused->state(), v1::SESSION_STATE_PAUSED);
  EXPECT_OK(server().control().pause("s", {})) << "it is so already";
  EXPECT_FALSE(solver_->claim().has_lease());
  EXPECT_OK(solver_->complete_rows(under_way, kWidth, kHeight, 1.0f));
  EXPECT_EQ(server().sessions().find("s")->tiles_done(), 3);
  EXPECT_EQ(server().sessions().find("s")->state(), v1::SESSION_STATE_PAUSED);
  {
    const auto again = Server::open({.data = data_ / "server"}).value();
    EXPECT_EQ(again->sessions().find("s")->state(), v1::SESSION_STATE_PAUSED);
    EXPECT_FALSE(again->tiles().claim(IdleSolver::request())->has_lease());
  }
  ASSERT_OK(resume());
  EXPECT_EQ(complete(2.0f), tiles - 3);
  EXPECT_EQ(settled().state(), v1::SESSION_STATE_DONE);
  EXPECT_EQ(marks(), Marks(1.0f, 2.0f));
}

TEST_F(SessionLife, WhatIsSolvedSoFarCanBeFetched) {
  start();
  ASSERT_EQ(capture(small_plan()).state(), v1::SESSION_STATE_CAPTURED);
  EXPECT_TRUE(absl::IsFailedPrecondition(sent(server().solves().open_partial_matte("s", {})).status()));
  solve_in_tiles("alpha");
  EXPECT_TRUE(absl::IsFailedPrecondition(sent(server().solves().open_partial_matte("s", {})).status()));
  const v1::ClaimTileResponse first = solver_->claim(), left_out = solver_->claim(), third = solver_->claim();
  for (const v1::ClaimTileResponse& tile : {first, third})
    ASSERT_OK(solver_->complete_rows(tile, kWidth, kHeight, 1.0f));
  const absl::StatusOr<std::string> bytes = sent(server().solves().open_partial_matte("s", {}));
  ASSERT_OK(bytes);
  const Matte partial = decode_matte(*bytes).value();
  ASSERT_EQ(partial.height_px(), kHeight);
  const auto within = [](int y, const v1::ClaimTileResponse& tile) {
    return y >= tile.first_row() && y < tile.first_row() + tile.row_count();
  };
  for (int y = 0; y < kHeight; ++y) {
    const bool solved = within(y, first) || within(y, third);
    EXPECT_EQ(partial.flags(0, y), solved ? kFlagNone : kFlagNoData) << y;
    EXPECT_EQ(partial.foreground(0, y)[0], solved ? 1.0f : 0.0f) << y;
  }
  ASSERT_OK(solver_->complete_rows(left_out, kWidth, kHeight, 1.0f));
  complete(1.0f);
  ASSERT_EQ(settled().state(), v1::SESSION_STATE_DONE);
  EXPECT_EQ(sent(server().solves().open_partial_matte("s", {})).value(),
            read_file(server().solves().matte("s", std::nullopt).value()).value());
}

TEST_F(SessionLife, ARegionOfAMatteIsThatOfTheWhole) {
  start();
  ASSERT_EQ(capture(small_plan()).state(), v1::SESSION_STATE_CAPTURED);
  solve_in_tiles("alpha");
  ASSERT_EQ(complete(1.0f, 1), 1);
  const MatteRegion region{.x_px = 3, .y_px = 1, .width_px = kWidth - 4, .height_px = kHeight - 2};
  const auto expect_region_of_whole = [&](const absl::StatusOr<std::string>& whole_file,
                                          const absl::StatusOr<std::string>& part_file) {
    ASSERT_TRUE(whole_file.ok() && part_file.ok()) << whole_file.status() << part_file.status();
    const Matte whole = decode_matte(*whole_file).value(), part = decode_matte(*part_file).value();
    EXPECT_EQ((MatteRegion{part.x0_px(), part.y0_px(), part.width_px(), part.height_px()}), region);
    EXPECT_EQ(part.metadata.SerializeAsString(), whole.metadata.SerializeAsString());
    for (int y = 0; y < part.height_px(); ++y) {
      for (int x = 0; x < part.width_px(); ++x) {
        EXPECT_EQ(part.foreground(x, y), whole.foreground(x + region.x_px, y + region.y_px));
        EXPECT_EQ(part.flags(x, y), whole.flags(x + region.x_px, y + region.y_px));
      }
    }
  };
  SolveRunner& solves = server().solves();
  expect_region_of_whole(sent(solves.open_partial_matte("s", {})),
                         sent(solves.open_partial_matte("s", {region, 0})));
  complete(1.0f);
  ASSERT_EQ(settled().state(), v1::SESSION_STATE_DONE);
  expect_region_of_whole(sent(solves.open_matte("s", std::nullopt, {})),
                         sent(solves.open_matte("s", std::nullopt, {region, 0})));
  for (const MatteRegion& refused : {MatteRegion{0, 0, kWidth + 1, 1}, {0, 0, 0, 1}, {-1, 0, 2, 2}}) {
    EXPECT_TRUE(absl::IsInvalidArgument(solves.open_matte("s", std::nullopt, {refused, 0}).status()));
    EXPECT_TRUE(absl::IsInvalidArgument(solves.open_partial_matte("s", {refused, 0}).status()));
  }
  // Files for sending have no name that could stay.
  for (const fs::directory_entry& entry : fs::directory_iterator(data_ / "server"))
    EXPECT_FALSE(entry.path().filename().string().starts_with("unnamed")) << entry.path();
}

TEST_F(SessionLife, ASolveThatFollowsTheCaptureNeedsNoOtherCall) {
  start();
  capture(small_plan(), true);
  const v1::Session solving =
      wait_until([](const v1::Session& session) { return session.state() == v1::SESSION_STATE_SOLVING; });
  EXPECT_EQ(solving.method(), "alpha");
  EXPECT_FALSE(solving.solve_follows());
  EXPECT_GT(complete(1.0f), 0);
  EXPECT_EQ(settled().state(), v1::SESSION_STATE_DONE);
}

TEST_F(SessionLife, ALeaseIsOfNoUseToThoseWhoDoNotKnowItsSecret) {
  start();
  ASSERT_EQ(capture(small_plan()).state(), v1::SESSION_STATE_CAPTURED);
  solve_in_tiles("alpha");
  const v1::ClaimTileResponse own = solver_->claim();
  ASSERT_TRUE(own.has_lease());
  EXPECT_EQ(own.lease().secret().size(), 64u) << "256 bits in hex";
  for (const std::string& secret : {std::string(), std::string(64, '0'), own.lease().secret().substr(1)}) {
    v1::ClaimTileResponse guessed = own;
    guessed.mutable_lease()->set_secret(secret);
    EXPECT_EQ(solver_->keep(guessed).error_code(), grpc::StatusCode::ABORTED);
    EXPECT_EQ(solver_->fail(guessed, "Press the button").error_code(), grpc::StatusCode::ABORTED);
    EXPECT_EQ(solver_->complete_rows(guessed, kWidth, kHeight, 9.0f).error_code(), grpc::StatusCode::ABORTED);
  }
  v1::ClaimTileResponse other = own;  // its secret is of no use for another tile
  other.mutable_lease()->set_tile(own.lease().tile() + 1);
  EXPECT_EQ(solver_->fail(other, "no").error_code(), grpc::StatusCode::ABORTED);
  EXPECT_EQ(server().sessions().find("s")->state(), v1::SESSION_STATE_SOLVING);
  EXPECT_OK(solver_->keep(own));
  EXPECT_OK(solver_->complete_rows(own, kWidth, kHeight, 1.0f));
}

// Bytes that were lost before the file's checksum was made.
TEST_F(SessionLife, ASpoiledTileIsSolvedAgainAndASolverThatSpoilsTwiceGetsNoMore) {
  start();
  ASSERT_EQ(capture(small_plan()).state(), v1::SESSION_STATE_CAPTURED);
  const int tiles = solve_in_tiles("alpha");
  for (int spoiled = 0; spoiled < 2; ++spoiled) {
    const v1::ClaimTileResponse tile = solver_->claim();
    ASSERT_TRUE(tile.has_lease()) << spoiled;
    std::string matte = IdleSolver::rows(tile, kWidth, kHeight, 1.0f);
    std::fill(matte.end() - 64, matte.end(), '\xff');
    const grpc::Status sent = solver_->complete_rows(tile, matte);
    EXPECT_EQ(sent.error_code(), grpc::StatusCode::ABORTED) << sent.error_message();
    EXPECT_NE(sent.error_message().find("corrupt"), std::string::npos) << sent.error_message();
  }
  v1::ClaimTileResponse none;
  const grpc::Status refused = solver_->try_to_claim(IdleSolver::request(), none);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_NE(refused.error_message().find("solver \"idle\" submitted 2 corrupt mattes"), std::string::npos)
      << refused.error_message();
  EXPECT_EQ(server().fleet()->solvers(0).refused(), refused.error_message());
  // Another solver gets all of them.
  v1::ClaimTileRequest request = IdleSolver::request();
  request.set_solver("other");
  int done = 0;
  for (v1::ClaimTileResponse tile; solver_->try_to_claim(request, tile).ok() && tile.has_lease();
       tile.Clear())
    done += solver_->complete_rows(tile, kWidth, kHeight, 2.0f).ok() ? 1 : 0;
  EXPECT_EQ(done, tiles);
  EXPECT_EQ(settled().state(), v1::SESSION_STATE_DONE);
}

// Its answer was late: the solver does not know that it has a tile.
TEST_F(SessionLife, ARepeatedClaimGetsTheTileThatTheFirstLeased) {
  start();
  ASSERT_EQ(capture(small_plan()).state(), v1::SESSION_STATE_CAPTURED);
  ASSERT_GT(solve_in_tiles("alpha"), 2);
  v1::ClaimTileRequest request = IdleSolver::request();
  const auto claim = [&](const std::string& id) {
    request.set_request_id(id);
    v1::ClaimTileResponse response;
    EXPECT_OK(solver_->try_to_claim(request, response));
    return response;
  };
  const v1::ClaimTileResponse first = claim("one");
  ASSERT_TRUE(first.has_lease());
  EXPECT_EQ(claim("one").SerializeAsString(), first.SerializeAsString());
  const v1::ClaimTileResponse second = claim("two");
  EXPECT_NE(second.lease().tile(), first.lease().tile());
  // A tile that is done is no answer any more.
  ASSERT_OK(solver_->complete_rows(second, kWidth, kHeight, 1.0f));
  const v1::ClaimTileResponse third = claim("two");
  ASSERT_TRUE(third.has_lease());
  EXPECT_NE(third.lease().tile(), second.lease().tile());
}

TEST_F(SessionLife, ASolveThatFollowsIsBegunAfterARestart) {
  start();
  ASSERT_EQ(capture(small_plan()).state(), v1::SESSION_STATE_CAPTURED);
  const v1::Session session = followed_after_restart();
  EXPECT_EQ(session.state(), v1::SESSION_STATE_SOLVING);
  EXPECT_EQ(session.reason(), "");
}

TEST_F(SessionLife, ASolveThatFollowsAndCannotBeBegunSaysWhy) {
  start();
  ASSERT_EQ(capture(small_plan()).state(), v1::SESSION_STATE_CAPTURED);
  fs::rename(data_ / "archives" / "s", data_ / "aside");
  const v1::Session session = followed_after_restart();
  EXPECT_EQ(session.state(), v1::SESSION_STATE_CAPTURED);
  EXPECT_THAT(session.reason(), testing::StartsWith("captured, but not solved: "));
}

TEST_F(SessionLife, NoSolveFollowsACalibration) {
  start();
  v1::CreateSessionRequest request;
  *request.mutable_plan() = small_plan();
  request.mutable_plan()->mutable_calibration();
  request.set_solve(true);
  EXPECT_TRUE(absl::IsInvalidArgument(server().captures().create(request, {}).status()));
}

TEST_F(SessionLife, ARefusedImportLeavesNothingAndOneThatWasBegunCanBeDeleted) {
  start();
  v1::BeginImportRequest request;
  request.set_name("s");
  EXPECT_TRUE(absl::IsInvalidArgument(server().importer().begin(request, {}).status()));  // without a camera
  EXPECT_TRUE(absl::IsNotFound(server().sessions().find("s").status()));
  v1::Camera& camera = *request.mutable_manifest()->mutable_camera();
  camera.set_width_px(kWidth);
  camera.set_height_px(kHeight);
  ASSERT_OK(server().importer().begin(request, {}));
  ASSERT_OK(server().importer().begin(request, {}));  // again
  ASSERT_OK(server().deleter().remove("s"));
  EXPECT_TRUE(absl::IsNotFound(server().sessions().find("s").status()));
  EXPECT_FALSE(server().importer().finish("s").ok());
}

TEST_F(SessionLife, SessionsWithPhotosRunOneAfterAnotherAndTakeThemAlong) {
  start();
  v1::Plan plan = small_plan();
  v1::EstimateSessionRequest estimate;
  *estimate.mutable_plan() = plan;
  const v1::Monitor monitor = server().captures().estimate(estimate)->monitors(0);
  constexpr int kSessions = 5, kPhotos = 14;  // once displays held 64 in all
  const auto count = [&] {
    return std::distance(fs::directory_iterator(server().images().path("x").parent_path()),
                         fs::directory_iterator());
  };
  for (int session = 0; session < kSessions; ++session) {
    plan.clear_photos();
    for (int photo = 0; photo < kPhotos; ++photo) {
      Image16 image(monitor.width_px(), monitor.height_px());
      image.samples[0] = static_cast<std::uint16_t>(session * kPhotos + photo);
      ImageFiles::Upload upload = server().images().begin().value();
      ASSERT_OK(upload.add(encode_png16(image).value()));
      v1::Photo& shown = *plan.add_photos();
      shown.set_file(upload.finish().value());
      shown.set_name("photo-" + std::to_string(photo));
    }
    const v1::Session captured = capture(plan);
    ASSERT_EQ(captured.state(), v1::SESSION_STATE_CAPTURED) << session << ": " << captured.reason();
    EXPECT_EQ(count(), kPhotos);
    ASSERT_OK(server().deleter().remove("s"));
    EXPECT_EQ(count(), 0);
  }
}

TEST_F(SessionLife, ATileThatNobodyCanSolveIsNamedOnceTheOthersAreDone) {
  start();
  ASSERT_EQ(capture(small_plan()).state(), v1::SESSION_STATE_CAPTURED);
  const int tiles = solve_in_tiles("alpha");
  const v1::ClaimTileResponse hard = solver_->claim();
  v1::ClaimTileResponse tile = hard;
  for (int attempt = 1; attempt <= kMaxAttempts; ++attempt) {
    EXPECT_EQ(server().sessions().find("s")->quarantined_size(), 0);
    EXPECT_EQ(tile.lease().tile(), hard.lease().tile());
    ASSERT_OK(solver_->fail(tile, "out of memory", false));
    // Tiles that failed come last.
    for (tile = solver_->claim(); tile.has_lease() && tile.lease().tile() != hard.lease().tile();
         tile = solver_->claim())
      ASSERT_OK(solver_->complete_rows(tile, kWidth, kHeight, 1.0f));
  }
  const v1::Session failed = settled();
  EXPECT_EQ(failed.state(), v1::SESSION_STATE_FAILED);
  ASSERT_EQ(failed.quarantined_size(), 1);
  EXPECT_EQ(failed.quarantined(0).tile(), hard.lease().tile());
  EXPECT_EQ(failed.quarantined(0).first(), hard.first_row());
  EXPECT_NE(failed.reason().find("out of memory"), std::string::npos) << failed.reason();
  EXPECT_EQ(failed.tiles_done(), tiles - 1);
  ASSERT_OK(resume());
  EXPECT_EQ(complete(2.0f), 1);
  EXPECT_EQ(settled().state(), v1::SESSION_STATE_DONE);
  EXPECT_TRUE(server().sessions().find("s")->quarantined().empty());
}

TEST_F(SessionLife, ASolverThatWouldComputeSomethingElseIsRefused) {
  start();
  const auto refusal = [&](const v1::ClaimTileRequest& request) {
    v1::ClaimTileResponse response;
    const grpc::Status status = solver_->try_to_claim(request, response);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
    return status.error_message();
  };
  v1::ClaimTileRequest request = IdleSolver::request();
  (*request.mutable_method_versions())["ramp"] += 1;
  EXPECT_NE(
      refusal(request).find("solver \"idle\" computes \"ramp\" version 2, the server expects version 1"),
      std::string::npos)
      << refusal(request);
  request = IdleSolver::request();
  request.mutable_method_versions()->erase("matte");
  EXPECT_NE(refusal(request).find("no \"matte\""), std::string::npos) << refusal(request);
  request = IdleSolver::request();
  request.set_version("0.0.9");
  EXPECT_NE(refusal(request).find("is Glasswing 0.0.9, the server 0.1.0"), std::string::npos)
      << refusal(request);
}

// What a server that is killed now would find when it starts again.
TEST_F(SessionLife, TheCatalogueIsNeverBehindWhatWasShown) {
  start();
  // The next frames are stored when the test has seen the ones before.
  std::counting_semaphore<> may_store(1);
  at_fault_points([&](std::string_view point) {
    if (point == "frames written") may_store.acquire();
  });
  v1::CreateSessionRequest create;
  create.set_name("s");
  *create.mutable_plan() = small_plan();
  ASSERT_OK(server().captures().create(create, {.client = "anna@lab3", .hold = ""}));
  v1::Session shown;
  std::set<int> seen;
  do {
    const std::int64_t change = server().sessions().wait_change(0, std::chrono::milliseconds(0));
    shown = server().sessions().find("s").value();
    if (seen.insert(shown.proven_count()).second) may_store.release();
    EXPECT_GE(server().sessions().stored("s")->proven_count(), shown.proven_count());
    if (shown.state() == v1::SESSION_STATE_CAPTURING)
      server().sessions().wait_change(change, std::chrono::seconds(1));
  } while (shown.state() == v1::SESSION_STATE_CAPTURING);
  at_fault_points(nullptr);
  EXPECT_EQ(shown.state(), v1::SESSION_STATE_CAPTURED) << shown.reason();
  EXPECT_GT(seen.size(), 2u) << "the capture was not seen on its way";
}

TEST_F(SessionLife, AFailedCaptureNamesItsStepsAndCanBeTriedAgain) {
  start({.name = "slow camera", .frame_rate_hz = 30.0});
  v1::Plan plan = small_plan();
  plan.set_exposure_ms(0, 20.0);  // longer than the picture is shown: 4 refreshes of 240 Hz are 16.7 ms
  plan.set_retries(0);
  v1::Session session = capture(plan);
  ASSERT_EQ(session.state(), v1::SESSION_STATE_FAILED) << session.reason();
  ASSERT_GT(session.unproven_size(), 0);
  EXPECT_TRUE(session.unproven(0).what().starts_with("back ")) << session.unproven(0).what();
  EXPECT_TRUE(server().list({})->at(0).unproven().empty());
  EXPECT_TRUE(absl::IsInvalidArgument(resume(101).status()));
  ASSERT_OK(resume(1));
  session = rested();
  EXPECT_EQ(session.plan().retries(), 1);
  EXPECT_EQ(session.state(), v1::SESSION_STATE_FAILED);
  EXPECT_GT(session.retaken_count(), 0);
  // The exposures are too long for the windows; some windows lie between two of them.
  int counted = 0;
  for (const v1::RetakeCount& retakes : session.retakes()) {
    counted += retakes.count();
    EXPECT_TRUE(retakes.cause() == v1::RETAKE_CAUSE_OUTSIDE_WINDOW ||
                retakes.cause() == v1::RETAKE_CAUSE_NO_FRAME)
        << retakes.ShortDebugString();
  }
  EXPECT_GE(counted, session.retaken_count());
}

TEST_F(SessionLife, NothingIsLeftOfADeletedSession) {
  start();
  EXPECT_TRUE(absl::IsNotFound(server().deleter().remove("s").status()));
  ASSERT_EQ(capture(small_plan()).state(), v1::SESSION_STATE_CAPTURED);
  solve("alpha");
  EXPECT_TRUE(absl::IsFailedPrecondition(server().deleter().remove("s").status())) << "it is being solved";
  complete(1.0f);
  const v1::Session session = settled();
  const fs::path matte = server().solves().matte("s", std::nullopt).value();
  const std::int64_t matte_bytes = fs::file_size(matte);
  const absl::StatusOr<std::int64_t> freed = server().deleter().remove("s");
  ASSERT_OK(freed);
  EXPECT_EQ(*freed, session.archive_bytes() + matte_bytes);
  EXPECT_FALSE(fs::exists(matte));
  EXPECT_TRUE(fs::is_empty(data_ / "archives"));
  EXPECT_TRUE(absl::IsNotFound(server().sessions().find("s").status()));
  EXPECT_EQ(capture(small_plan()).state(), v1::SESSION_STATE_CAPTURED) << "the name is free";
}

TEST_F(SessionLife, WhatBrokeOffWhileDeletingIsFinishedByAskingAgain) {
  start();
  const v1::Session captured = capture(small_plan());
  ASSERT_EQ(captured.state(), v1::SESSION_STATE_CAPTURED);
  solve("alpha");
  complete(1.0f);
  EXPECT_EQ(settled().state(), v1::SESSION_STATE_DONE);
  // As if the server had ended between the first step and the second, and the node in the middle of its own.
  fs::rename(data_ / "archives" / "s", data_ / "archives" / ".removed-s");
  fs::remove(data_ / "archives" / ".removed-s" / "header.json");
  {
    v1::DeleteArchiveRequest request;
    request.set_session("s");
    v1::DeleteArchiveResponse response;
    grpc::ClientContext context;
    const auto node = v1::ArchiveService::NewStub(dial(captured.archive_address()));
    ASSERT_OK(node->DeleteArchive(&context, request, &response));
  }
  EXPECT_TRUE(fs::is_empty(data_ / "archives"));
  ASSERT_OK(server().deleter().remove("s"));
  EXPECT_TRUE(absl::IsNotFound(server().sessions().find("s").status()));
  EXPECT_TRUE(fs::is_empty(data_ / "server" / "mattes"));
}

}  // namespace
}  // namespace glasswing
