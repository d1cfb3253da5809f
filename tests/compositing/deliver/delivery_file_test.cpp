// Files for other programs: what they hold is compared with the matte, by our reader and by exrheader and
// oiiotool.
#include "compositing/deliver/delivery_file.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <sstream>

#include "compositing/deliver/half_channels.h"
#include "core/composite/compositor.h"
#include "core/file/file.h"
#include "core/file/positioned_file.h"
#include "core/matte/matte_file.h"
#include "core/matte/packed_matte.h"
#include "tests/core/footprint/matte_object.h"
#include "tests/core/matte/other_program.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kWidth = 41, kHeight = 37;
constexpr MatteRegion kObject{.x_px = 5, .y_px = 9, .width_px = 23, .height_px = 21};

bool is_object(int x, int y) {
  return x >= kObject.x_px && x < kObject.x_px + kObject.width_px && y >= kObject.y_px &&
         y < kObject.y_px + kObject.height_px;
}

// An ellipse before two monitors, one of them of 4K.
Matte vase() {
  Matte matte = random_object(kWidth, kHeight, 2, 1);
  matte.metadata.mutable_monitors(0)->set_width_px(3840);
  const double a = 0.5 * kObject.width_px, b = 0.5 * kObject.height_px;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool inside =
          std::hypot((x + 0.5 - kObject.x_px - a) / a, (y + 0.5 - kObject.y_px - b) / b) <= 1.0;
      matte.coverage(x, y) = inside ? 1.0f : 0.0f;
      matte.flags(x, y) = static_cast<std::uint8_t>((x + y) % 7);
    }
  }
  return matte;
}

class DeliveryFile : public testing::Test {
 protected:
  DeliveryFile() { std::filesystem::create_directories(scratch_); }
  ~DeliveryFile() override { std::filesystem::remove_all(scratch_); }
  std::string path(const std::string& name) const { return (scratch_ / name).string(); }

  Delivery deliver(const Matte& matte, const DeliveryOptions& options, int threads = 2) const {
    const absl::StatusOr<Delivery> delivery =
        write_delivery(encode_matte(matte).value(), options, path("out.exr"), threads);
    EXPECT_OK(delivery);
    return delivery.value_or(Delivery());
  }
  Matte read() const {
    absl::StatusOr<Matte> matte = read_matte(path("out.exr"));
    EXPECT_OK(matte);
    return *std::move(matte);
  }
  Matte delivered(const Matte& matte, const DeliveryOptions& options) const {
    deliver(matte, options);
    return read();
  }

  const std::filesystem::path scratch_ =
      std::filesystem::path(testing::TempDir()) /
      fmt::format("delivery.{}.{}", ::getpid(),
                  testing::UnitTest::GetInstance()->current_test_info()->name());
};

// With the note of what was done.
Matte noted(Matte matte, const std::string& edit) {
  if (!edit.empty()) matte.metadata.add_edits(edit);
  return matte;
}

TEST_F(DeliveryFile, HoldsTheSameMatte) {
  for (const bool colourless : {false, true}) {
    Matte matte = vase();
    if (colourless) {
      Matte gray(0, 0, kWidth, kHeight, 2, true);
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) gray.copy_pixel(matte, x, y, x, y);
      }
      gray.metadata = matte.metadata;
      matte = gray;
    }
    for (const int tile : {0, 16, 32, kMaxTile_px}) {
      EXPECT_EQ(encode_matte(delivered(matte, {.tile_px = tile})).value(), encode_matte(matte).value())
          << tile;
    }
  }
}

// Rows that are read by several threads, and in blocks that begin between tiles.
TEST_F(DeliveryFile, IsReadByRows) {
  const Matte matte = noted(vase(), "deliver hug");
  for (const int tile : {0, 16, 24}) {
    deliver(vase(), {.hug = true, .tile_px = tile});
    const std::string bytes = read_file(path("out.exr")).value();
    const MatteOutline outline = outline_of(bytes).value();
    EXPECT_EQ(std::pair(outline.width_px, outline.height_px), std::pair(kWidth, kHeight));
    std::vector<int> seen(kHeight);
    std::mutex mutex;
    ASSERT_OK(for_blocks_of_matte(bytes, 3, [&](const Matte& rows) {
      for (int row = 0; row < rows.height_px(); ++row) {
        const int y = rows.y0_px() + row;
        for (int x = 0; x < kWidth; ++x) {
          EXPECT_EQ(rows.foreground(x, row),
                    is_object(x, y) ? matte.foreground(x, y) : (std::array<float, 3>{}));
        }
        const std::lock_guard lock(mutex);
        ++seen[y];
      }
      return absl::OkStatus();
    }));
    EXPECT_EQ(seen, std::vector<int>(kHeight, 1));
  }
}

TEST_F(DeliveryFile, WindowHugsTheObject) {
  const Matte matte = vase();
  for (const int tile : {0, 16}) {
    const Delivery delivery = deliver(matte, {.hug = true, .tile_px = tile});
    EXPECT_EQ(std::tuple(delivery.window.x0_px, delivery.window.y0_px, delivery.window.width_px,
                         delivery.window.height_px),
              std::tuple(kObject.x_px, kObject.y_px, kObject.width_px, kObject.height_px));
    EXPECT_EQ(delivery.bytes, std::filesystem::file_size(path("out.exr")));
    Matte expected(0, 0, kWidth, kHeight, 2);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        if (is_object(x, y)) expected.copy_pixel(matte, x, y, x, y);
      }
    }
    expected.metadata = matte.metadata;
    EXPECT_EQ(encode_matte(read()).value(), encode_matte(noted(expected, "deliver hug")).value());
  }
}

TEST_F(DeliveryFile, HugNeedsAnObject) {
  Matte matte = vase();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) matte.coverage(x, y) = 0.0f;
  }
  const std::string bytes = encode_matte(matte).value();
  EXPECT_EQ(write_delivery(bytes, {.hug = true}, path("out.exr")).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE(std::filesystem::is_empty(scratch_));
  EXPECT_OK(write_delivery(bytes, {}, path("out.exr")));
}

// half_channels.h: places stay, and every composite is within 2^-11 of its light.
TEST_F(DeliveryFile, HalvesMoveCompositesByLessThanTheirBound) {
  Matte matte = random_object(kWidth, kHeight, 8, 3);
  const Delivery delivery = deliver(matte, {.half = true});
  EXPECT_EQ(delivery.half_layers, (std::vector<std::string>{"preview", "F", "coverage", "flags", "centre_sd",
                                                            "texture", "weight", "weight_sd"}));
  const Matte half = read();
  EXPECT_EQ(half.metadata.edits(0), "deliver half");
  float largest = 0.0f;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        for (size_t m = 0; m < 8; ++m) {
          const Mode& was = matte.modes(x, y, c)[m];
          const Mode& is = half.modes(x, y, c)[m];
          EXPECT_EQ(std::tuple(is.x_px, is.y_px, is.xx_px2, is.xy_px2, is.yy_px2, is.texture),
                    std::tuple(was.x_px, was.y_px, was.xx_px2, was.xy_px2, was.yy_px2, was.texture));
          EXPECT_LE(std::abs(is.weight - was.weight), was.weight / 2048.0f);
          largest = std::max(largest, std::abs(is.weight - was.weight));
        }
      }
    }
  }
  EXPECT_GT(largest, 1e-4f);  // they are halves
  const std::vector<RadianceImage> pictures = random_pictures();
  const RadianceImage before = composite(matte, pictures).value(), after = composite(half, pictures).value();
  for (size_t i = 0; i < before.samples.size(); ++i)
    ASSERT_NEAR(after.samples[i], before.samples[i], before.samples[i] / 2048.0f + 1e-6f) << i;
}

TEST_F(DeliveryFile, ChannelsThatHalvesWouldHarmStay) {
  Matte matte = vase();
  matte.modes(3, 3, 1)[0].centre_sd_px = 1e-9f;  // would be 0, which is: not known
  matte.modes(3, 3, 0)[1].weight = 1e6f;         // would be infinite
  matte.foreground(1, 1)[2] = -1e5f;
  deliver(matte, {.half = true});
  const Matte half = read();
  EXPECT_EQ(half.modes(3, 3, 1)[0].centre_sd_px, 1e-9f);
  EXPECT_EQ(half.modes(3, 3, 0)[1].weight, 1e6f);
  EXPECT_EQ(half.foreground(1, 1)[2], -1e5f);
  EXPECT_NE(half.foreground(1, 1)[0], matte.foreground(1, 1)[0]);  // a channel of its own
}

TEST_F(DeliveryFile, IsTheSameFileByAnyNumberOfThreads) {
  for (const int tile : {0, 16}) {
    const DeliveryOptions options{.half = true, .hug = true, .tile_px = tile};
    deliver(vase(), options, 1);
    const std::string one = read_file(path("out.exr")).value();
    deliver(vase(), options, 4);
    EXPECT_EQ(read_file(path("out.exr")).value(), one);
  }
}

TEST_F(DeliveryFile, DamageIsFound) {
  for (const int tile : {0, 16}) {
    deliver(vase(), {.half = true, .hug = true, .tile_px = tile});
    const std::string bytes = read_file(path("out.exr")).value();
    int found = 0, tried = 0;
    for (size_t at = bytes.size() / 2; at < bytes.size(); at += 97, ++tried) {
      std::string damaged = bytes;
      damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
      const absl::StatusOr<Matte> matte = decode_matte(damaged);
      if (matte.ok() ? encode_matte(*matte).value() == encode_matte(read()).value()
                     : absl::IsDataLoss(matte.status()))
        ++found;
    }
    EXPECT_EQ(found, tried);
    for (size_t size = 0; size < bytes.size(); size += 211)
      EXPECT_FALSE(decode_matte(std::string_view(bytes).substr(0, size)).ok()) << size;
  }
}

// Attributes that would make a reader take memory for what the file does not hold.
TEST_F(DeliveryFile, HugeTilesAreRefused) {
  deliver(vase(), {.tile_px = 16});
  std::string bytes = read_file(path("out.exr")).value();
  using namespace std::string_literals;
  const std::string before = "tiles\0tiledesc\0\x09\0\0\0"s;
  const size_t at = bytes.find(before);
  ASSERT_NE(at, std::string::npos);
  const std::uint32_t side = 1u << 20;
  std::memcpy(&bytes[at + before.size()], &side, sizeof side);
  EXPECT_TRUE(absl::IsDataLoss(decode_matte(bytes).status()));
}

TEST_F(DeliveryFile, IsNoTile) {
  deliver(vase(), {});
  const PositionedFile file = PositionedFile::open(path("out.exr")).value();
  EXPECT_EQ(PackedMatteReader::open(file).status().code(), absl::StatusCode::kFailedPrecondition);
  const std::string bytes = read_file(path("out.exr")).value();
  PackedMatteWriter writer =
      PackedMatteWriter::begin(outline_of(encode_matte(vase()).value()).value(), [](auto, auto) {
        return absl::OkStatus();
      }).value();
  EXPECT_EQ(writer.add(bytes).code(), absl::StatusCode::kFailedPrecondition);
}

TEST_F(DeliveryFile, TilesHaveSides) {
  for (const int tile : {-1, 8, 257}) {
    EXPECT_EQ(
        write_delivery(encode_matte(vase()).value(), {.tile_px = tile}, path("out.exr")).status().code(),
        absl::StatusCode::kInvalidArgument);
  }
}

TEST_F(DeliveryFile, ExrheaderListsWhatIsWritten) {
  deliver(vase(), {.half = true, .hug = true, .tile_px = 16});
  const Said said = run_program("exrheader " + path("out.exr"));
  ASSERT_EQ(said.status, 0) << said.text;
  const auto count = [&said](const std::string& line) {
    int lines = 0;
    for (size_t at = said.text.find(line); at != std::string::npos; at = said.text.find(line, at + 1))
      ++lines;
    return lines;
  };
  EXPECT_EQ(count("type (type string): \"tiledimage\""), 4);
  EXPECT_EQ(count("tile size 16 by 16 pixels"), 4);
  EXPECT_EQ(count("dataWindow (type box2i): (5 9) - (27 29)"), 4);
  EXPECT_EQ(count("displayWindow (type box2i): (0 0) - (40 36)"), 4);
  EXPECT_EQ(count("colorInteropID (type string): \"unknown\""), 2);
  EXPECT_EQ(count("colorInteropID (type string): \"data\""), 2);
  EXPECT_EQ(count("chromaticities"), 0);
  EXPECT_EQ(count("oiio:ColorSpace"), 0);
  EXPECT_EQ(count("preview (type preview): 41 by 37 pixels"), 1);
  EXPECT_EQ(count("weight.R, 16-bit"), 2);
  EXPECT_EQ(count("foreground.F.R, 16-bit"), 1);
  for (const char* layer : {"x", "y", "xx", "xy", "yy"})
    EXPECT_EQ(count(fmt::format(".{}.R, 32-bit", layer)), 2) << layer;
}

// Calibrated monitors: then the preview, which is converted to their primaries, says that it is Rec. 709.
TEST_F(DeliveryFile, PreviewOfACalibratedRigIsOfPrimaries) {
  Matte matte = vase();
  // Red and green as the camera sees them are each other's; white stays white.
  for (int monitor = 0; monitor < 2; ++monitor) {
    v1::Crosstalk& seen = *matte.metadata.add_crosstalk();
    for (const double share : {0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0}) seen.add_share(share);
  }
  deliver(matte, {});
  const Said said = run_program("oiiotool -v --info -a --dumpdata " + path("out.exr"));
  ASSERT_EQ(said.status, 0) << said.text;
  EXPECT_NE(said.text.find("colorInteropID: \"lin_rec709_scene\""), std::string::npos);
  EXPECT_NE(said.text.find("oiio:ColorSpace: \"lin_rec709\""), std::string::npos);
  const std::string pixel = "Pixel (14, 19): ";
  std::istringstream values(said.text.substr(said.text.find(pixel) + pixel.size()));
  for (const int channel : {1, 0, 2}) {
    float light = matte.foreground(14, 19)[channel];
    for (const Mode& mode : matte.modes(14, 19, channel)) light += 0.5f * mode.weight;
    float found = 0.0f;
    values >> found;
    EXPECT_NEAR(found, light, 2e-6) << channel;
  }
}

// oiiotool unpacks tiles of 16 and 32 bits, of every part, to what scan lines hold, and to what we read.
TEST_F(DeliveryFile, OiiotoolReadsTheSameFromTiles) {
  deliver(vase(), {.half = true, .hug = true});
  std::filesystem::rename(path("out.exr"), path("lines.exr"));
  deliver(vase(), {.half = true, .hug = true, .tile_px = 16});
  const Said same = run_program(fmt::format("oiiotool -a {} {} --diff", path("lines.exr"), path("out.exr")));
  EXPECT_EQ(same.status, 0) << same.text;
  const Said said =
      run_program(fmt::format("oiiotool {} --subimage 3 --ch mode2.weight.R,mode2.x.R,mode2.yy.B -o {} && "
                              "oiiotool -v --info --dumpdata {}",
                              path("out.exr"), path("some.exr"), path("some.exr")));
  ASSERT_EQ(said.status, 0) << said.text;
  EXPECT_NE(said.text.find(fmt::format("full/display size: {} x {}", kWidth, kHeight)), std::string::npos);
  const Matte half = read();
  for (int y = kObject.y_px; y < kObject.y_px + kObject.height_px; ++y) {
    for (int x = kObject.x_px; x < kObject.x_px + kObject.width_px; ++x) {
      const std::string pixel = fmt::format("Pixel ({}, {}): ", x, y);
      const size_t at = said.text.find(pixel);
      ASSERT_NE(at, std::string::npos) << pixel;
      std::istringstream values(said.text.substr(at + pixel.size(), 60));
      float weight = 0.0f, x_px = 0.0f, yy_px2 = 0.0f;
      values >> weight >> x_px >> yy_px2;
      EXPECT_NEAR(weight, half.modes(x, y, 0)[1].weight, 2e-6);
      EXPECT_NEAR(x_px, half.modes(x, y, 0)[1].x_px, 2e-5);
      EXPECT_NEAR(yy_px2, half.modes(x, y, 2)[1].yy_px2, 2e-6);
    }
  }
}

TEST(HalfChannels, LayersAreNamedByTheirChannels) {
  EXPECT_EQ(layer_of("R"), "preview");
  EXPECT_EQ(layer_of("foreground.F.R"), "F");
  EXPECT_EQ(layer_of("mode8.centre_sd.Y"), "centre_sd");
}

}  // namespace
}  // namespace glasswing
