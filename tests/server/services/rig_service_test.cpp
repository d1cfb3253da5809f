// The server, a simulated display and a simulated camera in one process, over real channels.
#include "server/services/rig_service.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <filesystem>
#include <functional>
#include <future>
#include <latch>
#include <map>
#include <set>
#include <thread>

#include "camera-node/backends/emission_client.h"
#include "camera-node/backends/sim_camera.h"
#include "camera-node/services/camera_service.h"
#include "camera-node/services/stage_service.h"
#include "core/archive/archive_store.h"
#include "core/pattern/plan.h"
#include "core/service/registration.h"
#include "core/service/service.h"
#include "display-node/backends/light_tap.h"
#include "display-node/backends/sim_display.h"
#include "display-node/backends/sim_rail.h"
#include "display-node/services/display_service.h"
#include "display-node/services/emission_service.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/calibration_service.grpc.pb.h"
#include "server/selftest/sync_calibration.h"
#include "server/services/session_service.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

// Reports as much free space, and as fast a disk, as a test wants.
struct Disk final : v1::ArchiveService::Service {
  std::int64_t free_bytes = 1 << 30, write_bytes_per_second = 1 << 30;
  grpc::Status GetSpace(grpc::ServerContext*, const v1::GetSpaceRequest* request,
                        v1::GetSpaceResponse* response) override {
    response->set_free_bytes(free_bytes);
    if (request->measure_writing()) response->set_write_bytes_per_second(write_bytes_per_second);
    return grpc::Status::OK;
  }
};

// Fits for as long as a test wants.
struct SlowFits final : v1::CalibrationService::Service {
  std::latch begun{1}, may_end{1};
  grpc::Status FitCamera(grpc::ServerContext*, const v1::FitCameraRequest*, v1::FitCameraResponse*) override {
    begun.count_down();
    may_end.wait();
    return {grpc::StatusCode::FAILED_PRECONDITION, "the frames are dark"};
  }
};

// Moves as SimRail does; if it is held up, only once it is stopped, and in vain.
class HeldRail final : public Rail {
 public:
  HeldRail(LightTap& tap, std::atomic<bool>& held) : rail_(tap, 0, 200.0, PanelPose()), held_(held) {}
  absl::Status move(double position_mm, std::stop_token stop) override {
    if (!held_) return rail_.move(position_mm, stop);
    held_ = false;
    while (!stop.stop_requested()) std::this_thread::yield();
    return absl::FailedPreconditionError("ended before it had moved the monitor");
  }

 private:
  SimRail rail_;
  std::atomic<bool>& held_;
};

class RigTest : public testing::Test {
 protected:
  void start(const SimDisplay::Faults& faults = {}, const SensorCurve& response = {}) {
    server_ = Server::open({.data = data_ / "server"}).value();
    sessions_ = std::make_unique<SessionServiceImpl>(*server_);
    nodes_ = std::make_unique<NodeServiceImpl>(*server_);
    rig_ = std::make_unique<RigServiceImpl>(*server_);
    server_host_ = ServiceHost::start({}, {sessions_.get(), nodes_.get(), rig_.get()}).value();

    ScreenInfo screen{.name = "back", .width_px = 48, .height_px = 48};
    screen.refresh_hz = 60.0;
    screen.scanout = period_of(screen);
    screen.lag = milliseconds(5);
    screen.settle = milliseconds(1);
    display_ = std::make_unique<SimDisplay>(std::vector<ScreenInfo>{screen}, faults);
    tap_ = std::make_unique<LightTap>(*display_);
    std::vector<MonitorRail> rails;
    rails.push_back({.monitor = "back",
                     .min_mm = 200.0,
                     .max_mm = 400.0,
                     .position_mm = 200.0,
                     .rail = std::make_unique<HeldRail>(*tap_, rail_is_held_)});
    display_service_ = std::make_unique<DisplayServiceImpl>("display-1", *tap_, 0, std::move(rails));
    emission_ = std::make_unique<EmissionServiceImpl>(*tap_);
    display_host_ = ServiceHost::start({}, {display_service_.get(), emission_.get()}).value();

    SimCameraOptions options;
    options.scene = "none";
    options.width_px = 24;
    options.height_px = 24;
    options.sensor.curve = response;
    options.awaits_light = true;
    camera_ = SimCamera::create(options, timeline_).value();
    store_ = std::make_unique<ArchiveStore>(data_ / "camera");
    cameras_ = std::make_unique<CameraServiceImpl>(*camera_, *store_);
    camera_host_ = ServiceHost::start({}, {cameras_.get(), &disk_}).value();
    if (is_lit_) light_the_camera();

    for (const auto& [kind, name, address] :
         {std::tuple(v1::NODE_KIND_DISPLAY, "display-1", display_host_->address()),
          std::tuple(v1::NODE_KIND_CAMERA, "camera-1", camera_host_->address())}) {
      v1::RegisterRequest node;
      node.set_kind(kind);
      node.set_name(name);
      node.set_address(address);
      registrations_.push_back(std::make_unique<Registration>(server_host_->address(), node));
    }
    while (server_->rig().nodes().size() < 2) std::this_thread::yield();
    stub_ = v1::RigService::NewStub(dial(server_host_->address()));
  }
  void light_the_camera() {
    light_ = std::make_unique<EmissionClient>(display_host_->address(), timeline_);
    while (camera_->describe().has_preparation()) std::this_thread::yield();
  }
  void TearDown() override {
    registrations_.clear();
    sessions_->stop();
    rig_->stop();
    server_host_->stop(milliseconds(2000));
    cameras_->stop();
    camera_host_->stop(milliseconds(500));
    light_ = nullptr;
    display_service_->stop();
    emission_->stop();
    display_host_->stop(milliseconds(500));
  }

  struct Checked {
    grpc::Status status;
    std::map<std::string, std::vector<v1::Finding>> findings;  // by subject
    bool has(const std::string& subject, v1::FindingLevel level) const {
      const auto found = findings.find(subject);
      return found != findings.end() &&
             std::any_of(found->second.begin(), found->second.end(),
                         [&](const v1::Finding& finding) { return finding.level() == level; });
    }
    std::string text() const {
      std::string text;
      for (const auto& [subject, each] : findings) {
        for (const v1::Finding& finding : each) text += finding.ShortDebugString() + "\n";
      }
      return text;
    }
  };
  Checked check(const v1::Plan& plan = {}) {
    v1::CheckRigRequest request;
    *request.mutable_plan() = plan;
    grpc::ClientContext context;
    const auto reader = stub_->CheckRig(&context, request);
    Checked checked;
    for (v1::CheckRigResponse response; reader->Read(&response);)
      checked.findings[response.finding().subject()].push_back(response.finding());
    checked.status = reader->Finish();
    return checked;
  }

  const TemporaryDirectory data_;
  std::atomic<bool> rail_is_held_ = false;
  bool is_lit_ = true;  // from the start on
  EmissionTimeline timeline_;
  std::unique_ptr<Server> server_;
  std::unique_ptr<SessionServiceImpl> sessions_;
  std::unique_ptr<NodeServiceImpl> nodes_;
  std::unique_ptr<RigServiceImpl> rig_;
  std::unique_ptr<ServiceHost> server_host_;
  std::unique_ptr<SimDisplay> display_;
  std::unique_ptr<LightTap> tap_;
  std::unique_ptr<DisplayServiceImpl> display_service_;
  std::unique_ptr<EmissionServiceImpl> emission_;
  std::unique_ptr<ServiceHost> display_host_;
  std::unique_ptr<SimCamera> camera_;
  std::unique_ptr<ArchiveStore> store_;
  std::unique_ptr<CameraServiceImpl> cameras_;
  Disk disk_;
  std::unique_ptr<ServiceHost> camera_host_;
  std::unique_ptr<EmissionClient> light_;
  std::vector<std::unique_ptr<Registration>> registrations_;
  std::unique_ptr<v1::RigService::Stub> stub_;
};

TEST_F(RigTest, SyncIsMeasuredStoredAndHoldsTheRig) {
  start();
  v1::CalibrateSyncRequest request;
  grpc::ClientContext context;
  const auto reader = stub_->CalibrateSync(&context, request);
  v1::CalibrateSyncResponse response;
  ASSERT_TRUE(reader->Read(&response));
  EXPECT_FALSE(response.progress().empty());

  // The rig is taken meanwhile.
  {
    grpc::ClientContext other_context;
    const auto other = stub_->CalibrateSync(&other_context, request);
    v1::CalibrateSyncResponse none;
    EXPECT_FALSE(other->Read(&none));
    const grpc::Status refused = other->Finish();
    EXPECT_EQ(refused.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
    EXPECT_NE(refused.error_message().find("held by calibrate sync, started"), std::string::npos);
    EXPECT_EQ(check().status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
    v1::CreateSessionRequest create;
    create.mutable_plan()->set_method("gaussian");
    create.mutable_plan()->add_solids()->add_colour(1.0);
    for (int i = 0; i < 2; ++i) create.mutable_plan()->mutable_solids(0)->add_colour(1.0);
    EXPECT_TRUE(absl::IsFailedPrecondition(server_->captures().create(create, {}).status()));
  }
  while (!response.has_result() && reader->Read(&response)) {
  }
  const grpc::Status status = reader->Finish();
  ASSERT_OK(status);
  const v1::MonitorSync sync = response.result();
  EXPECT_EQ(sync.monitor(), "back");
  // The goal for a measured lag: 0.3 ms.
  EXPECT_NEAR(static_cast<double>(sync.lag_ns()), 5e6, 0.3e6);
  EXPECT_NEAR(static_cast<double>(sync.scanout_ns()), 1e9 / 60.0, 0.6e6);
  EXPECT_LT(sync.error_ns(), 150'000);
  EXPECT_FALSE(sync.measured().empty());

  Problems problems;
  const auto again = CalibrationStore::open(data_ / "server", problems);
  ASSERT_OK(again);
  EXPECT_EQ((*again)->sync("back")->SerializeAsString(), sync.SerializeAsString());
  const Checked checked = check();
  ASSERT_OK(checked.status);
  EXPECT_TRUE(checked.has("sync", v1::FINDING_LEVEL_OK)) << checked.text();
}

TEST_F(RigTest, AHoldLastsAsLongAsItsCall) {
  start();
  grpc::ClientContext context;
  context.AddMetadata("glasswing-client", "anna@lab3");
  v1::HoldRigRequest request;
  request.set_reason("turntable series");
  const auto reader = stub_->HoldRig(&context, request);
  v1::HoldRigResponse held;
  ASSERT_TRUE(reader->Read(&held));

  // A call without the token is refused and names the holder; one with it may use the rig.
  const Checked refused = check();
  EXPECT_EQ(refused.status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_NE(refused.status.error_message().find("\"turntable series\", taken by anna@lab3"),
            std::string::npos)
      << refused.status.error_message();
  v1::ListNodesResponse listed;
  {
    grpc::ClientContext list;
    ASSERT_OK(v1::NodeService::NewStub(dial(server_host_->address()))->ListNodes(&list, {}, &listed));
  }
  EXPECT_EQ(listed.holder().client(), "anna@lab3");
  EXPECT_EQ(listed.holder().what(), "turntable series");
  {
    grpc::ClientContext with_token;
    with_token.AddMetadata("glasswing-hold", held.token());
    const auto other = stub_->CheckRig(&with_token, {});
    for (v1::CheckRigResponse finding; other->Read(&finding);) {
    }
    const grpc::Status status = other->Finish();
    EXPECT_OK(status);
  }
  context.TryCancel();
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::CANCELLED);
  while (server_->rig_lock().holder()) std::this_thread::yield();
  EXPECT_OK(check().status);
}

TEST_F(RigTest, PlansAreMadeForTheRig) {
  start();
  const auto make = [&](v1::PlanPurpose purpose,
                        const std::function<void(v1::MakePlanRequest&)>& change = {}) {
    v1::MakePlanRequest request;
    request.set_purpose(purpose);
    if (change) change(request);
    grpc::ClientContext context;
    v1::MakePlanResponse made;
    const grpc::Status status = stub_->MakePlan(&context, request, &made);
    return status.ok()
               ? absl::StatusOr<v1::MakePlanResponse>(made)
               : absl::Status(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
  };
  const auto draft = make(v1::PLAN_PURPOSE_CAPTURE, [](auto& request) { request.set_quality("draft"); });
  ASSERT_OK(draft);
  EXPECT_EQ(draft->plan().monitors(0).name(), "back");
  const v1::Plan read = parse_plan(draft->text(), "draft").value();
  EXPECT_EQ(read.SerializeAsString(), draft->plan().SerializeAsString());
  const auto camera = make(v1::PLAN_PURPOSE_CALIBRATE_CAMERA);
  ASSERT_OK(camera);
  EXPECT_EQ(camera->plan().calibration().of(), "camera");
  EXPECT_EQ(make(v1::PLAN_PURPOSE_UNSPECIFIED).status().code(), absl::StatusCode::kInvalidArgument);
  const auto roof = make(v1::PLAN_PURPOSE_CAPTURE, [](auto& request) { request.add_monitors("roof"); });
  EXPECT_EQ(roof.status().message(), "there is no monitor \"roof\"; there are: back");
  EXPECT_EQ(
      make(v1::PLAN_PURPOSE_CAPTURE, [](auto& request) { request.set_quality("fine"); }).status().message(),
      "quality is \"fine\"; it must be draft, good or best");
  const auto metal = make(v1::PLAN_PURPOSE_CAPTURE, [](auto& request) { request.set_object("metal"); });
  ASSERT_OK(metal);
  EXPECT_EQ(metal->plan().exposure_ms_size(), 2);
  EXPECT_EQ(
      make(v1::PLAN_PURPOSE_CAPTURE, [](auto& request) { request.set_object("wood"); }).status().message(),
      "object is \"wood\"; it must be clear, frosted, metal or dark");
}

TEST_F(RigTest, AFitIsListedWhileItRunsAndRunsOnce) {
  start();
  SlowFits fits;
  const auto node = ServiceHost::start({}, {&fits}).value();
  v1::Session session;
  session.set_name("lens");
  session.set_state(v1::SESSION_STATE_CAPTURED);
  session.set_archive_address(node->address());
  session.mutable_plan()->mutable_calibration()->set_of("camera");
  ASSERT_OK(server_->sessions().edit().insert(session, ""));
  const auto fit = [&] {
    grpc::ClientContext context;
    v1::FitCalibrationRequest request;
    request.set_session("lens");
    v1::FitCalibrationResponse fitted;
    return stub_->FitCalibration(&context, request, &fitted).error_message();
  };
  const auto running = [&] {
    grpc::ClientContext context;
    v1::ListCalibrationsResponse listed;
    EXPECT_OK(stub_->ListCalibrations(&context, {}, &listed));
    return listed;
  };
  std::string first;
  std::thread caller([&] { first = fit(); });
  fits.begun.wait();
  const v1::ListCalibrationsResponse listed = running();
  const std::string second = fit();
  fits.may_end.count_down();
  caller.join();
  ASSERT_EQ(listed.fits_size(), 1);
  EXPECT_EQ(listed.fits(0).session(), "lens");
  EXPECT_EQ(second, "session \"lens\" is already being fitted, since " + listed.fits(0).since() +
                        "; wait until that is done");
  EXPECT_EQ(first, "the frames are dark");
  EXPECT_EQ(running().fits_size(), 0) << "a fit that failed is over, too";
}

TEST_F(RigTest, AHoldCanBeTakenUpAgainAndReleased) {
  start();
  const auto hold = [&](grpc::ClientContext& context, int linger_s, const std::string& token) {
    if (!token.empty()) context.AddMetadata("glasswing-hold", token);
    v1::HoldRigRequest request;
    request.set_reason("turntable series");
    request.set_linger_s(linger_s);
    return stub_->HoldRig(&context, request);
  };
  v1::HoldRigResponse held, again;
  {
    grpc::ClientContext context;
    EXPECT_EQ(hold(context, 61, "")->Finish().error_message(), "linger_s is 61; it must be 0 to 60");
  }
  {
    grpc::ClientContext context;
    ASSERT_TRUE(hold(context, 60, "")->Read(&held));
    context.TryCancel();  // as a page that is loaded again
  }
  grpc::ClientContext context;
  const auto reader = hold(context, 60, held.token());
  ASSERT_TRUE(reader->Read(&again));
  EXPECT_EQ(again.token(), held.token());
  EXPECT_EQ(check().status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);

  v1::ReleaseRigResponse released;
  {
    grpc::ClientContext without;
    EXPECT_EQ(stub_->ReleaseRig(&without, {}, &released).error_message(),
              "this call does not belong to a hold: only the holder of the rig can release it");
  }
  grpc::ClientContext with_token;
  with_token.AddMetadata("glasswing-hold", held.token());
  EXPECT_OK(stub_->ReleaseRig(&with_token, {}, &released));
  EXPECT_FALSE(reader->Read(&again));
  EXPECT_OK(reader->Finish());
  EXPECT_OK(check().status);
}

TEST_F(RigTest, TheDoctorSaysWhatTheCameraPreparesAndWaitsForIt) {
  is_lit_ = false;
  start();
  grpc::ClientContext context;
  const auto reader = stub_->CheckRig(&context, v1::CheckRigRequest());
  v1::CheckRigResponse response;
  while (response.finding().subject() != "camera")
    ASSERT_TRUE(reader->Read(&response)) << reader->Finish().error_message();
  EXPECT_EQ(response.finding().level(), v1::FINDING_LEVEL_WARNING);
  EXPECT_EQ(response.finding().text(), "camera-1 is not ready: waiting for the monitors' light");
  light_the_camera();
  std::set<std::string> subjects;
  while (reader->Read(&response)) {
    subjects.insert(response.finding().subject());
    EXPECT_EQ(response.finding().text().find("client"), std::string::npos);
  }
  const grpc::Status status = reader->Finish();
  EXPECT_OK(status);
  for (const char* subject : {"flips", "camera", "proof"}) EXPECT_TRUE(subjects.contains(subject)) << subject;
}

TEST_F(RigTest, ATestPatternStandsForAsLongAsItsCall) {
  start();
  const auto camera = v1::CameraService::NewStub(dial(camera_host_->address()));
  const auto mean_light = [&] {
    grpc::ClientContext context;
    v1::PreviewRequest request;
    request.set_max_fps(10.0);
    request.set_max_width_px(16);
    const auto reader = camera->Preview(&context, request);
    v1::PreviewResponse picture;
    EXPECT_TRUE(reader->Read(&picture));
    context.TryCancel();
    return picture.mean();
  };
  double mean[2] = {};
  for (const bool white : {false, true}) {
    grpc::ClientContext context;
    v1::ShowPatternRequest request;
    request.set_pattern(white ? "white" : "black");
    const auto reader = stub_->ShowPattern(&context, request);
    v1::ShowPatternResponse shown;
    ASSERT_TRUE(reader->Read(&shown)) << reader->Finish().error_message();
    EXPECT_EQ(shown.monitors_size(), 1);
    EXPECT_EQ(check().status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
    mean[white] = mean_light();
    context.TryCancel();
    EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::CANCELLED);
    while (server_->rig_lock().holder()) std::this_thread::yield();
  }
  EXPECT_LT(mean[0], 0.05);
  EXPECT_GT(mean[1], mean[0] + 0.2);
}

TEST_F(RigTest, WhatIsNoPatternOrMonitorIsRefused) {
  start();
  const auto outcome = [&](const std::string& pattern, const std::string& monitor) {
    grpc::ClientContext context;
    v1::ShowPatternRequest request;
    request.set_pattern(pattern);
    if (!monitor.empty()) request.add_monitors(monitor);
    return stub_->ShowPattern(&context, request)->Finish();
  };
  EXPECT_EQ(outcome("plaid", "").error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(outcome("white", "nowhere").error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(RigTest, ACaptureThatDoesNotFitIsRefusedBeforeItBegins) {
  start();
  v1::EstimateSessionRequest request;
  request.mutable_plan()->set_method("gaussian");
  request.mutable_plan()->add_sweeps()->set_sigma_px(8.0);
  const absl::StatusOr<v1::EstimateSessionResponse> estimate = server_->captures().estimate(request);
  ASSERT_OK(estimate);
  EXPECT_EQ(estimate->free_bytes(), disk_.free_bytes);
  disk_.free_bytes = estimate->bytes();
  EXPECT_OK(server_->captures().estimate(request));
  disk_.free_bytes -= 1;
  v1::CreateSessionRequest create;
  *create.mutable_plan() = request.plan();
  for (const absl::Status& status :
       {server_->captures().estimate(request).status(), server_->captures().create(create, {}).status()}) {
    EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
    EXPECT_NE(status.message().find("camera node \"camera-1\""), std::string::npos) << status;
  }
  EXPECT_TRUE(server_->list({})->empty());
}

TEST_F(RigTest, ADiskThatIsTooSlowIsToldBeforeItLosesFrames) {
  start();
  v1::EstimateSessionRequest request;
  request.mutable_plan()->set_method("gaussian");
  v1::Sweep& sweep = *request.mutable_plan()->add_sweeps();
  sweep.set_sigma_px(8.0);
  sweep.set_step_px(0.05);
  const auto warning = [&]() -> std::string {
    const absl::StatusOr<v1::EstimateSessionResponse> estimate = server_->captures().estimate(request);
    EXPECT_OK(estimate);
    for (const std::string& each : estimate->warnings()) {
      if (each.find("MB/s") != std::string::npos) return each;
    }
    return "";
  };
  EXPECT_EQ(warning(), "");
  const v1::EstimateSessionResponse estimate = server_->captures().estimate(request).value();
  const double bytes = static_cast<double>(estimate.bytes()), frame_bytes = bytes / estimate.step_count();
  ASSERT_GT(estimate.step_count(), 600) << "more frames than the ring holds";
  // So slow that one frame more than the ring holds waits at the end.
  const double slow = (bytes - 601.0 * frame_bytes) / estimate.seconds();
  disk_.write_bytes_per_second = static_cast<std::int64_t>(slow);
  EXPECT_NE(warning().find("disk of the camera node \"camera-1\""), std::string::npos) << warning();
  const auto hold = static_cast<int>(std::ceil(2.0 * bytes / estimate.seconds() / std::floor(slow)));
  EXPECT_NE(warning().find(fmt::format("hold_refreshes: {} ", hold)), std::string::npos) << warning();
  disk_.write_bytes_per_second =
      static_cast<std::int64_t>((bytes - 599.0 * frame_bytes) / estimate.seconds());
  EXPECT_EQ(warning(), "");
}

// The calibration that inverts a simulated camera's curve.
v1::CameraCalibration calibration_of(const SensorCurve& response) {
  const auto coded = [&](double linear) {
    const double u = std::pow(linear, double{response.exponent});
    return (1.0 - response.contrast) * u + response.contrast * (3.0 - 2.0 * u) * u * u;
  };
  v1::CameraCalibration calibration;
  calibration.set_format_version(1);
  calibration.set_camera("camera-1");
  calibration.set_saturation(1.0);
  v1::CameraCurve curve;
  constexpr int kLast = 4095;
  for (int k = 0; k <= kLast; ++k) {
    double low = 0.0, high = 1.0;
    for (int halving = 0; halving < 60; ++halving) {
      const double middle = 0.5 * (low + high);
      (coded(middle) < static_cast<double>(k) / kLast ? low : high) = middle;
    }
    curve.add_light(static_cast<float>(0.5 * (low + high)));
  }
  for (int c = 0; c < 3; ++c) *calibration.add_curves() = curve;
  return calibration;
}

TEST_F(RigTest, SyncIsMeasuredInTheLightThatACalibrationTells) {
  const SensorCurve s_curve{.exponent = 1.0f / 2.2f, .contrast = 0.5f};
  start({}, s_curve);
  RigLinks rig = connect(server_->rig(), server_->calibrations(), "", {}).value();
  const v1::CameraCalibration calibration = calibration_of(s_curve);
  const absl::StatusOr<v1::MonitorSync> sync =
      measure_sync(rig, "back", 0.0, &calibration, [](const std::string&) {}, {});
  ASSERT_OK(sync);
  // The goals of a linear camera; uncalibrated codes are off by more.
  EXPECT_NEAR(static_cast<double>(sync->lag_ns()), 5e6, 0.3e6);
  EXPECT_NEAR(static_cast<double>(sync->settle_ns()), 1e6, 0.6e6);
  v1::CameraCalibration broken = calibration;
  broken.mutable_curves()->RemoveLast();
  EXPECT_EQ(measure_sync(rig, "back", 0.0, &broken, [](const std::string&) {}, {}).status().code(),
            absl::StatusCode::kInvalidArgument);
}

TEST_F(RigTest, WhatCannotBeMeasuredIsRefused) {
  start();
  const auto refusal = [this](const std::string& monitor, double exposure_ms) {
    v1::CalibrateSyncRequest request;
    request.add_monitors(monitor);
    request.set_exposure_ms(exposure_ms);
    grpc::ClientContext context;
    const auto reader = stub_->CalibrateSync(&context, request);
    for (v1::CalibrateSyncResponse response; reader->Read(&response);) {
    }
    return reader->Finish();
  };
  const grpc::Status nobody = refusal("front", 0.0);
  EXPECT_EQ(nobody.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_NE(nobody.error_message().find("there are: back"), std::string::npos) << nobody.error_message();
  EXPECT_EQ(refusal("back", 4000.0).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(RigTest, AGoodRigHasNoProblem) {
  start();
  const Checked checked = check();
  ASSERT_OK(checked.status);
  for (const std::string subject :
       {"nodes", "clocks", "monitors", "camera", "window", "flips", "proof", "sync"}) {
    EXPECT_TRUE(checked.findings.contains(subject)) << subject;
    EXPECT_FALSE(checked.has(subject, v1::FINDING_LEVEL_PROBLEM)) << checked.text();
  }
}

TEST_F(RigTest, ABadRigIsNamed) {
  start({.seed = 3, .missed_flips = 0.4});
  v1::Plan plan;
  plan.add_exposure_ms(1.0);
  EXPECT_TRUE(check(plan).has("flips", v1::FINDING_LEVEL_PROBLEM)) << check(plan).text();
  plan.set_exposure_ms(0, 4000.0);
  EXPECT_TRUE(check(plan).has("camera", v1::FINDING_LEVEL_PROBLEM)) << check(plan).text();
  plan.clear_exposure_ms();
  plan.add_monitors()->set_name("front");
  EXPECT_TRUE(check(plan).has("monitors", v1::FINDING_LEVEL_PROBLEM)) << check(plan).text();
  registrations_.pop_back();
  plan.Clear();
  plan.set_method("magic");
  EXPECT_EQ(check(plan).status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(RigTest, PlacesAMonitorOnItsRail) {
  start();
  const auto place = [&](const std::string& monitor, double position_mm, const std::string& hold = "") {
    grpc::ClientContext context;
    set_deadline(context, milliseconds(20'000));
    if (!hold.empty()) context.AddMetadata("glasswing-hold", hold);
    v1::PlaceMonitorRequest request;
    request.set_monitor(monitor);
    request.set_position_mm(position_mm);
    v1::PlaceMonitorResponse response;
    const absl::Status status = from_grpc(stub_->PlaceMonitor(&context, request, &response));
    EXPECT_EQ(response.position_mm(), status.ok() ? position_mm : 0.0);
    return status;
  };
  EXPECT_OK(place("back", 250.0));
  // The camera knows it from the light alone.
  while (timeline_.monitors().at(0).pose != PanelPose{.away_mm = 50.0}) std::this_thread::yield();
  EXPECT_TRUE(absl::IsInvalidArgument(place("side", 250.0)));
  EXPECT_TRUE(absl::IsInvalidArgument(place("back", 500.0)));

  grpc::ClientContext holding;
  v1::HoldRigRequest hold;
  hold.set_reason("two depths");
  const auto reader = stub_->HoldRig(&holding, hold);
  v1::HoldRigResponse held;
  ASSERT_TRUE(reader->Read(&held));
  const absl::Status refused = place("back", 300.0);
  EXPECT_TRUE(absl::IsFailedPrecondition(refused)) << refused;
  EXPECT_NE(std::string(refused.message()).find("two depths"), std::string::npos) << refused;
  EXPECT_OK(place("back", 300.0, held.token()));
  holding.TryCancel();
  (void)reader->Finish();
}

TEST_F(RigTest, ACancelledMoveFreesTheRig) {
  start();
  rail_is_held_ = true;
  grpc::ClientContext cancelled, next;
  set_deadline(cancelled, milliseconds(20'000));
  set_deadline(next, milliseconds(20'000));
  v1::PlaceMonitorRequest request;
  request.set_monitor("back");
  request.set_position_mm(250.0);
  auto moved = std::async(std::launch::async, [&] {
    v1::PlaceMonitorResponse response;
    return stub_->PlaceMonitor(&cancelled, request, &response).error_code();
  });
  while (rail_is_held_) std::this_thread::yield();  // until it moves
  cancelled.TryCancel();
  EXPECT_EQ(moved.get(), grpc::StatusCode::CANCELLED);
  while (server_->rig_lock().holder()) std::this_thread::yield();
  v1::PlaceMonitorResponse response;
  request.set_position_mm(300.0);
  EXPECT_EQ(from_grpc(stub_->PlaceMonitor(&next, request, &response)), absl::OkStatus());
  EXPECT_EQ(response.position_mm(), 300.0);
}

}  // namespace
}  // namespace glasswing
