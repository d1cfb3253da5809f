// CameraService and ArchiveService of a simulated camera node, except id patches
// (camera_patches_test.cpp), previews and streams (camera_streams_test.cpp).
#include "camera-node/services/camera_service.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cstring>
#include <future>
#include <latch>
#include <limits>
#include <thread>

#include "core/base/checksum.h"
#include "core/file/fault_point.h"
#include "core/file/file.h"
#include "core/service/joined_calls.h"
#include "tests/camera-node/services/camera_node_fixture.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

TEST_F(CameraNode, KeepsWhatTheMonitorEmittedAndFindsItAfterARestart) {
  auto picture = std::make_shared<Image16>(8, 6);
  for (size_t i = 0; i < picture->samples.size(); ++i)
    picture->samples[i] = static_cast<std::uint16_t>(300 * i);
  timeline_.add_picture("back",
                        {.scanout_start = monotonic_now() - std::chrono::seconds(1), .image = picture});
  timeline_.set_horizon("back", monotonic_now() + std::chrono::hours(1));
  ASSERT_OK(create_archive("s"));

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
      // The exposure and the readout time of the sensor model.
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
    EXPECT_EQ(keep(last + 1'000'000, 8).frames_size(), 0);  // never in the ring
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
    ASSERT_OK(read_rows("s", file, 0, 6, &rows));
    ASSERT_EQ(rows.size(), picture->samples.size() * 2);
    for (size_t i = 0; i < picture->samples.size(); ++i) {
      std::uint16_t sample = 0;
      std::memcpy(&sample, &rows[2 * i], 2);
      // 16 rays each carry 1/16 of a pixel, so float rounding is far below one code.
      EXPECT_NEAR(sample, picture->samples[i], 1.0);
    }
  }
}

// The frames are dark, and kept as they come: one of many, on a machine that is busy, is not late.
TEST_F(CameraNode, CompressesFramesButThoseOfCalibrations) {
  const std::int64_t plain = tiff_size_bytes({8, 6});
  v1::CaptureRequest request;
  request.set_exposure_ms(4.0);
  for (const bool of_calibration : {false, true}) {
    v1::CreateArchiveRequest create;
    v1::CaptureManifest& manifest = *create.mutable_manifest();
    manifest.set_session(of_calibration ? "calibration" : "s");
    manifest.mutable_camera()->set_width_px(8);
    manifest.mutable_camera()->set_height_px(6);
    if (of_calibration) manifest.mutable_plan()->mutable_calibration()->set_of("camera");
    v1::CreateArchiveResponse created;
    grpc::ClientContext create_context;
    ASSERT_OK(archive_stub_->CreateArchive(&create_context, create, &created));
    grpc::ClientContext context;
    const auto reader = camera_stub_->Capture(&context, request);
    v1::CaptureResponse response;
    ASSERT_TRUE(reader->Read(&response));
    std::int64_t smallest = plain;
    for (int step = 0; step < 100 && smallest == plain; ++step) {
      ASSERT_TRUE(reader->Read(&response));
      v1::KeepFramesRequest keep;
      keep.set_session(manifest.session());
      keep.add_frames()->set_sequence(response.frame().sequence());
      keep.mutable_frames(0)->set_step(step);
      v1::KeepFramesResponse kept;
      grpc::ClientContext keep_context;
      ASSERT_OK(camera_stub_->KeepFrames(&keep_context, keep, &kept));
      for (const v1::Frame& frame : kept.frames()) smallest = std::min(smallest, frame.size_bytes());
    }
    EXPECT_EQ(smallest == plain, of_calibration);
    context.TryCancel();
    while (reader->Read(&response)) {
    }
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
  measure.add_sequences(response.frame().sequence() + 1'000'000);  // never in the ring
  v1::MeasureLightResponse measured;
  grpc::ClientContext measure_context;
  ASSERT_OK(camera_stub_->MeasureLight(&measure_context, measure, &measured));
  ASSERT_EQ(measured.frames_size(), 1);
  EXPECT_EQ(measured.frames(0).sequence(), response.frame().sequence());
  ASSERT_EQ(measured.frames(0).row_mean_size(), 6);
  // Each camera row sees one row of the monitor; a code of 16 bits is 1.5e-5.
  for (int y = 0; y < 6; ++y)
    EXPECT_NEAR(measured.frames(0).row_mean(y), picture->at(0, y, 0) / 65535.0, 3e-5) << y;
  EXPECT_DOUBLE_EQ(measured.frames(0).clipped_fraction(), 1.0 / 6.0);

  // With a calibration, the curves give the light and the saturation.
  v1::CameraCalibration& calibration = *measure.mutable_calibration();
  calibration.set_format_version(1);
  calibration.set_saturation(20'000.0 / 65535.0);
  for (int c = 0; c < 3; ++c) {
    v1::CameraCurve& curve = *calibration.add_curves();
    for (const float light : {-0.1f, 0.2f, 2.0f + static_cast<float>(c)}) curve.add_light(light);
  }
  grpc::ClientContext calibrated_context;
  ASSERT_OK(camera_stub_->MeasureLight(&calibrated_context, measure, &measured));
  for (int y = 0; y < 6; ++y) {
    const double code = picture->at(0, y, 0) / 65535.0;
    const double light = code < 0.5 ? -0.1 + 0.6 * code : 0.2 + 2.0 * (code - 0.5) * (3.0 - 0.2);
    // At full scale the channels have 2, 3 and 4: their mean is 3, and a code at most 4 * 1.5e-5.
    EXPECT_NEAR(measured.frames(0).row_mean(y), light, 2e-4) << y;
  }
  EXPECT_DOUBLE_EQ(measured.frames(0).clipped_fraction(), 2.0 / 6.0);  // codes of 24000 and 65535
  calibration.set_saturation(0.0);
  grpc::ClientContext broken_context;
  EXPECT_EQ(camera_stub_->MeasureLight(&broken_context, measure, &measured).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
  context.TryCancel();
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
  ASSERT_OK(create_archive("s"));
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
  ASSERT_EQ(put("frames/a.tif", checksum_of(bytes), bytes),
            grpc::StatusCode::OK);  // repeating it is no error
  const std::string other = encode_tiff(Image16(8, 6));
  EXPECT_EQ(put("frames/a.tif", checksum_of(other), other), grpc::StatusCode::ALREADY_EXISTS);
  std::string rows;
  EXPECT_EQ(read_rows("s", "frames/a.tif", 4, 3, &rows).error_code(), grpc::StatusCode::INVALID_ARGUMENT);

  stop();
  std::string flipped = bytes;
  flipped[500] = static_cast<char>(flipped[500] ^ 4);
  ASSERT_OK(write_file_durably(directory_ / "s" / "frames" / "a.tif", flipped));
  start();
  const grpc::Status damaged = read_rows("s", "frames/a.tif", 0, 1, &rows);
  EXPECT_EQ(damaged.error_code(), grpc::StatusCode::DATA_LOSS);
  EXPECT_NE(damaged.error_message().find("frames/a.tif"), std::string::npos) << damaged.error_message();
}

TEST_F(CameraNode, ARepeatedKeepGetsTheAnswerOfTheFirst) {
  ASSERT_OK(create_archive("s"));
  v1::CaptureRequest request;
  request.set_exposure_ms(4.0);
  grpc::ClientContext context;
  const auto reader = camera_stub_->Capture(&context, request);
  v1::CaptureResponse response;
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(reader->Read(&response));
  v1::KeepFramesRequest keep;
  keep.set_session("s");
  keep.set_request_id("one");
  keep.add_frames()->set_sequence(response.frame().sequence());
  keep.mutable_frames(0)->set_step(7);
  const auto ask = [&] {
    v1::KeepFramesResponse kept;
    grpc::ClientContext keep_context;
    const grpc::Status status = camera_stub_->KeepFrames(&keep_context, keep, &kept);
    EXPECT_OK(status);
    return kept;
  };
  std::latch begun(1), released(1);
  std::atomic<int> stored = 0;
  at_fault_points([&](std::string_view point) {
    if (point != "frames written" || ++stored > 1) return;
    begun.count_down();
    released.wait();
  });
  const double joined = joined_calls().Value();
  auto first = std::async(std::launch::async, ask);
  begun.wait();
  auto second = std::async(std::launch::async, ask);
  while (joined_calls().Value() == joined) std::this_thread::yield();
  released.count_down();
  const std::string answer = first.get().SerializeAsString();
  EXPECT_EQ(second.get().SerializeAsString(), answer);
  // The frame may have left the ring, and still the answer names it.
  context.TryCancel();
  while (reader->Read(&response)) {
  }
  keep.mutable_frames(0)->set_sequence(-1);
  EXPECT_EQ(ask().SerializeAsString(), answer);
  keep.set_request_id("two");
  EXPECT_EQ(ask().frames_size(), 0);
  EXPECT_EQ(stored, 1);
  at_fault_points(nullptr);
  EXPECT_EQ(store_->find("s").value()->manifest().frames_size(), 1);
}

}  // namespace
}  // namespace glasswing
