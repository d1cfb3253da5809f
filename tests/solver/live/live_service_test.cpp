// The whole path of a live composite in one process, over real channels: a simulated monitor and camera with
// a wobbling drop, the server that shows the ramp, and the solver.
#include "solver/live/live_service.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <optional>

#include "camera-node/backends/emission_client.h"
#include "camera-node/backends/sim_camera.h"
#include "camera-node/services/camera_service.h"
#include "camera-node/services/stage_service.h"
#include "core/archive/archive_service.h"
#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/service/registration.h"
#include "core/service/service.h"
#include "core/sim/scene.h"
#include "display-node/backends/light_tap.h"
#include "display-node/backends/sim_display.h"
#include "display-node/services/display_service.h"
#include "display-node/services/emission_service.h"
#include "server/services/rig_service.h"
#include "server/services/session_service.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

constexpr int kWidth_px = 320, kHeight_px = 240;

// Long waves: the effect of a position error of one pixel is known.
RadianceImage waves() {
  RadianceImage picture(kWidth_px, kHeight_px);
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      const double u = (x + 0.5) / 160.0, v = (y + 0.5) / 160.0;
      const auto wave = [](double turns) {
        return static_cast<float>(0.5 + 0.3 * std::cos(2.0 * std::numbers::pi * turns));
      };
      picture.at(x, y, 0) = wave(u);
      picture.at(x, y, 1) = wave(v);
      picture.at(x, y, 2) = wave(u + v);
    }
  }
  return picture;
}

class LiveTest : public testing::Test {
 protected:
  void start(bool solver_listens = true) {
    server_ = Server::open({.data = data_ / "server"}).value();
    sessions_ = std::make_unique<SessionServiceImpl>(*server_);
    nodes_ = std::make_unique<NodeServiceImpl>(*server_);
    rig_ = std::make_unique<RigServiceImpl>(*server_);
    server_host_ = ServiceHost::start({}, {sessions_.get(), nodes_.get(), rig_.get()}).value();

    ScreenInfo screen{.name = "back", .width_px = kWidth_px, .height_px = kHeight_px};
    screen.refresh_hz = 60.0;
    screen.scanout = period_of(screen);
    display_ = std::make_unique<SimDisplay>(std::vector<ScreenInfo>{screen}, SimDisplay::Faults{});
    tap_ = std::make_unique<LightTap>(*display_);
    display_service_ = std::make_unique<DisplayServiceImpl>("display-1", *tap_);
    emission_ = std::make_unique<EmissionServiceImpl>(*tap_);
    display_host_ = ServiceHost::start({}, {display_service_.get(), emission_.get()}).value();

    SimCameraOptions options;
    options.scene = "wobble";
    options.width_px = kWidth_px;
    options.height_px = kHeight_px;
    options.frame_rate_hz = 30.0;
    options.clock = NodeClock(std::chrono::hours(5), 0.0);
    camera_ = SimCamera::create(options, timeline_).value();
    store_ = std::make_unique<ArchiveStore>(data_ / "camera");
    cameras_ = std::make_unique<CameraServiceImpl>(*camera_, *store_);
    stage_ = std::make_unique<StageServiceImpl>(*camera_);
    camera_host_ = ServiceHost::start({.clock = options.clock}, {cameras_.get(), stage_.get()}).value();
    light_ = std::make_unique<EmissionClient>(display_host_->address(), timeline_);
    while (timeline_.monitors().empty()) std::this_thread::yield();

    live_ = std::make_unique<LiveServiceImpl>(2);
    solver_host_ = ServiceHost::start({}, {live_.get()}).value();
    for (const auto& [kind, name, address] :
         {std::tuple(v1::NODE_KIND_DISPLAY, "display-1", display_host_->address()),
          std::tuple(v1::NODE_KIND_CAMERA, "camera-1", camera_host_->address()),
          std::tuple(v1::NODE_KIND_SOLVER, "solver-1",
                     solver_listens ? solver_host_->address() : std::string())}) {
      v1::RegisterRequest node;
      node.set_kind(kind);
      node.set_name(name);
      node.set_address(address);
      registrations_.push_back(std::make_unique<Registration>(server_host_->address(), node));
    }
    while (server_->rig().nodes().size() < 3) std::this_thread::yield();
    rig_stub_ = v1::RigService::NewStub(dial(server_host_->address()));
    live_stub_ = v1::LiveService::NewStub(dial(solver_host_->address()));
  }
  void TearDown() override {
    registrations_.clear();
    live_->stop();
    solver_host_->stop(milliseconds(2000));
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
  // The rig is released shortly after the call that holds it ends.
  bool becomes_free() {
    const nanoseconds until = monotonic_now() + std::chrono::seconds(20);
    while (monotonic_now() < until) {
      if (server_->rig_lock().drive({}, "a test").ok()) return true;
      std::this_thread::yield();
    }
    return false;
  }

  const TemporaryDirectory data_;
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
  std::unique_ptr<StageServiceImpl> stage_;
  std::unique_ptr<ServiceHost> camera_host_;
  std::unique_ptr<EmissionClient> light_;
  std::unique_ptr<LiveServiceImpl> live_;
  std::unique_ptr<ServiceHost> solver_host_;
  std::vector<std::unique_ptr<Registration>> registrations_;
  std::unique_ptr<v1::RigService::Stub> rig_stub_;
  std::unique_ptr<v1::LiveService::Stub> live_stub_;
};

using RampStream = grpc::ClientReaderWriter<v1::ShowRampRequest, v1::ShowRampResponse>;
using LiveStream = grpc::ClientReaderWriter<v1::RunLiveRequest, v1::RunLiveResponse>;

std::optional<v1::ShowRampResponse> ask(RampStream& ramp, bool object) {
  v1::ShowRampRequest request;
  request.set_object(object);
  v1::ShowRampResponse response;
  if (!ramp.Write(request) || !ramp.Read(&response)) return std::nullopt;
  return response;
}

v1::RunLiveRequest start_of(const v1::ShowRampResponse& rig) {
  v1::RunLiveRequest request;
  v1::LiveStart& start = *request.mutable_start();
  start.set_camera_address(rig.camera_address());
  start.set_exposure_ms(4.0);
  *start.mutable_monitor() = rig.monitor();
  return request;
}

v1::RunLiveRequest picture_of(const RadianceImage& picture) {
  const fs::path file =
      fs::path(testing::TempDir()) / ("live_picture." + std::to_string(::getpid()) + ".png");
  EXPECT_OK(write_radiance(file, picture, Encoding::kDisplay));
  v1::RunLiveRequest request;
  request.set_picture(read_file(file).value());
  request.set_picture_ends(true);
  fs::remove(file);
  return request;
}

// The error of composites relative to the simulated camera's view of the background, radiance.
struct Errors {
  std::vector<float> object, stage;
  float median(std::vector<float> Errors::*part) {
    std::vector<float>& errors = this->*part;
    std::ranges::nth_element(errors, errors.begin() + errors.size() / 2);
    return errors[errors.size() / 2];
  }
};

TEST_F(LiveTest, CompositesAreWhatTheCameraWouldSee) {
  start();
  const RadianceImage background = waves();
  grpc::ClientContext ramp_context, live_context;
  const auto ramp = rig_stub_->ShowRamp(&ramp_context);
  const std::optional<v1::ShowRampResponse> rig = ask(*ramp, false);
  ASSERT_TRUE(rig) << ramp->Finish().error_message();
  EXPECT_EQ(rig->monitor().name(), "back");
  EXPECT_FALSE(rig->needs_operator());
  EXPECT_EQ(server_->rig_lock().drive({}, "a test").status().code(), absl::StatusCode::kFailedPrecondition);

  const auto live = live_stub_->RunLive(&live_context);
  ASSERT_TRUE(live->Write(start_of(*rig)));
  ASSERT_TRUE(live->Write(picture_of(background)));
  v1::RunLiveResponse response;
  int left = -1;
  while (left != 0) {
    ASSERT_TRUE(live->Read(&response)) << live->Finish().error_message();
    ASSERT_FALSE(response.has_frame());
    EXPECT_TRUE(left < 0 || response.empty_frames_left() == left - 1);
    left = response.empty_frames_left();
  }
  const StageTransports stage =
      build_phases("wobble", {{"back", {kWidth_px, kHeight_px}}}, kWidth_px, kHeight_px).value();
  for (const bool object : {false, true}) {
    ASSERT_TRUE(ask(*ramp, object));
    const nanoseconds moved = NodeClock(std::chrono::hours(5), 0.0).now();
    Errors errors;
    std::int64_t last = -1;
    for (int frames = 0; frames < 6;) {
      ASSERT_TRUE(live->Read(&response)) << live->Finish().error_message();
      const v1::LiveFrame& frame = response.frame();
      ASSERT_EQ(frame.picture().size(), static_cast<size_t>(kWidth_px * kHeight_px * 3));
      EXPECT_GT(frame.taken().sequence(), last);
      last = frame.taken().sequence();
      if (nanoseconds(frame.taken().exposure_start_ns()) < moved) continue;
      ++frames;
      const int phase = motion_of("wobble").phase_at(
          nanoseconds((frame.taken().exposure_start_ns() + frame.taken().exposure_end_ns()) / 2));
      const Transport& through = object ? *stage.phases[phase] : *stage.empty;
      const RadianceImage truth = through.respond(std::vector<RadianceImage>{background});
      for (size_t i = 0; i < truth.samples.size(); ++i) {
        const float light =
            linear_of_srgb(static_cast<float>(static_cast<std::uint8_t>(frame.picture()[i])) / 255.0f);
        const auto taps =
            through.taps(static_cast<int>(i / 3) % kWidth_px, static_cast<int>(i / 3) / kWidth_px, 0);
        const bool is_stage = taps.size() == 1 && taps[0].weight == 1.0f;
        (is_stage ? errors.stage : errors.object).push_back(std::abs(light - truth.samples[i]));
      }
    }
    // A code of 8 bits, of the background and of the composite, is up to 0.007 here.
    EXPECT_LT(errors.median(&Errors::stage), 0.007f);
    if (!object) {
      EXPECT_TRUE(errors.object.empty());
      continue;
    }
    // A sample's noise of up to 0.0035 is a pixel of the ramp, which goes from 0 to 1 in 320; the waves
    // change by up to 0.012 a pixel.
    EXPECT_LT(errors.median(&Errors::object), 0.007f + 0.012f);
    EXPECT_GT(errors.object.size(), errors.stage.size() / 20);
  }
  live_context.TryCancel();
  ramp_context.TryCancel();
  EXPECT_TRUE(becomes_free());
}

TEST_F(LiveTest, RefusesWhatCannotBe) {
  start();
  const auto status_of = [&](const v1::RunLiveRequest& first,
                             const std::optional<v1::RunLiveRequest>& second) {
    grpc::ClientContext context;
    const auto live = live_stub_->RunLive(&context);
    live->Write(first);
    if (second) live->Write(*second);
    // The server ends the call before this side does.
    for (v1::RunLiveResponse response; live->Read(&response);) {
    }
    return live->Finish();
  };
  const auto refused = [&](const std::string& monitor) {
    grpc::ClientContext context;
    const auto ramp = rig_stub_->ShowRamp(&context);
    v1::ShowRampRequest request;
    request.set_monitor(monitor);
    ramp->Write(request);
    v1::ShowRampResponse response;
    EXPECT_FALSE(ramp->Read(&response));
    return ramp->Finish();
  };
  const grpc::Status unknown = refused("front");
  EXPECT_EQ(unknown.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_NE(unknown.error_message().find("there are: back"), std::string::npos) << unknown.error_message();

  EXPECT_EQ(status_of({}, {}).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  grpc::ClientContext ramp_context;
  const auto ramp = rig_stub_->ShowRamp(&ramp_context);
  const std::optional<v1::ShowRampResponse> rig = ask(*ramp, false);
  ASSERT_TRUE(rig);
  v1::RunLiveRequest bad = start_of(*rig);
  (*bad.mutable_start()->mutable_options())["no_such_option"] = "1";
  EXPECT_EQ(status_of(bad, {}).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  bad = start_of(*rig);
  bad.mutable_start()->set_exposure_ms(5000.0);
  EXPECT_EQ(status_of(bad, {}).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  v1::RunLiveRequest no_picture;
  no_picture.set_picture("no picture");
  no_picture.set_picture_ends(true);
  EXPECT_EQ(status_of(start_of(*rig), no_picture).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  // The monitors are black: no ramp.
  ramp_context.TryCancel();
  ASSERT_TRUE(becomes_free());
  // Some or all of the first frames may still show the ramp: then later ones are refused.
  const grpc::Status dark = status_of(start_of(*rig), picture_of(waves()));
  EXPECT_EQ(dark.error_code(), grpc::StatusCode::FAILED_PRECONDITION) << dark.error_message();
}

TEST_F(LiveTest, ServesOneAtATimeAndSaysWhenTheCameraGoes) {
  start();
  grpc::ClientContext ramp_context, live_context;
  const auto ramp = rig_stub_->ShowRamp(&ramp_context);
  const std::optional<v1::ShowRampResponse> rig = ask(*ramp, false);
  ASSERT_TRUE(rig);
  const auto live = live_stub_->RunLive(&live_context);
  ASSERT_TRUE(live->Write(start_of(*rig)));
  ASSERT_TRUE(live->Write(picture_of(waves())));
  v1::RunLiveResponse response;
  ASSERT_TRUE(live->Read(&response));
  {
    grpc::ClientContext other_context;
    const auto other = live_stub_->RunLive(&other_context);
    v1::RunLiveResponse none;
    EXPECT_FALSE(other->Read(&none));
    EXPECT_EQ(other->Finish().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  }
  do {
    ASSERT_TRUE(live->Read(&response));
  } while (!response.has_frame());
  cameras_->stop();
  while (live->Read(&response)) {
  }
  const grpc::Status ended = live->Finish();
  EXPECT_EQ(ended.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_NE(ended.error_message().find("camera node"), std::string::npos) << ended.error_message();
}

TEST_F(LiveTest, ACallThatWasCancelledLetsTheNextOneIn) {
  start();
  grpc::ClientContext ramp_context;
  const auto ramp = rig_stub_->ShowRamp(&ramp_context);
  const std::optional<v1::ShowRampResponse> rig = ask(*ramp, false);
  ASSERT_TRUE(rig);
  for (int i = 0; i < 5; ++i) {
    grpc::ClientContext context;
    const auto live = live_stub_->RunLive(&context);
    ASSERT_TRUE(live->Write(start_of(*rig)));
    v1::RunLiveResponse response;
    ASSERT_TRUE(live->Read(&response)) << live->Finish().error_message();
    context.TryCancel();
  }
}

TEST_F(LiveTest, NeedsASolverThatListens) {
  start(false);
  grpc::ClientContext context;
  const auto ramp = rig_stub_->ShowRamp(&context);
  EXPECT_FALSE(ask(*ramp, false));
  const grpc::Status status = ramp->Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_NE(status.error_message().find("glasswing-solver --listen"), std::string::npos)
      << status.error_message();
  EXPECT_TRUE(becomes_free());
}

}  // namespace
}  // namespace glasswing
