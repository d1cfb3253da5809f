// Several cameras that see the same steps, on a rig in one process.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <thread>
#include <vector>

#include "core/frame/archive.h"
#include "core/service/service.h"
#include "tests/faults/capture/rig.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

using std::chrono::seconds;
using testing::AllOf;
using testing::HasSubstr;

v1::Plan plan_of(const std::vector<std::string>& cameras) {
  v1::Plan plan;
  plan.set_method("gaussian");
  for (const double light : {0.0, 1.0}) {
    v1::Solid& solid = *plan.add_solids();
    for (int c = 0; c < 3; ++c) solid.add_colour(light);
  }
  plan.mutable_square_waves()->set_levels(4);
  v1::Sweep& sweep = *plan.add_sweeps();
  sweep.set_sigma_px(6.0);
  plan.add_exposure_ms(FaultyRig::kExposure_ms);
  plan.set_hold_refreshes(6);
  plan.set_retries(100);
  if (cameras.size() == 1)
    plan.set_camera(cameras.front());
  else
    plan.mutable_cameras()->Assign(cameras.begin(), cameras.end());
  return plan;
}

std::vector<std::string> cameras(int count) {
  std::vector<std::string> names;
  for (int i = 1; i <= count; ++i) names.push_back(fmt::format("camera-{}", i));
  return names;
}

class CamerasTest : public testing::Test {
 protected:
  // `faults`: of the first camera and, in its list, of the others.
  void start(RigFaults faults, int patch_rows) {
    rig_ = std::make_unique<FaultyRig>(faults, 1, patch_rows, data_);
  }
  void TearDown() override { rig_ = nullptr; }

  grpc::Status create(const std::string& name, const v1::Plan& plan, v1::Session* session = nullptr) {
    v1::CreateSessionRequest request;
    request.set_request_id(fmt::format("{} {}", name, plan.camera()));
    request.set_name(name);
    *request.mutable_plan() = plan;
    v1::CreateSessionResponse created;
    grpc::ClientContext context;
    set_deadline(context, seconds(30));
    const grpc::Status status = rig_->sessions().CreateSession(&context, request, &created);
    if (session != nullptr) *session = created.session();
    return status;
  }

  v1::Session find(const std::string& name) {
    v1::GetSessionRequest request;
    request.set_name(name);
    v1::GetSessionResponse found;
    grpc::ClientContext context;
    set_deadline(context, seconds(10));
    EXPECT_OK(rig_->sessions().GetSession(&context, request, &found));
    return found.session();
  }

  using Stub = v1::SessionService::Stub;
  template <typename Request, typename Response>
  grpc::Status act(grpc::Status (Stub::*rpc)(grpc::ClientContext*, const Request&, Response*),
                   const std::string& name) {
    Request request;
    request.set_name(name);
    Response response;
    grpc::ClientContext context;
    set_deadline(context, seconds(30));
    return (rig_->sessions().*rpc)(&context, request, &response);
  }

  // The session when it rests.
  v1::Session captured(const std::string& name) {
    v1::WatchSessionRequest request;
    request.set_name(name);
    grpc::ClientContext context;
    set_deadline(context, seconds(120));
    const auto reader = rig_->sessions().WatchSession(&context, request);
    v1::WatchSessionResponse response;
    while (reader->Read(&response)) {
    }
    EXPECT_OK(reader->Finish());
    EXPECT_EQ(response.session().state(), v1::SESSION_STATE_CAPTURED) << response.session().reason();
    return response.session();
  }

  // By step.
  std::map<int, Image16> frames(const std::string& session, int camera) const {
    const auto archive = Archive::open(rig_->archive(session, camera)).value();
    std::map<int, Image16> frames;
    const v1::CaptureManifest manifest = archive->manifest();
    for (const v1::Frame& frame : manifest.frames())
      frames[frame.step()] = decode_tiff(archive->read_frame_bytes(frame.file()).value()).value();
    return frames;
  }

  const TemporaryDirectory data_;
  std::unique_ptr<FaultyRig> rig_;
};

// Cameras with no noise, of which each sees something else (a gain, a place): what each of them stores
// together with the others is what it stores alone, bit for bit.
class SeveralCameras : public CamerasTest, public testing::WithParamInterface<int> {};

TEST_P(SeveralCameras, EachStoresWhatItStoresAlone) {
  const int count = GetParam();
  RigFaults faults{.name = "several", .noiseless = true};
  for (int i = 1; i < count; ++i) {
    faults.cameras.push_back({.name = "other", .noiseless = true});
    faults.cameras.back().disturbances.gain = 1.0 - 0.1 * i;
  }
  start(faults, 0);
  v1::Session created;
  ASSERT_OK(create("s", plan_of(cameras(count)), &created));
  EXPECT_EQ(created.name(), "s");
  EXPECT_EQ(created.views_size(), count);
  const v1::Session together = captured("s");
  ASSERT_EQ(together.views_size(), count);
  EXPECT_EQ(together.proven_count(), together.step_count());
  for (int i = 0; i < count; ++i) {
    const std::string camera = cameras(count)[i];
    EXPECT_EQ(together.views(i).name(), "s." + camera);
    EXPECT_EQ(together.views(i).view_camera(), camera);
    EXPECT_EQ(together.views(i).state(), v1::SESSION_STATE_CAPTURED);
    ASSERT_OK(create("alone-" + camera, plan_of({camera})));
    (void)captured("alone-" + camera);
    const std::map<int, Image16> shared = frames("s." + camera, i), alone = frames("alone-" + camera, i);
    ASSERT_EQ(std::ssize(shared), together.step_count());
    ASSERT_EQ(shared.size(), alone.size());
    for (const auto& [step, image] : alone) {
      EXPECT_EQ(shared.at(step).samples, image.samples) << camera << ", step " << step;
    }
  }
  // They see different things, so that a mix-up would show.
  EXPECT_NE(frames("s.camera-1", 0).at(1).samples, frames("s.camera-2", 1).at(1).samples);
}

INSTANTIATE_TEST_SUITE_P(Cameras, SeveralCameras, testing::Values(2, 4));

TEST_F(CamerasTest, OneThatMissesStepsIsTheOnlyOneToRepeatThem) {
  RigFaults faults{.name = "missing"};
  // A frame in 8 ms, of which four in ten are lost, for a step of 25 ms.
  faults.cameras.push_back({.name = "drops", .drop = 0.4, .frame_rate_hz = 125.0});
  start(faults, 16);
  ASSERT_OK(create("s", plan_of(cameras(2))));
  const v1::Session session = captured("s");
  const auto causes = [](const v1::Session& view) {
    int count = 0;
    for (const v1::RetakeCount& retakes : view.retakes()) count += retakes.count();
    return count;
  };
  const v1::Session &steady = session.views(0), &missing = session.views(1);
  EXPECT_GE(missing.retaken_count(), 5);
  // Each step that the first is shown again is one that it has missed itself.
  EXPECT_LE(steady.retaken_count(), causes(steady));
  EXPECT_LT(causes(steady), causes(missing));
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(session.views(i).proven_count(), session.step_count());
    EXPECT_EQ(session.views(i).patch_proven_count(), session.step_count()) << "by the id patch too";
  }
}

TEST_F(CamerasTest, ANodeThatIsKilledCostsNothing) {
  RigFaults faults{.name = "killed"};
  faults.cameras.push_back({.name = "killed"});
  start(faults, 16);
  ASSERT_OK(create("s", plan_of(cameras(2))));
  const auto wait_proven = [&](int count) {
    while (find("s").proven_count() < count) std::this_thread::yield();
  };
  wait_proven(15);
  EXPECT_OK(act(&Stub::PauseSession, "s"));
  std::vector<std::map<int, std::string>> before(2);  // checksums by step
  const auto checksums = [&](int camera) {
    std::map<int, std::string> sums;
    const auto archive = Archive::open(rig_->archive(fmt::format("s.camera-{}", camera + 1), camera)).value();
    const v1::CaptureManifest manifest = archive->manifest();
    for (const v1::Frame& frame : manifest.frames()) sums[frame.step()] = frame.checksum();
    return sums;
  };
  for (int i = 0; i < 2; ++i) before[i] = checksums(i);
  EXPECT_OK(act(&Stub::ResumeSession, "s"));
  wait_proven(static_cast<int>(std::max(before[0].size(), before[1].size())) + 5);
  rig_->restart_camera(1);
  const v1::Session session = captured("s");
  EXPECT_EQ(session.proven_count(), session.step_count());
  for (int i = 0; i < 2; ++i) {
    const std::map<int, std::string> after = checksums(i);
    EXPECT_EQ(std::ssize(after), session.step_count());
    for (const auto& [step, checksum] : before[i])
      EXPECT_EQ(after.at(step), checksum) << "taken twice: " << step;
  }
}

TEST_F(CamerasTest, ASessionActsOnAllItsViews) {
  RigFaults faults{.name = "calls"};
  faults.cameras.push_back({.name = "calls"});
  start(faults, 16);
  ASSERT_OK(create("s", plan_of(cameras(2))));
  while (find("s").proven_count() < 5) std::this_thread::yield();
  const grpc::Status one = act(&Stub::PauseSession, "s.camera-2");
  EXPECT_THAT(one.error_message(), HasSubstr("name session \"s\""));
  EXPECT_OK(act(&Stub::PauseSession, "s"));
  for (const char* name : {"s", "s.camera-1", "s.camera-2"})
    EXPECT_EQ(find(name).state(), v1::SESSION_STATE_PAUSED) << name;
  // One of them may go on alone.
  EXPECT_OK(act(&Stub::ResumeSession, "s.camera-2"));
  (void)captured("s.camera-2");
  EXPECT_EQ(find("s").state(), v1::SESSION_STATE_PAUSED);
  EXPECT_OK(act(&Stub::ResumeSession, "s"));
  EXPECT_EQ(captured("s").proven_count(), find("s.camera-1").step_count());

  v1::ListSessionsResponse listed;
  grpc::ClientContext context;
  EXPECT_OK(rig_->sessions().ListSessions(&context, v1::ListSessionsRequest(), &listed));
  ASSERT_EQ(listed.sessions_size(), 1);
  EXPECT_EQ(listed.sessions(0).views_size(), 2);

  EXPECT_EQ(create("s", plan_of({"camera-1"})).error_code(), grpc::StatusCode::ALREADY_EXISTS);
  EXPECT_EQ(create("s.camera-1", plan_of({"camera-1"})).error_code(), grpc::StatusCode::ALREADY_EXISTS);
  v1::FetchMatteRequest fetch;
  fetch.set_name("s");
  grpc::ClientContext fetching;
  const auto reader = rig_->sessions().FetchMatte(&fetching, fetch);
  v1::FetchMatteResponse chunk;
  EXPECT_FALSE(reader->Read(&chunk));
  EXPECT_THAT(reader->Finish().error_message(),
              AllOf(HasSubstr("has 2 cameras"), HasSubstr("s.camera-1, s.camera-2")));

  EXPECT_OK(act(&Stub::DeleteSession, "s"));
  for (int i = 0; i < 2; ++i)
    EXPECT_FALSE(std::filesystem::exists(rig_->archive(fmt::format("s.camera-{}", i + 1), i)));
}

TEST_F(CamerasTest, PlansThatNameCamerasWronglyAreRefused) {
  start(RigFaults{.name = "refused"}, 16);
  const auto refusal = [&](const v1::Plan& plan) { return create("s", plan).error_message(); };
  EXPECT_THAT(refusal(plan_of({"camera-1", "camera-1"})), HasSubstr("cameras is \"camera-1\"; it must be"));
  EXPECT_THAT(refusal(plan_of({"camera-1", "camera-9"})), HasSubstr("camera node \"camera-9\" is not up"));
  v1::Plan both = plan_of({"camera-1", "camera-2"});
  both.set_camera("camera-1");
  EXPECT_THAT(refusal(both), HasSubstr("left out where cameras are given"));
}

}  // namespace
}  // namespace glasswing
