// CameraService.Preview and StreamFrames of a simulated camera node.
#include <gtest/gtest.h>

#include <atomic>
#include <latch>
#include <limits>
#include <optional>

#include "core/file/fault_point.h"
#include "core/image/image.h"
#include "tests/camera-node/services/camera_node_fixture.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

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
    // The capture gets every frame, at its own exposure.
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

// One whole frame, from all its responses.
struct Streamed {
  v1::FrameTaken taken;
  std::string bytes;
};
std::optional<Streamed> read_frame(grpc::ClientReader<v1::StreamFramesResponse>& reader) {
  v1::StreamFramesResponse response;
  if (!reader.Read(&response)) return std::nullopt;
  Streamed frame{.taken = response.frame(), .bytes = response.chunk()};
  const size_t size = 6 * static_cast<size_t>(frame.taken.width_px()) * frame.taken.height_px();
  while (frame.bytes.size() < size && reader.Read(&response)) {
    EXPECT_FALSE(response.has_frame());
    frame.bytes += response.chunk();
  }
  return frame;
}

TEST_F(CameraNode, StreamsTheNewestFramesWhole) {
  // A frame that needs more than one message.
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
  // A capture gets the camera as soon as the stream releases it.
  v1::CaptureRequest capture;
  capture.set_exposure_ms(4.0);
  v1::CaptureResponse response;
  grpc::ClientContext capture_context;
  const auto captured = camera_stub_->Capture(&capture_context, capture);
  EXPECT_TRUE(captured->Read(&response)) << captured->Finish().error_message();
  capture_context.TryCancel();
  preview_context.TryCancel();
}

// Reads what the camera prepares until the first response without; false: there is none.
template <typename Response>
bool read_ready(grpc::ClientReader<Response>& reader, Response& response) {
  while (reader.Read(&response)) {
    if (!response.has_preparation()) return true;
    EXPECT_TRUE(response.preparation().what() == "waiting for the monitors' light" ||
                response.preparation().what() == "simulating the scene")
        << response.ShortDebugString();
  }
  return false;
}

TEST_F(CameraNode, CallsWaitForACameraThatPreparesAndSayWhatItDoes) {
  stop();
  timeline_.clear();
  options_.awaits_light = true;
  start();
  v1::GetCameraResponse described;
  grpc::ClientContext describe_context;
  ASSERT_OK(camera_stub_->GetCamera(&describe_context, {}, &described));
  EXPECT_EQ(described.preparation().what(), "waiting for the monitors' light");
  v1::PreviewRequest preview;
  preview.set_max_fps(10.0);
  preview.set_max_width_px(16);
  grpc::ClientContext preview_context;
  const auto previews = camera_stub_->Preview(&preview_context, preview);
  v1::PreviewResponse seen;
  ASSERT_TRUE(previews->Read(&seen));
  EXPECT_EQ(seen.preparation().what(), "waiting for the monitors' light");
  EXPECT_EQ(seen.jpeg(), "");
  v1::CaptureRequest capture;
  capture.set_exposure_ms(4.0);
  v1::CaptureResponse response;
  {
    grpc::ClientContext context;
    const auto reader = camera_stub_->Capture(&context, capture);
    ASSERT_TRUE(reader->Read(&response)) << reader->Finish().error_message();
    EXPECT_EQ(response.preparation().what(), "waiting for the monitors' light");
    EXPECT_FALSE(response.has_frame());
    context.TryCancel();  // frees the camera, though it is not ready
  }
  grpc::ClientContext context;
  const auto reader = camera_stub_->Capture(&context, capture);
  ASSERT_TRUE(reader->Read(&response)) << reader->Finish().error_message();
  EXPECT_TRUE(response.has_preparation());
  timeline_.add_monitor({.name = "back", .width_px = 8, .height_px = 6});
  ASSERT_TRUE(read_ready(*reader, response)) << reader->Finish().error_message();
  EXPECT_FALSE(response.has_frame());
  ASSERT_TRUE(reader->Read(&response));
  EXPECT_TRUE(response.has_frame());
  ASSERT_TRUE(read_ready(*previews, seen)) << previews->Finish().error_message();
  EXPECT_NE(seen.jpeg(), "");
  context.TryCancel();
  preview_context.TryCancel();
}

TEST_F(CameraNode, ANodeStopsWhileItsCameraPrepares) {
  stop();
  timeline_.clear();
  options_.awaits_light = true;
  start();
  v1::StreamFramesRequest request;
  request.set_exposure_ms(4.0);
  grpc::ClientContext context;
  const auto reader = camera_stub_->StreamFrames(&context, request);
  v1::StreamFramesResponse response;
  ASSERT_TRUE(reader->Read(&response));
  EXPECT_TRUE(response.has_preparation());
  cameras_->stop();
  while (reader->Read(&response)) {
  }
  const grpc::Status ended = reader->Finish();
  EXPECT_OK(ended);
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

// Holds the camera back while it starts.
class SlowStart {
 public:
  SlowStart() {
    at_fault_points([this](std::string_view point) {
      if (point != "camera starts") return;
      if (++starts_ == 1) begun_.count_down();
      released_.wait();
    });
  }
  ~SlowStart() { at_fault_points(nullptr); }
  void wait_begun() { begun_.wait(); }
  void release() { released_.count_down(); }
  int starts() const { return starts_; }

 private:
  std::latch begun_{1}, released_{1};
  std::atomic<int> starts_ = 0;
};

v1::CaptureRequest capture_of(const std::string& session) {
  v1::CaptureRequest request;
  request.set_exposure_ms(4.0);
  request.set_request_id(session);
  return request;
}

TEST_F(CameraNode, ARepeatedCaptureTakesTheCameraOverFromTheFirstWhichStillStartsIt) {
  SlowStart slow;
  v1::CaptureResponse response;
  grpc::ClientContext first_context, other_context, again_context;
  const auto first = camera_stub_->Capture(&first_context, capture_of("s"));
  slow.wait_begun();
  // Another session's call is refused, as ever.
  const auto other = camera_stub_->Capture(&other_context, capture_of("t"));
  EXPECT_FALSE(other->Read(&response));
  EXPECT_EQ(other->Finish().error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  const auto again = camera_stub_->Capture(&again_context, capture_of("s"));
  slow.release();
  ASSERT_TRUE(again->Read(&response)) << again->Finish().error_message();
  EXPECT_FALSE(response.has_frame());
  ASSERT_TRUE(again->Read(&response));
  EXPECT_DOUBLE_EQ(response.frame().exposure_ms(), 4.0);
  while (first->Read(&response)) {
  }
  EXPECT_EQ(first->Finish().error_code(), grpc::StatusCode::ABORTED);
  EXPECT_EQ(slow.starts(), 1);
  again_context.TryCancel();
}

TEST_F(CameraNode, ACaptureWhoseCallerHasGoneIsNoOtherClient) {
  SlowStart slow;
  v1::CaptureResponse response;
  grpc::ClientContext first_context, next_context;
  const auto first = camera_stub_->Capture(&first_context, capture_of("s"));
  slow.wait_begun();
  first_context.TryCancel();
  (void)first->Finish();
  const auto next = camera_stub_->Capture(&next_context, capture_of("t"));
  sleep_until_monotonic(monotonic_now() + std::chrono::milliseconds(1500));  // beyond the wait for a live one
  slow.release();
  EXPECT_TRUE(next->Read(&response)) << next->Finish().error_message();
  next_context.TryCancel();
}

TEST_F(CameraNode, AnotherExposureOfTheSameSessionStartsTheCameraAnew) {
  v1::CaptureResponse response;
  grpc::ClientContext first_context, next_context;
  const auto first = camera_stub_->Capture(&first_context, capture_of("s"));
  ASSERT_TRUE(first->Read(&response));
  v1::CaptureRequest shorter = capture_of("s");
  shorter.set_exposure_ms(2.0);
  const auto next = camera_stub_->Capture(&next_context, shorter);
  ASSERT_TRUE(next->Read(&response)) << next->Finish().error_message();
  ASSERT_TRUE(next->Read(&response));
  EXPECT_DOUBLE_EQ(response.frame().exposure_ms(), 2.0);
  next_context.TryCancel();
}

}  // namespace
}  // namespace glasswing
