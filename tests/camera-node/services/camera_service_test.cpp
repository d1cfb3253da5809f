// The simulated camera, its spool and its archives, over a real channel.
#include "camera-node/services/camera_service.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <limits>

#include "camera-node/backends/sim_camera.h"
#include "core/archive/archive_service.h"
#include "core/base/checksum.h"
#include "core/base/file.h"
#include "core/pattern/id_patch.h"
#include "core/service/service.h"
#include "glasswing/v1/archive_service.grpc.pb.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

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
    timeline_.add_monitor(
        {.name = "back", .width_px = 8, .height_px = 6, .scanout = milliseconds(16), .lag = milliseconds(2)});
    start();
  }
  void TearDown() override {
    stop();
    fs::remove_all(directory_);
  }
  void start() {
    camera_ = SimCamera::create(options_, timeline_).value();
    store_ = std::make_unique<ArchiveStore>(directory_);
    cameras_ = std::make_unique<CameraServiceImpl>(*camera_, *store_);
    archives_ = std::make_unique<ArchiveServiceImpl>(*store_);
    host_ = ServiceHost::start({}, {cameras_.get(), archives_.get()}).value();
    channel_ = dial(host_->address());
    camera_stub_ = v1::CameraService::NewStub(channel_);
    archive_stub_ = v1::ArchiveService::NewStub(channel_);
  }
  void stop() {
    cameras_->stop();
    host_->stop(milliseconds(500));
  }
  grpc::Status create_archive(const std::string& session) {
    v1::CreateArchiveRequest request;
    request.mutable_manifest()->set_session(session);
    request.mutable_manifest()->mutable_camera()->set_width_px(8);
    request.mutable_manifest()->mutable_camera()->set_height_px(6);
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
    EXPECT_TRUE(camera_stub_->KeepFrames(&context, request, &response).ok());
    return response;
  }

  const fs::path directory_ = fs::path(testing::TempDir()) / ("camera_node." + std::to_string(::getpid()));
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

TEST_F(CameraNode, KeepsWhatTheMonitorEmittedAndFindsItAfterARestart) {
  auto picture = std::make_shared<Image16>(8, 6);
  for (size_t i = 0; i < picture->samples.size(); ++i)
    picture->samples[i] = static_cast<std::uint16_t>(300 * i);
  timeline_.add_picture("back",
                        {.scanout_start = monotonic_now() - std::chrono::seconds(1), .image = picture});
  timeline_.set_horizon("back", monotonic_now() + std::chrono::hours(1));
  ASSERT_TRUE(create_archive("s").ok());

  v1::CaptureRequest request;
  request.set_exposure_ms(4.0);
  std::string file;
  {
    grpc::ClientContext context;
    const auto reader = camera_stub_->Capture(&context, request);
    v1::CaptureResponse response;
    ASSERT_TRUE(reader->Read(&response));
    EXPECT_FALSE(response.has_frame());
    std::int64_t last = 0;
    for (int i = 0; i < 5; ++i) {
      ASSERT_TRUE(reader->Read(&response));
      EXPECT_GT(response.frame().sequence(), last);
      last = response.frame().sequence();
      // Its exposure and the rows' readout, as the sensor model has them.
      EXPECT_EQ(response.frame().exposure_end_ns() - response.frame().exposure_start_ns(),
                4'000'000 + 2'000'000);
      EXPECT_LE(response.frame().exposure_end_ns(), monotonic_now().count());
    }
    // A second capture is refused while this one runs.
    grpc::ClientContext other_context;
    const auto other = camera_stub_->Capture(&other_context, request);
    v1::CaptureResponse none;
    EXPECT_FALSE(other->Read(&none));
    EXPECT_EQ(other->Finish().error_code(), grpc::StatusCode::FAILED_PRECONDITION);

    const v1::KeepFramesResponse kept = keep(last, 7);
    ASSERT_EQ(kept.frames_size(), 1);
    file = kept.frames(0).file();
    EXPECT_EQ(keep(last + 1'000'000, 8).frames_size(), 0);  // never was in the ring
    EXPECT_EQ(keep(last - 1, 7).frames(0).checksum(),
              kept.frames(0).checksum());  // the step is there already
    context.TryCancel();
  }
  for (const bool restarted : {false, true}) {
    if (restarted) {
      stop();
      start();
    }
    std::string rows;
    ASSERT_TRUE(read_rows("s", file, 0, 6, &rows).ok());
    ASSERT_EQ(rows.size(), picture->samples.size() * 2);
    for (size_t i = 0; i < picture->samples.size(); ++i) {
      std::uint16_t sample = 0;
      std::memcpy(&sample, &rows[2 * i], 2);
      // 16 rays each carry 1/16 of a pixel: float rounding stays far below one code.
      EXPECT_NEAR(sample, picture->samples[i], 1.0);
    }
  }
}

TEST_F(CameraNode, SaysWhetherAPatchIsSeen) {
  // Each learning id for a while; a camera pixel sees one of the monitor.
  constexpr IdPatch kPatch{.width_px = 64, .first_row = 0, .rows = 8};
  for (const bool dark : {true, false}) {
    stop();
    timeline_.clear();
    options_.width_px = 64;
    options_.height_px = 8;
    timeline_.add_monitor({.name = "back", .width_px = 64, .height_px = 8});
    start();
    v1::CaptureRequest request;
    request.set_exposure_ms(4.0);
    grpc::ClientContext context;
    const auto reader = camera_stub_->Capture(&context, request);
    v1::CaptureResponse response;
    v1::LookForPatchesRequest look;
    ASSERT_TRUE(reader->Read(&response));
    for (const std::uint16_t id : patch_learning_ids()) {
      RadianceImage strip(64, 8);
      if (!dark) kPatch.draw(id, strip);
      auto codes = std::make_shared<Image16>(64, 8);
      std::transform(strip.samples.begin(), strip.samples.end(), codes->samples.begin(), code16_of);
      const nanoseconds shown = monotonic_now();
      timeline_.add_picture("back", {.scanout_start = shown, .image = codes});
      do {
        ASSERT_TRUE(reader->Read(&response));
      } while (response.frame().exposure_start_ns() < shown.count());
      timeline_.set_horizon("back", nanoseconds(response.frame().exposure_end_ns()));
      v1::Frame& lesson = *look.add_frames();
      lesson.set_sequence(response.frame().sequence());
      lesson.set_exposure_ms(4.0);
      lesson.mutable_stimulus()->set_kind("patch");
      lesson.mutable_stimulus()->set_panel("back");
      lesson.mutable_stimulus()->set_patch_id(id);
    }
    const auto found = [&](const v1::LookForPatchesRequest& frames) {
      v1::LookForPatchesResponse seen;
      grpc::ClientContext look_context;
      EXPECT_TRUE(camera_stub_->LookForPatches(&look_context, frames, &seen).ok());
      return seen;
    };
    const v1::LookForPatchesResponse all = found(look);
    ASSERT_EQ(all.unseen_patches_size(), dark ? 1 : 0);
    if (dark) {
      EXPECT_TRUE(all.unseen_patches(0).dark());
    }
    look.mutable_frames()->RemoveLast();
    ASSERT_EQ(found(look).unseen_patches_size(), 1) << "one is missing";
    EXPECT_EQ(found(look).unseen_patches(0).monitor(), "back");
    context.TryCancel();
  }
}

TEST_F(CameraNode, MeasuresTheLightOfEachRow) {
  auto picture = std::make_shared<Image16>(8, 6);
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 8; ++x)
      for (int c = 0; c < 3; ++c)
        picture->at(x, y, c) = static_cast<std::uint16_t>(y == 5 ? 65535 : 6000 * y);
  }
  timeline_.add_picture("back",
                        {.scanout_start = monotonic_now() - std::chrono::seconds(1), .image = picture});
  timeline_.set_horizon("back", monotonic_now() + std::chrono::hours(1));
  v1::CaptureRequest request;
  request.set_exposure_ms(4.0);
  grpc::ClientContext context;
  const auto reader = camera_stub_->Capture(&context, request);
  v1::CaptureResponse response;
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(reader->Read(&response));
  v1::MeasureLightRequest measure;
  measure.add_sequences(response.frame().sequence());
  measure.add_sequences(response.frame().sequence() + 1'000'000);  // never was in the ring
  v1::MeasureLightResponse measured;
  grpc::ClientContext measure_context;
  ASSERT_TRUE(camera_stub_->MeasureLight(&measure_context, measure, &measured).ok());
  ASSERT_EQ(measured.frames_size(), 1);
  EXPECT_EQ(measured.frames(0).sequence(), response.frame().sequence());
  ASSERT_EQ(measured.frames(0).row_mean_size(), 6);
  // Each camera row sees one row of the monitor; a code of 16 bits is 1.5e-5.
  for (int y = 0; y < 6; ++y)
    EXPECT_NEAR(measured.frames(0).row_mean(y), picture->at(0, y, 0) / 65535.0, 3e-5) << y;
  EXPECT_DOUBLE_EQ(measured.frames(0).clipped_fraction(), 1.0 / 6.0);

  // With a calibration it is the curves' light, and what they call saturated.
  v1::CameraCalibration& calibration = *measure.mutable_calibration();
  calibration.set_format_version(1);
  calibration.set_saturation(20'000.0 / 65535.0);
  for (int c = 0; c < 3; ++c) {
    v1::CameraCurve& curve = *calibration.add_curves();
    for (const float light : {-0.1f, 0.2f, 2.0f + static_cast<float>(c)}) curve.add_light(light);
  }
  grpc::ClientContext calibrated_context;
  ASSERT_TRUE(camera_stub_->MeasureLight(&calibrated_context, measure, &measured).ok());
  for (int y = 0; y < 6; ++y) {
    const double code = picture->at(0, y, 0) / 65535.0;
    const double light = code < 0.5 ? -0.1 + 0.6 * code : 0.2 + 2.0 * (code - 0.5) * (3.0 - 0.2);
    // The third channel's mean of 2, 3 and 4 at full scale is 3; a code is 4 * 1.5e-5 at most.
    EXPECT_NEAR(measured.frames(0).row_mean(y), light, 2e-4) << y;
  }
  EXPECT_DOUBLE_EQ(measured.frames(0).clipped_fraction(), 2.0 / 6.0);  // codes of 24000 and 65535
  calibration.set_saturation(0.0);
  grpc::ClientContext broken_context;
  EXPECT_EQ(camera_stub_->MeasureLight(&broken_context, measure, &measured).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
  context.TryCancel();
}

TEST_F(CameraNode, APreviewYieldsToACaptureAndThenLooksOn) {
  auto picture = std::make_shared<Image16>(8, 6);
  for (std::uint16_t& sample : picture->samples) sample = code16_of(0.25f);
  timeline_.add_picture("back",
                        {.scanout_start = monotonic_now() - std::chrono::seconds(1), .image = picture});
  timeline_.set_horizon("back", monotonic_now() + std::chrono::hours(1));
  v1::PreviewRequest request;
  request.set_max_fps(10.0);
  request.set_max_width_px(16);
  request.set_exposure_ms(2.0);
  grpc::ClientContext context;
  const auto previews = camera_stub_->Preview(&context, request);
  v1::PreviewResponse preview;
  ASSERT_TRUE(previews->Read(&preview));
  EXPECT_EQ(preview.width_px(), 8);
  EXPECT_EQ(preview.height_px(), 6);
  EXPECT_EQ(preview.jpeg().substr(0, 3), "\xff\xd8\xff");
  EXPECT_DOUBLE_EQ(preview.exposure_ms(), 2.0);
  // Full scale is at 4 ms.
  EXPECT_NEAR(preview.mean(), 0.125, 3e-5);
  EXPECT_NEAR(preview.focus(), 0.0, 1e-3);
  EXPECT_EQ(preview.clipped_fraction(), 0.0);
  {
    grpc::ClientContext other_context;
    const auto other = camera_stub_->Preview(&other_context, request);
    EXPECT_FALSE(other->Read(&preview));
    EXPECT_EQ(other->Finish().error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  }
  {
    v1::CaptureRequest capture;
    capture.set_exposure_ms(4.0);
    grpc::ClientContext capture_context;
    const auto reader = camera_stub_->Capture(&capture_context, capture);
    v1::CaptureResponse response;
    ASSERT_TRUE(reader->Read(&response)) << reader->Finish().error_message();
    // Every frame is the capture's: none is missing, all are as it asked.
    std::int64_t last = 0;
    for (int i = 0; i < 60; ++i) {
      ASSERT_TRUE(reader->Read(&response));
      EXPECT_DOUBLE_EQ(response.frame().exposure_ms(), 4.0);
      if (i > 0) {
        EXPECT_EQ(response.frame().sequence(), last + 1);
      }
      last = response.frame().sequence();
    }
    do {
      ASSERT_TRUE(previews->Read(&preview));
    } while (preview.exposure_ms() != 4.0);
    EXPECT_NEAR(preview.mean(), 0.25, 3e-5);
    capture_context.TryCancel();
  }
  do {
    ASSERT_TRUE(previews->Read(&preview));
  } while (preview.exposure_ms() != 2.0);
  context.TryCancel();
}

// Reads one whole frame; the responses' frames and their bytes.
struct Streamed {
  v1::FrameTaken taken;
  std::string bytes;
};
std::optional<Streamed> read_frame(grpc::ClientReader<v1::StreamFramesResponse>& reader) {
  v1::StreamFramesResponse response;
  if (!reader.Read(&response)) return std::nullopt;
  Streamed frame{.taken = response.frame(), .bytes = response.chunk()};
  const size_t size =
      6 * static_cast<size_t>(frame.taken.width_px()) * static_cast<size_t>(frame.taken.height_px());
  while (frame.bytes.size() < size && reader.Read(&response)) {
    EXPECT_FALSE(response.has_frame());
    frame.bytes += response.chunk();
  }
  return frame;
}

TEST_F(CameraNode, StreamsTheNewestFramesWhole) {
  // More than one message holds.
  stop();
  options_.width_px = 640;
  options_.height_px = 300;
  start();
  auto picture = std::make_shared<Image16>(8, 6);
  for (std::uint16_t& sample : picture->samples) sample = 0x1234;
  timeline_.add_picture("back",
                        {.scanout_start = monotonic_now() - std::chrono::seconds(1), .image = picture});
  timeline_.set_horizon("back", monotonic_now() + std::chrono::hours(1));
  v1::StreamFramesRequest request;
  request.set_exposure_ms(4.0);
  grpc::ClientContext context;
  const auto reader = camera_stub_->StreamFrames(&context, request);
  v1::StreamFramesResponse first;
  ASSERT_TRUE(reader->Read(&first));
  EXPECT_FALSE(first.has_frame());
  std::string one_pixel;
  for (int i = 0; i < 3; ++i) one_pixel += "\x34\x12";
  std::int64_t last = 0;
  for (int i = 0; i < 5; ++i) {
    const nanoseconds asked = monotonic_now();
    const std::optional<Streamed> frame = read_frame(*reader);
    ASSERT_TRUE(frame);
    EXPECT_GT(frame->taken.sequence(), last);
    last = frame->taken.sequence();
    EXPECT_LT(frame->taken.exposure_end_ns(), monotonic_now().count());
    EXPECT_GT(frame->taken.exposure_end_ns(), (asked - std::chrono::minutes(1)).count());
    ASSERT_EQ(frame->bytes.size(), 640u * 300u * 6u);
    for (size_t at = 0; at < frame->bytes.size(); at += 6000)
      EXPECT_EQ(frame->bytes.substr(at, 6), one_pixel);
  }
  context.TryCancel();
}

TEST_F(CameraNode, AStreamHasTheCameraAloneAndLetsPreviewsLookOn) {
  timeline_.set_horizon("back", monotonic_now() + std::chrono::hours(1));
  v1::PreviewRequest preview;
  preview.set_max_fps(10.0);
  preview.set_max_width_px(16);
  preview.set_exposure_ms(2.0);
  grpc::ClientContext preview_context;
  const auto previews = camera_stub_->Preview(&preview_context, preview);
  v1::PreviewResponse seen;
  ASSERT_TRUE(previews->Read(&seen));
  v1::StreamFramesRequest request;
  request.set_exposure_ms(3.0);
  grpc::ClientContext context;
  const auto reader = camera_stub_->StreamFrames(&context, request);
  v1::StreamFramesResponse first;
  ASSERT_TRUE(reader->Read(&first)) << reader->Finish().error_message();
  {
    v1::StreamFramesResponse response;
    grpc::ClientContext other_context;
    const auto other = camera_stub_->StreamFrames(&other_context, request);
    EXPECT_FALSE(other->Read(&response));
    EXPECT_EQ(other->Finish().error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  }
  {
    v1::CaptureRequest capture;
    capture.set_exposure_ms(3.0);
    v1::CaptureResponse response;
    grpc::ClientContext other_context;
    const auto other = camera_stub_->Capture(&other_context, capture);
    EXPECT_FALSE(other->Read(&response));
    EXPECT_EQ(other->Finish().error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  }
  do {
    ASSERT_TRUE(read_frame(*reader));
    ASSERT_TRUE(previews->Read(&seen));
  } while (seen.exposure_ms() != 3.0);
  context.TryCancel();
  // A capture has it as soon as the stream lets go.
  v1::CaptureRequest capture;
  capture.set_exposure_ms(4.0);
  v1::CaptureResponse response;
  grpc::ClientContext capture_context;
  const auto captured = camera_stub_->Capture(&capture_context, capture);
  EXPECT_TRUE(captured->Read(&response)) << captured->Finish().error_message();
  capture_context.TryCancel();
  preview_context.TryCancel();
}

TEST_F(CameraNode, RefusesToStreamWithAnExposureThatCannotBe) {
  v1::StreamFramesRequest request;
  request.set_exposure_ms(1000.0);
  grpc::ClientContext context;
  const auto reader = camera_stub_->StreamFrames(&context, request);
  v1::StreamFramesResponse response;
  EXPECT_FALSE(reader->Read(&response));
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(CameraNode, RefusesPreviewsThatCannotBe) {
  const auto code = [this](double fps, int width_px, double exposure_ms) {
    v1::PreviewRequest request;
    request.set_max_fps(fps);
    request.set_max_width_px(width_px);
    request.set_exposure_ms(exposure_ms);
    grpc::ClientContext context;
    const auto reader = camera_stub_->Preview(&context, request);
    v1::PreviewResponse response;
    EXPECT_FALSE(reader->Read(&response));
    return reader->Finish().error_code();
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(code(0.1, 640, 4.0), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(code(11.0, 640, 4.0), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(code(nan, 640, 4.0), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(code(2.0, 15, 4.0), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(code(2.0, 5000, 4.0), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(code(2.0, 640, -1.0), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(code(2.0, 640, nan), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(CameraNode, RefusesWhatCannotBe) {
  v1::CaptureRequest request;
  for (const double exposure_ms : {0.0, -1.0, 1000.0, std::numeric_limits<double>::quiet_NaN()}) {
    request.set_exposure_ms(exposure_ms);
    grpc::ClientContext context;
    const auto reader = camera_stub_->Capture(&context, request);
    v1::CaptureResponse response;
    EXPECT_FALSE(reader->Read(&response));
    EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::INVALID_ARGUMENT) << exposure_ms;
  }
  EXPECT_EQ(create_archive("../s").error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  std::string rows;
  EXPECT_EQ(read_rows("nobody", "frames/a.tif", 0, 1, &rows).error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST_F(CameraNode, PutFramesAreCheckedAndDamageIsNamed) {
  ASSERT_TRUE(create_archive("s").ok());
  Image16 image(8, 6);
  for (size_t i = 0; i < image.samples.size(); ++i) image.samples[i] = static_cast<std::uint16_t>(i * 300);
  const std::string bytes = encode_tiff(image);
  const auto put = [&](const std::string& file, const std::string& checksum, const std::string& sent) {
    v1::PutFrameResponse response;
    grpc::ClientContext context;
    const auto writer = archive_stub_->PutFrame(&context, &response);
    v1::PutFrameRequest request;
    request.set_session("s");
    request.mutable_frame()->set_file(file);
    request.mutable_frame()->set_step(-1);
    request.mutable_frame()->set_checksum(checksum);
    writer->Write(request);
    v1::PutFrameRequest chunk;
    chunk.set_chunk(sent);
    writer->Write(chunk);
    writer->WritesDone();
    return writer->Finish().error_code();
  };
  EXPECT_EQ(put("frames/a.tif", checksum_of("other"), bytes), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(put("../a.tif", checksum_of(bytes), bytes), grpc::StatusCode::INVALID_ARGUMENT);
  const std::string small = encode_tiff(Image16(4, 4));
  EXPECT_EQ(put("frames/a.tif", checksum_of(small), small), grpc::StatusCode::INVALID_ARGUMENT);
  ASSERT_EQ(put("frames/a.tif", checksum_of(bytes), bytes), grpc::StatusCode::OK);
  ASSERT_EQ(put("frames/a.tif", checksum_of(bytes), bytes), grpc::StatusCode::OK);  // again is no error
  const std::string other = encode_tiff(Image16(8, 6));
  EXPECT_EQ(put("frames/a.tif", checksum_of(other), other), grpc::StatusCode::ALREADY_EXISTS);
  std::string rows;
  EXPECT_EQ(read_rows("s", "frames/a.tif", 4, 3, &rows).error_code(), grpc::StatusCode::INVALID_ARGUMENT);

  stop();
  std::string flipped = bytes;
  flipped[500] = static_cast<char>(flipped[500] ^ 4);
  ASSERT_TRUE(write_file_durably(directory_ / "s" / "frames" / "a.tif", flipped).ok());
  start();
  const grpc::Status damaged = read_rows("s", "frames/a.tif", 0, 1, &rows);
  EXPECT_EQ(damaged.error_code(), grpc::StatusCode::DATA_LOSS);
  EXPECT_NE(damaged.error_message().find("frames/a.tif"), std::string::npos) << damaged.error_message();
}

}  // namespace
}  // namespace glasswing
