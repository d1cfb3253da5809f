// Calls that take longer than their deadline, at each daemon. The caller repeats such a call, and is joined
// to the first, which is still at work; the session ends as an undisturbed one does, its frames with every
// step once (capture.slow-calls), its matte with the same bits (solve.slow-calls).
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <numeric>

#include "core/file/fault_point.h"
#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/service/joined_calls.h"
#include "core/service/service.h"
#include "server/sessions/session_state.h"
#include "solver/worker/work_loop.h"
#include "tests/faults/capture/rig.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::seconds;

// Of calls to nodes, results of tiles and claims, which wait for 2 s.
constexpr milliseconds kDeadline(300), kClaimDeadline(2500);

// Holds back the first call that comes to a fault point, or a later one.
class Hold {
 public:
  explicit Hold(std::string point, int visit = 1) : point_(std::move(point)), left_(visit) {
    at_fault_points([this](std::string_view name) { pass(name); });
  }
  ~Hold() {
    release();
    at_fault_points(nullptr);
  }
  void wait_struck() {
    std::unique_lock lock(mutex_);
    ASSERT_TRUE(changed_.wait_for(lock, seconds(60), [this] { return left_ <= 0; }))
        << point_ << " was not passed";
  }
  void release() {
    const std::lock_guard lock(mutex_);
    released_ = true;
    changed_.notify_all();
  }
  int visits() const { return visits_; }

 private:
  void pass(std::string_view name) {
    if (name != point_) return;
    ++visits_;
    std::unique_lock lock(mutex_);
    const bool held = --left_ == 0;
    changed_.notify_all();
    if (held) changed_.wait(lock, [this] { return released_; });
  }

  const std::string point_;
  std::atomic<int> visits_ = 0;
  std::mutex mutex_;
  std::condition_variable changed_;
  int left_;               // visits until one is held; guarded by mutex_
  bool released_ = false;  // guarded by mutex_
};

v1::Plan small_plan() {
  v1::Plan plan;
  plan.set_method("gaussian");
  for (const double orientation_deg : {0.0, 90.0, 45.0}) {
    v1::Sweep& sweep = *plan.add_sweeps();
    sweep.set_orientation_deg(orientation_deg);
    sweep.set_sigma_px(12.0);
    sweep.set_step_px(12.0);
  }
  for (const auto& colour : {std::array{0.0, 0.0, 0.0}, {1.0, 1.0, 1.0}, {0.8, 0.2, 0.1}}) {
    v1::Solid& solid = *plan.add_solids();
    for (const double value : colour) solid.add_colour(value);
  }
  plan.mutable_square_waves()->set_levels(3);
  plan.set_hold_refreshes(4);
  plan.add_exposure_ms(FaultyRig::kExposure_ms);
  plan.set_retries(100);
  return plan;
}

class SlowCalls : public testing::Test {
 protected:
  void SetUp() override {
    rig_ = std::make_unique<FaultyRig>(RigFaults{.name = "slow", .node_call = kDeadline}, 1, 16, data_);
  }
  void TearDown() override { rig_ = nullptr; }

  void begin(const std::string& name) {
    v1::CreateSessionRequest create;
    create.set_name(name);
    *create.mutable_plan() = small_plan();
    v1::CreateSessionResponse created;
    grpc::ClientContext context;
    const grpc::Status status = rig_->sessions().CreateSession(&context, create, &created);
    ASSERT_OK(status);
  }
  // Returns once `is_so`, or when the session rests.
  v1::Session wait_until(const std::string& name, const std::function<bool(const v1::Session&)>& is_so) {
    SessionStore& sessions = rig_->server().sessions();
    while (true) {
      const std::int64_t seen = sessions.wait_change(0, milliseconds(0));
      v1::Session session = sessions.find(name).value();
      const bool rests =
          session.state() != v1::SESSION_STATE_CAPTURING && session.state() != v1::SESSION_STATE_SOLVING;
      if (rests || is_so(session)) return session;
      sessions.wait_change(seen, milliseconds(100));
    }
  }
  v1::Session wait_rests(const std::string& name) {
    return wait_until(name, [](const v1::Session&) { return false; });
  }
  // The first try has exceeded its deadline, and the server says what it waits for.
  void wait_slow(const std::string& name, const std::string& what) {
    const v1::Session session =
        wait_until(name, [](const v1::Session& now) { return now.reason().starts_with(kWaitsForAnswer); });
    ASSERT_EQ(session.state(), v1::SESSION_STATE_CAPTURING) << session.reason();
    EXPECT_NE(session.reason().find(what), std::string::npos) << session.reason();
  }
  void wait_joined(double before) {
    const nanoseconds deadline = monotonic_now() + seconds(60);
    while (joined_calls().Value() <= before) {
      ASSERT_LT(monotonic_now(), deadline) << "no repetition was joined";
      sleep_until_monotonic(monotonic_now() + milliseconds(5));
    }
  }
  // As an undisturbed session ends.
  void expect_captured(const std::string& name) {
    const v1::Session session = wait_rests(name);
    EXPECT_EQ(session.state(), v1::SESSION_STATE_CAPTURED) << session.reason();
    EXPECT_EQ(session.reason(), "");
    EXPECT_EQ(session.proven_count(), session.step_count());
    const v1::CaptureManifest archive = Archive::open(rig_->archive(name)).value()->manifest();
    std::vector<int> steps;
    for (const v1::Frame& frame : archive.frames()) steps.push_back(frame.step());
    std::ranges::sort(steps);
    std::vector<int> all(session.step_count());
    std::iota(all.begin(), all.end(), 0);
    EXPECT_EQ(steps, all);
    EXPECT_TRUE(fs::exists(rig_->archive(name) / "manifest.json"));
  }
  // A call to a node that is held until its repetition has come.
  void hold(const std::string& point, const std::string& what, int visit = 1) {
    SCOPED_TRACE(point);
    const std::string name = fmt::format("s{}", ++made_);
    const double before = joined_calls().Value();
    Hold held(point, visit);
    begin(name);
    held.wait_struck();
    wait_slow(name, what);
    wait_joined(before);
    held.release();
    expect_captured(name);
  }

  const TemporaryDirectory data_;
  std::unique_ptr<FaultyRig> rig_;
  int made_ = 0;
};

TEST_F(SlowCalls, AnUndisturbedSession) {
  begin("s");
  expect_captured("s");
}

TEST_F(SlowCalls, OfTheCameraNode) {
  hold("archive begun", "create the archive");
  hold("object moves", "move the object");
  hold("frames written", "learn id patches");
  hold("frames written", "store frames", 2);
  hold("archive sealed", "seal the archive");
}

TEST_F(SlowCalls, OfADisplayNode) {
  hold("program drawn", "draw a program");
}

TEST_F(SlowCalls, ACameraThatIsSlowToStartIsWaitedFor) {
  Hold held("camera starts");
  begin("s");
  held.wait_struck();
  wait_slow("s", "start the camera");
  held.release();
  expect_captured("s");
}

// What was refused as the camera "capturing for another client": the session itself.
TEST_F(SlowCalls, ASessionThatGoesOnFindsTheCameraThatItBeganToStart) {
  Hold held("camera starts");
  begin("s");
  held.wait_struck();
  v1::PauseSessionRequest pause;
  pause.set_name("s");
  v1::PauseSessionResponse paused;
  grpc::ClientContext pause_context;
  const grpc::Status stopped = rig_->sessions().PauseSession(&pause_context, pause, &paused);
  ASSERT_OK(stopped);
  v1::ResumeSessionRequest resume;
  resume.set_name("s");
  v1::ResumeSessionResponse resumed;
  grpc::ClientContext resume_context;
  const grpc::Status again = rig_->sessions().ResumeSession(&resume_context, resume, &resumed);
  ASSERT_OK(again);
  wait_slow("s", "start the camera");
  EXPECT_EQ(held.visits(), 1);
  held.release();
  expect_captured("s");
}

// The node goes on with what it was asked for; the session does not wait for it.
TEST_F(SlowCalls, ACancelledCaptureEndsWhileTheCameraNodeStillHoldsItsCall) {
  for (const auto& [point, visit] : {std::pair("frames written", 2), {"camera starts", 1}}) {
    SCOPED_TRACE(point);
    const std::string name = fmt::format("s{}", ++made_);
    Hold held(point, visit);
    begin(name);
    held.wait_struck();
    v1::CancelSessionRequest cancel;
    cancel.set_name(name);
    v1::CancelSessionResponse cancelled;
    grpc::ClientContext context;
    set_deadline(context, seconds(60));
    const grpc::Status status = rig_->sessions().CancelSession(&context, cancel, &cancelled);
    EXPECT_OK(status);
    EXPECT_EQ(cancelled.session().state(), v1::SESSION_STATE_CANCELLED);
  }
}

class SlowResults : public SlowCalls {
 protected:
  void SetUp() override {
    SlowCalls::SetUp();
    begin("s");
    expect_captured("s");
    const WorkOptions work{.server = rig_->address(),
                           .name = "solver-1",
                           .threads = 1,
                           .claim_time = kClaimDeadline,
                           .result_time = kDeadline};
    solver_ = std::jthread([work](std::stop_token stop) { EXPECT_OK(run_work_loop(work, stop)); });
    undisturbed_ = solve(nullptr);
  }
  void TearDown() override {
    solver_ = {};
    SlowCalls::TearDown();
  }

  // The matte. `meanwhile` is called once the solve has begun.
  std::string solve(const std::function<void()>& meanwhile) {
    v1::SolveSessionRequest request;
    request.set_name("s");
    v1::SolveSessionResponse response;
    grpc::ClientContext context;
    const grpc::Status status = rig_->sessions().SolveSession(&context, request, &response);
    EXPECT_OK(status);
    if (meanwhile) meanwhile();
    const v1::Session session = wait_rests("s");
    EXPECT_EQ(session.state(), v1::SESSION_STATE_DONE) << session.reason();
    EXPECT_EQ(session.tiles_done(), session.tile_count());
    EXPECT_TRUE(session.quarantined().empty());
    return read_file(data_ / "server/mattes/s.exr").value();
  }
  void hold_result(const std::string& point) {
    SCOPED_TRACE(point);
    const double before = joined_calls().Value();
    Hold held(point);
    const std::string matte = solve([&] {
      held.wait_struck();
      wait_joined(before);
      held.release();
    });
    EXPECT_TRUE(matte == undisturbed_) << "the matte differs";
  }

  std::jthread solver_;
  std::string undisturbed_;
};

TEST_F(SlowResults, OfTheServer) {
  for (const char* point : {"survey committed", "tile received", "tile written", "tile committed"})
    hold_result(point);
}

}  // namespace
}  // namespace glasswing
