// Photographs in raw files, imported by a list.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/exchange/frame_source.h"
#include "core/file/file.h"
#include "tests/core/image/dng.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int kSide_px = 32;

class RawImport : public testing::Test {
 protected:
  static Dng flat(std::uint16_t code, float black) {
    Dng dng{.width_px = kSide_px,
            .height_px = kSide_px,
            .codes = std::vector<std::uint16_t>(size_t{kSide_px} * kSide_px, code),
            .bits = 14,
            .mosaic = "BGGR"};
    dng.black = {black};
    dng.white = 16000;
    dng.exposure_s = 0.25;
    return dng;
  }
  absl::StatusOr<FrameSource> source(const PhotographOptions& options = {}) const {
    const std::string list =
        "#monitor back:64x48\nfile\tobject\tkind\tcolour\texposure_ms\na.dng\tfalse\tsolid\t0,0,0\t\n"
        "b.dng\ttrue\tsolid\t1,1,1\t40\n";
    EXPECT_TRUE(write_file_durably(directory_ / "list.tsv", list).ok());
    absl::StatusOr<PhotographList> read = read_photograph_list(directory_ / "list.tsv", options);
    if (!read.ok()) return read.status();
    return photograph_source(directory_, *std::move(read));
  }

  const TemporaryDirectory directory_;
};

TEST_F(RawImport, KeepsTheMosaicAndTheLevelsOfTheFirstFile) {
  write_dng(directory_ / "a.dng", flat(700, 800.0f));
  write_dng(directory_ / "b.dng", flat(9000, 810.0f));
  const absl::StatusOr<FrameSource> read = source();
  ASSERT_TRUE(read.ok()) << read.status();
  const v1::Camera& camera = read->manifest.camera();
  EXPECT_EQ(camera.mosaic(), "BGGR");
  EXPECT_EQ(camera.bits(), 14);
  EXPECT_EQ(camera.response(), "linear");
  EXPECT_DOUBLE_EQ(camera.black_level(), 800.0 / 16000.0);
  EXPECT_TRUE(read->warnings.empty());
  // By the file where the list does not tell it.
  EXPECT_NEAR(read->manifest.frames(0).exposure_ms(), 250.0, 1e-6);
  EXPECT_EQ(read->manifest.frames(1).exposure_ms(), 40.0);
  const Image16 dark = read->read(0).value(), lit = read->read(1).value();
  EXPECT_EQ(dark.channels, 1);
  // Below black, and ten codes of black lower.
  EXPECT_NEAR(dark.samples[0] * 16000.0 / 65535.0, 700.0, 0.5);
  EXPECT_NEAR(lit.samples[0] * 16000.0 / 65535.0, 8990.0, 0.5);
}

TEST_F(RawImport, RefusesOptionsThatTheFilesKnowBetterAndSetsThatAreMixed) {
  write_dng(directory_ / "a.dng", flat(700, 800.0f));
  write_dng(directory_ / "b.dng", flat(9000, 800.0f));
  PhotographOptions srgb;
  srgb.response = "srgb";
  EXPECT_THAT(std::string(source(srgb).status().message()), HasSubstr("omit response, black and white"));
  Dng other = flat(9000, 800.0f);
  other.mosaic = "RGGB";
  write_dng(directory_ / "b.dng", other);
  const absl::Status mixed = source().value().read(1).status();
  EXPECT_THAT(std::string(mixed.message()),
              HasSubstr("b.dng is 32x32 of 14 bits, mosaic RGGB; it must match the first"));
}

}  // namespace
}  // namespace glasswing
