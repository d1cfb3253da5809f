#include "camera-node/backends/libcamera_run.h"

#include <gtest/gtest.h>

namespace glasswing {
namespace {

using Kind = PixelFormat::Kind;

// Samples of a processed format are proportional to both gains; raw ones were taken before the second.
TEST(LibcameraGain, IsThatOfTheSamples) {
  libcamera::ControlList metadata(libcamera::controls::controls);
  EXPECT_FALSE(gain_in(metadata, Kind::kRgb));
  metadata.set(libcamera::controls::DigitalGain, 1.5f);
  EXPECT_EQ(gain_in(metadata, Kind::kYuv422), 1.5);
  EXPECT_FALSE(gain_in(metadata, Kind::kBayer));
  metadata.set(libcamera::controls::AnalogueGain, 4.0f);
  for (const Kind kind : {Kind::kRgb, Kind::kYuv422, Kind::kNv12, Kind::kJpeg})
    EXPECT_EQ(gain_in(metadata, kind), 6.0);
  for (const Kind kind : {Kind::kBayer, Kind::kGray}) EXPECT_EQ(gain_in(metadata, kind), 4.0);
}

}  // namespace
}  // namespace glasswing
