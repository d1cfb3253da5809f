// A video on a simulated rig that loses frames, from the capture to the mattes of its frames.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/matte/matte_file.h"
#include "core/pattern/plan.h"
#include "core/pattern/video_frames.h"
#include "core/service/service.h"
#include "tests/faults/capture/rig.h"
#include "tests/server/dispatch/idle_solver.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using std::chrono::seconds;

v1::Plan video_plan(int frames) {
  v1::Plan plan;
  plan.set_method("ramp");
  plan.mutable_ramp()->set_frames(frames);
  plan.mutable_ramp()->set_empty_frames(3);
  plan.add_exposure_ms(FaultyRig::kExposure_ms);
  plan.set_hold_refreshes(4);
  plan.set_retries(100);
  return plan;
}

class VideoTest : public testing::Test {
 protected:
  void start(const RigFaults& faults) { rig_ = std::make_unique<FaultyRig>(faults, 1, 16, data_); }
  void TearDown() override { rig_ = nullptr; }

  // Returns when the session rests. Calls `seen` with every change.
  v1::Session capture(const v1::Plan& plan, const std::function<void(const v1::Session&)>& seen = nullptr) {
    const grpc::Status status = rig_->create(plan);
    EXPECT_OK(status);
    return rig_->watch(seen);
  }
  // Returns once all tiles are done or the solve has failed.
  v1::Session settled() {
    while (true) {
      const std::int64_t seen = rig_->server().sessions().wait_change(0, std::chrono::milliseconds(0));
      const v1::Session session = rig_->server().sessions().find("s").value();
      if (session.state() != v1::SESSION_STATE_SOLVING) return session;
      rig_->server().sessions().wait_change(seen, seconds(1));
    }
  }
  v1::CaptureManifest archive() const { return Archive::open(rig_->archive("s")).value()->manifest(); }

  // The camera loses so many frames that some windows have none.
  v1::Session lossy_capture(int frames) {
    start({.name = "drops", .drop = 0.6, .frame_rate_hz = 120.0});
    return capture(video_plan(frames));
  }

  const TemporaryDirectory data_;
  std::unique_ptr<FaultyRig> rig_;
};

std::vector<int> list(const google::protobuf::RepeatedField<std::int32_t>& numbers) {
  return {numbers.begin(), numbers.end()};
}

TEST_F(VideoTest, FramesWithoutProofAreLostAndNoneIsTakenAgain) {
  constexpr int kFrames = 60;
  const v1::Session session = lossy_capture(kFrames);
  ASSERT_EQ(session.state(), v1::SESSION_STATE_CAPTURED) << session.reason();
  EXPECT_EQ(session.frame_count(), kFrames);
  const v1::CaptureManifest manifest = archive();
  const std::vector<int> video = video_frames(manifest);
  ASSERT_EQ(video.size(), size_t{kFrames});
  EXPECT_EQ(list(session.lost_frames()), lost_frames(video));
  EXPECT_GT(session.lost_frames_size(), 0);
  EXPECT_EQ(session.proven_count(), session.step_count() - session.lost_frames_size());
  EXPECT_NE(session.warning().find(std::to_string(session.lost_frames_size()) +
                                   " of 60 frames of the video were lost, at most "),
            std::string::npos)
      << session.warning();
  // A video is exposed in the order of its frames.
  std::int64_t last_ns = 0;
  for (const int place : video) {
    if (place < 0) continue;
    EXPECT_GT(manifest.frames(place).exposure_start_ns(), last_ns);
    last_ns = manifest.frames(place).exposure_start_ns();
  }
  int empty = 0;
  for (const v1::Frame& frame : manifest.frames()) {
    if (frame.stimulus().kind() != "ramp" || frame.object()) continue;
    ++empty;
    EXPECT_LT(frame.exposure_end_ns(),
              manifest.frames(*std::ranges::find_if(video, [](int place) { return place >= 0; }))
                  .exposure_start_ns());
  }
  EXPECT_EQ(empty, 3);  // frames of the empty stage are retaken until proven
}

TEST_F(VideoTest, AVideoThatBrokeOffKeepsWhatItHasAndDoesNotGoOn) {
  constexpr int kFrames = 400;
  start({.name = "camera dies"});
  std::set<std::string> before;
  const v1::Session session = capture(video_plan(kFrames), [&](const v1::Session& now) {
    const int others = now.step_count() - kFrames;
    if (!before.empty() || others <= 0 || now.proven_count() <= others) return;
    const v1::CaptureManifest kept = archive();
    for (const v1::Frame& frame : kept.frames()) before.insert(frame.file() + frame.checksum());
    rig_->restart_camera();
  });
  ASSERT_EQ(session.state(), v1::SESSION_STATE_CAPTURED) << session.reason();
  ASSERT_FALSE(before.empty());
  const v1::CaptureManifest manifest = archive();
  std::set<std::string> after;
  for (const v1::Frame& frame : manifest.frames()) after.insert(frame.file() + frame.checksum());
  EXPECT_TRUE(std::ranges::includes(after, before));
  const std::vector<int> video = video_frames(manifest);
  EXPECT_EQ(list(session.lost_frames()), lost_frames(video));
  const auto last = std::ranges::find_if(video.rbegin(), video.rend(), [](int place) { return place >= 0; });
  const auto length = video.rend() - last;
  EXPECT_LT(length, kFrames);
  const std::string says = "the video ended early: " + std::to_string(length) + " of 400 frames";
  EXPECT_NE(session.warning().find(says), std::string::npos) << session.warning();
}

TEST_F(VideoTest, MattesOfFramesAreKeptAsTheyAreSolved) {
  constexpr int kFrames = 50;
  const v1::Session captured = lossy_capture(kFrames);
  ASSERT_EQ(captured.state(), v1::SESSION_STATE_CAPTURED) << captured.reason();
  const std::set<int> lost(captured.lost_frames().begin(), captured.lost_frames().end());
  ASSERT_FALSE(lost.empty());
  Server& server = rig_->server();
  IdleSolver solver(server);
  v1::SolveSessionRequest request;
  request.set_name("s");
  ASSERT_EQ(server.solves().solve(request)->method(), "ramp");

  const v1::ClaimTileResponse first = solver.claim();
  EXPECT_EQ(first.first_frame(), 0);
  EXPECT_EQ(first.frame_count(), kFrames / 2);
  EXPECT_EQ(first.row_count(), 0);
  // A tile that lacks a frame, or whose last file is truncated, is refused and has no effect.
  std::set<int> too_few = lost;
  int last = first.frame_count() - 1;
  while (lost.contains(last)) --last;
  too_few.insert(last);
  EXPECT_EQ(solver.complete(first, too_few).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  if (!lost.contains(first.frame_count() - 1)) {
    EXPECT_EQ(solver.complete(first, lost, 1.0f, 1).error_code(), grpc::StatusCode::DATA_LOSS);
  }
  EXPECT_TRUE(server.sessions().find("s")->solved_frames().empty());
  EXPECT_FALSE(fs::exists(data_ / "server" / "mattes" / "s" / "0000.exr"));

  ASSERT_OK(solver.complete(first, lost));
  ASSERT_OK(solver.complete(first, lost));  // again, as if the answer had been lost
  std::vector<int> solved;
  for (int frame = 0; frame < first.frame_count(); ++frame) {
    if (!lost.contains(frame)) solved.push_back(frame);
  }
  v1::Session session = *server.sessions().find("s");
  EXPECT_EQ(list(session.solved_frames()), solved);
  EXPECT_EQ(session.object_pixel_count(), 10);
  EXPECT_EQ(session.state(), v1::SESSION_STATE_SOLVING);
  for (const int frame : solved)
    EXPECT_EQ(read_file(*server.solves().matte("s", frame)).value(), IdleSolver::matte(frame, 1.0f));
  EXPECT_TRUE(absl::IsNotFound(server.solves().matte("s", *lost.begin()).status()));
  EXPECT_TRUE(absl::IsNotFound(server.solves().matte("s", kFrames).status()));
  EXPECT_TRUE(absl::IsFailedPrecondition(server.solves().matte("s", first.frame_count() + 1).status()) ||
              lost.contains(first.frame_count() + 1));
  EXPECT_TRUE(absl::IsFailedPrecondition(server.solves().matte("s", std::nullopt).status()));

  // A failed solve keeps them, also across a restart of the server.
  ASSERT_OK(solver.fail(solver.claim(), "frame 17: it cannot be read"));
  session = *server.sessions().find("s");
  EXPECT_EQ(session.state(), v1::SESSION_STATE_FAILED);
  EXPECT_TRUE(session.reason().ends_with(": frame 17: it cannot be read")) << session.reason();
  EXPECT_EQ(list(session.solved_frames()), solved);
  {
    const auto again = Server::open({.data = data_ / "server"}).value();
    EXPECT_EQ(read_file(*again->solves().matte("s", solved.back())).value(),
              IdleSolver::matte(solved.back(), 1.0f));
  }

  // The next solve replaces them, and late results of the last one are refused.
  ASSERT_OK(server.solves().solve(request));
  EXPECT_TRUE(server.sessions().find("s")->solved_frames().empty());
  EXPECT_EQ(solver.complete(first, lost).error_code(), grpc::StatusCode::ABORTED);
  int tiles = 0, smallest = kFrames;
  for (v1::ClaimTileResponse tile = solver.claim(); tile.has_lease(); tile = solver.claim(), ++tiles) {
    smallest = std::min(smallest, tile.frame_count());
    ASSERT_OK(solver.complete(tile, lost, 2.0f));
  }
  EXPECT_LT(smallest, first.frame_count());  // tiles shrink towards the end
  session = settled();
  EXPECT_EQ(session.state(), v1::SESSION_STATE_DONE);
  EXPECT_EQ(session.tiles_done(), tiles);
  EXPECT_EQ(session.solved_frames_size(), kFrames - static_cast<int>(lost.size()));
  EXPECT_EQ(read_file(*server.solves().matte("s", solved.front())).value(),
            IdleSolver::matte(solved.front(), 2.0f));
  EXPECT_THAT(session.matte_warnings(), testing::UnorderedElementsAre("even", "odd"));

  // A finished solve stays until the next one finishes. Frames without a possible matte fail the session once
  // all others are solved.
  ASSERT_OK(server.solves().solve(request));
  const std::set<int> refused{solved.front(), solved.back()};
  for (v1::ClaimTileResponse tile = solver.claim(); tile.has_lease(); tile = solver.claim())
    ASSERT_OK(solver.complete(tile, lost, 3.0f, 0, tile.first_frame() == 0 ? refused : std::set<int>()));
  session = settled();
  EXPECT_EQ(session.state(), v1::SESSION_STATE_FAILED);
  EXPECT_EQ(session.reason(),
            fmt::format("no matte can be made from 2 of its frames; frame {}: the background moved",
                        solved.front()));
  EXPECT_EQ(std::set<int>(session.refused_frames().begin(), session.refused_frames().end()), refused);
  EXPECT_EQ(session.solved_frames_size(), kFrames - static_cast<int>(lost.size()));
  for (const int frame : {solved.front(), solved[1]})
    EXPECT_EQ(read_file(*server.solves().matte("s", frame)).value(), IdleSolver::matte(frame, 2.0f));

  // A retry solves only those; then all mattes are of the new solve.
  v1::ResumeSessionRequest retry;
  retry.set_name("s");
  ASSERT_OK(server.control().resume(retry, {}));
  std::set<int> again;
  for (v1::ClaimTileResponse tile = solver.claim(); tile.has_lease(); tile = solver.claim()) {
    for (int i = 0; i < tile.frame_count(); ++i) again.insert(tile.first_frame() + i);
    ASSERT_OK(solver.complete(tile, lost, 4.0f));
  }
  EXPECT_EQ(again, refused);
  session = settled();
  EXPECT_EQ(session.state(), v1::SESSION_STATE_DONE) << session.reason();
  EXPECT_TRUE(session.refused_frames().empty());
  EXPECT_EQ(session.solved_frames_size(), kFrames - static_cast<int>(lost.size()));
  for (const int frame : solved) {
    EXPECT_EQ(read_file(*server.solves().matte("s", frame)).value(),
              IdleSolver::matte(frame, refused.contains(frame) ? 4.0f : 3.0f));
  }
}

}  // namespace
}  // namespace glasswing
