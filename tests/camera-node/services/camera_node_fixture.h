// A simulated camera node for tests: the camera, its archives and their services, over a real channel.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "camera-node/backends/sim_camera.h"
#include "camera-node/services/camera_service.h"
#include "core/archive/archive_service.h"
#include "core/pattern/id_patch.h"
#include "core/service/service.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {

class CameraNode : public testing::Test {
 protected:
  void SetUp() override {
    options_.scene = "none";
    options_.width_px = 8;
    options_.height_px = 6;
    options_.sensor.read_sd = 0.0;
    options_.sensor.gain = 0.0;
    options_.sensor.bits = 16;
    options_.sensor.full_scale_exposure_ms = 4.0;
    timeline_.add_monitor({.name = "back",
                           .width_px = 8,
                           .height_px = 6,
                           .scanout = std::chrono::milliseconds(16),
                           .lag = std::chrono::milliseconds(2)});
    start();
  }
  void TearDown() override { stop(); }
  void start() {
    camera_ = SimCamera::create(options_, timeline_).value();
    store_ = std::make_unique<ArchiveStore>(directory_);
    cameras_ = std::make_unique<CameraServiceImpl>(*camera_, *store_);
    archives_ = std::make_unique<ArchiveServiceImpl>(*store_);
    host_ = ServiceHost::start({}, {cameras_.get(), archives_.get()}).value();
    channel_ = dial(host_->address());
    camera_stub_ = v1::CameraService::NewStub(channel_);
    archive_stub_ = v1::ArchiveService::NewStub(channel_);
    if (!options_.awaits_light) wait_prepared();
  }
  void wait_prepared() const {
    while (camera_->describe().has_preparation()) std::this_thread::yield();
  }
  void stop() {
    cameras_->stop();
    host_->stop(std::chrono::milliseconds(500));
  }
  grpc::Status create_archive(const std::string& session) {
    v1::CreateArchiveRequest request;
    request.mutable_manifest()->set_session(session);
    request.mutable_manifest()->mutable_camera()->set_width_px(options_.width_px);
    request.mutable_manifest()->mutable_camera()->set_height_px(options_.height_px);
    v1::CreateArchiveResponse response;
    grpc::ClientContext context;
    return archive_stub_->CreateArchive(&context, request, &response);
  }
  grpc::Status read_rows(const std::string& session, const std::string& file, int first, int count,
                         std::string* rows) {
    v1::ReadRowsRequest request;
    request.set_session(session);
    request.add_files(file);
    request.set_first_row(first);
    request.set_row_count(count);
    grpc::ClientContext context;
    const auto reader = archive_stub_->ReadRows(&context, request);
    v1::ReadRowsResponse response;
    while (reader->Read(&response)) *rows += response.chunk();
    return reader->Finish();
  }
  v1::KeepFramesResponse keep(std::int64_t sequence, int step) {
    v1::KeepFramesRequest request;
    request.set_session("s");
    request.add_frames()->set_sequence(sequence);
    request.mutable_frames(0)->set_step(step);
    v1::KeepFramesResponse response;
    grpc::ClientContext context;
    EXPECT_OK(camera_stub_->KeepFrames(&context, request, &response));
    return response;
  }
  // Id patches: a camera pixel sees one of the monitor.
  static constexpr IdPatch kPatch{.width_px = 64, .first_row = 0, .rows = 8};
  void look_at_patch() {
    stop();
    timeline_.clear();
    options_.width_px = kPatch.width_px;
    options_.height_px = kPatch.rows;
    timeline_.add_monitor({.name = "back", .width_px = kPatch.width_px, .height_px = kPatch.rows});
    start();
  }
  // Shows an id until the camera has taken a frame of it; returns the frame's record.
  v1::Frame show(grpc::ClientReader<v1::CaptureResponse>& reader, std::uint16_t id, bool dark) {
    RadianceImage strip(kPatch.width_px, kPatch.rows);
    if (!dark) kPatch.draw(id, strip);
    auto codes = std::make_shared<Image16>(kPatch.width_px, kPatch.rows);
    std::transform(strip.samples.begin(), strip.samples.end(), codes->samples.begin(), code16_of);
    const nanoseconds shown = monotonic_now();
    timeline_.add_picture("back", {.scanout_start = shown, .image = codes});
    v1::CaptureResponse response;
    do {
      if (!reader.Read(&response)) {
        ADD_FAILURE() << "the capture has ended";
        return {};
      }
    } while (response.frame().exposure_start_ns() < shown.count());
    timeline_.set_horizon("back", nanoseconds(response.frame().exposure_end_ns()));
    v1::Frame frame;
    frame.set_sequence(response.frame().sequence());
    frame.set_exposure_ms(4.0);
    frame.mutable_stimulus()->set_panel("back");
    return frame;
  }
  // One frame of kind "patch" for each learning id.
  std::vector<v1::Frame> show_learning_ids(grpc::ClientReader<v1::CaptureResponse>& reader, bool dark) {
    std::vector<v1::Frame> frames;
    for (const std::uint16_t id : patch_learning_ids()) {
      v1::Frame& frame = frames.emplace_back(show(reader, id, dark));
      frame.set_step(static_cast<int>(frames.size()));
      frame.mutable_stimulus()->set_kind("patch");
      frame.mutable_stimulus()->set_patch_id(id);
    }
    return frames;
  }
  std::unique_ptr<grpc::ClientReader<v1::CaptureResponse>> capture(grpc::ClientContext& context) {
    v1::CaptureRequest request;
    request.set_exposure_ms(4.0);
    auto reader = camera_stub_->Capture(&context, request);
    v1::CaptureResponse running;
    EXPECT_TRUE(reader->Read(&running));
    return reader;
  }
  v1::LearnPatchesResponse learn(const std::vector<v1::Frame>& frames, bool accept_unseen = false) {
    v1::LearnPatchesRequest request;
    request.set_session("s");
    request.mutable_frames()->Assign(frames.begin(), frames.end());
    if (accept_unseen) request.add_accept_unseen_patches("back");
    v1::LearnPatchesResponse response;
    grpc::ClientContext context;
    const grpc::Status status = camera_stub_->LearnPatches(&context, request, &response);
    EXPECT_OK(status);
    return response;
  }
  grpc::Status keep_frame(const v1::Frame& frame, v1::KeepFramesResponse* response) {
    v1::KeepFramesRequest request;
    request.set_session("s");
    *request.add_frames() = frame;
    grpc::ClientContext context;
    return camera_stub_->KeepFrames(&context, request, response);
  }

  const TemporaryDirectory directory_;
  EmissionTimeline timeline_;
  SimCameraOptions options_;
  std::unique_ptr<SimCamera> camera_;
  std::unique_ptr<ArchiveStore> store_;
  std::unique_ptr<CameraServiceImpl> cameras_;
  std::unique_ptr<ArchiveServiceImpl> archives_;
  std::unique_ptr<ServiceHost> host_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::CameraService::Stub> camera_stub_;
  std::unique_ptr<v1::ArchiveService::Stub> archive_stub_;
};

}  // namespace glasswing
