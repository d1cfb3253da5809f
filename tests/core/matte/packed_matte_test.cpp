#include "core/matte/packed_matte.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "core/file/file.h"
#include "tests/core/matte/random_matte.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// A part of a matte as a tile, pixel by pixel.
Matte part_of(const Matte& whole, const MatteRegion& region) {
  Matte part(region.x_px, region.y_px, region.width_px, region.height_px, whole.modes_per_channel(),
             whole.is_colourless());
  part.metadata = whole.metadata;
  for (int y = 0; y < region.height_px; ++y) {
    for (int x = 0; x < region.width_px; ++x) {
      const int from_x = region.x_px + x - whole.x0_px(), from_y = region.y_px + y - whole.y0_px();
      part.foreground(x, y) = whole.foreground(from_x, from_y);
      part.coverage(x, y) = whole.coverage(from_x, from_y);
      part.flags(x, y) = whole.flags(from_x, from_y);
      for (int c = 0; c < kChannels; ++c)
        std::ranges::copy(whole.modes(from_x, from_y, c), part.modes(x, y, c).begin());
    }
  }
  return part;
}

std::string rows_of(const Matte& whole, int first, int count) {
  return encode_matte(part_of(whole, {0, first, whole.width_px(), count})).value();
}

MattePart cut(const MatteRegion& region) {
  return {.region = region, .max_pixels = 0};
}

PackedMatteWriter::Put into(std::string& file) {
  return [&file](std::uint64_t offset, std::string_view bytes) {
    file.resize(std::max(file.size(), static_cast<size_t>(offset) + bytes.size()));
    std::ranges::copy(bytes, file.begin() + offset);
    return absl::OkStatus();
  };
}

absl::StatusOr<std::string> joined(const MatteOutline& whole, const std::vector<std::string>& tiles) {
  std::string file;
  absl::StatusOr<PackedMatteWriter> writer = PackedMatteWriter::begin(whole, into(file));
  absl::Status status = writer.status();
  for (const std::string& tile : tiles) {
    if (status.ok()) status = writer->add(tile);
  }
  if (status.ok()) status = writer->finish();
  return status.ok() ? absl::StatusOr<std::string>(file) : status;
}

class PackedMatteTest : public testing::Test {
 protected:
  void TearDown() override { fs::remove(path_); }
  PositionedFile file_of(const std::string& bytes) {
    std::ofstream(path_, std::ios::binary) << bytes;
    return PositionedFile::open(path_).value();
  }

  const fs::path path_ = fs::path(testing::TempDir()) / ("packed." + std::to_string(::getpid()) + ".exr");
};

TEST_F(PackedMatteTest, TilesMakeTheFileOfTheWhole) {
  for (const bool colourless : {false, true}) {
    const Matte whole = random_matte(0, 75, colourless);
    const std::string file = encode_matte(whole).value();
    const MatteOutline outline = outline_of(file).value();
    EXPECT_TRUE(
        joined(outline, {rows_of(whole, 0, 17), rows_of(whole, 17, 31), rows_of(whole, 48, 27)}).value() ==
        file);
    EXPECT_TRUE(joined(outline, {file}).value() == file);
  }
}

TEST_F(PackedMatteTest, TilesThatMakeNoWholeAreNamed) {
  const Matte whole = random_matte(0, 75);
  const MatteOutline outline = outline_of(encode_matte(whole).value()).value();
  const auto refused = [&](const std::vector<std::string>& tiles, const std::string& words) {
    const absl::Status status = joined(outline, tiles).status();
    EXPECT_TRUE(absl::IsDataLoss(status)) << status;
    EXPECT_NE(std::string(status.message()).find(words), std::string::npos) << status << " for " << words;
  };
  const std::string first = rows_of(whole, 0, 32);
  refused({}, "no tile covers row 0");
  refused({first}, "no tile covers row 32");
  refused({rows_of(whole, 16, 59)}, "no tile covers row 0");
  refused({first, rows_of(whole, 16, 59)}, "two tiles cover row 16");
  refused({first, rows_of(random_matte(0, 75, true), 32, 43)}, "different layers");
  refused({encode_matte(part_of(whole, {1, 0, 5, 32})).value()}, "partial rows");
  refused({first, rows_of(whole, 32, 43).substr(0, 3000)}, "damaged");
  refused({first, rows_of(random_matte(0, 80), 32, 48)}, "covers row 79, which is not in the picture");
}

// Headers that promise gigabytes make no file of that size.
TEST_F(PackedMatteTest, NoWholeIsLargerThanItsTiles) {
  Matte tile = random_matte(0, 2);
  tile.metadata.set_width_px(16384);
  tile.metadata.set_height_px(16384);
  const std::string bytes = encode_matte(tile).value();
  MatteOutline outline = outline_of(bytes).value();
  outline.height_px = 16384;
  EXPECT_TRUE(absl::IsDataLoss(joined(outline, {bytes}).status()));
}

TEST_F(PackedMatteTest, RowsOfAFileAreTheFileOfTheseRows) {
  for (const bool colourless : {false, true}) {
    const Matte whole = random_matte(0, 75, colourless);
    const PositionedFile file = file_of(encode_matte(whole).value());
    const PackedMatteReader reader = PackedMatteReader::open(file).value();
    EXPECT_EQ(reader.outline().height_px, 75);
    for (const auto& [first, count] :
         {std::pair(0, 75), std::pair(0, 1), std::pair(74, 1), std::pair(13, 40)})
      EXPECT_TRUE(reader.rows(first, count).value() == rows_of(whole, first, count)) << first;
  }
}

TEST_F(PackedMatteTest, ACroppedFileHoldsTheRegionsPixelsBitForBit) {
  for (const bool colourless : {false, true}) {
    const Matte whole = random_matte(0, 75, colourless);
    const PositionedFile file = file_of(encode_matte(whole).value());
    const PackedMatteReader reader = PackedMatteReader::open(file).value();
    for (const MatteRegion& region :
         {MatteRegion{0, 0, 6, 75}, {2, 0, 1, 75}, {0, 74, 6, 1}, {5, 33, 1, 1}, {1, 10, 4, 50}}) {
      std::string part;
      ASSERT_OK(write_part(reader, cut(region), into(part)));
      EXPECT_TRUE(part == encode_matte(part_of(whole, region)).value()) << region.x_px << " " << region.y_px;
      expect_same(decode_matte(part).value(), part_of(whole, region));
      // A part of the part.
      const MatteRegion corner{region.x_px + region.width_px - 1, region.y_px + region.height_px - 1, 1, 1};
      const PositionedFile part_file = file_of(part);
      std::string pixel;
      ASSERT_OK(write_part(PackedMatteReader::open(part_file).value(), cut(corner), into(pixel)));
      EXPECT_TRUE(pixel == encode_matte(part_of(whole, corner)).value());
      (void)file_of(encode_matte(whole).value());
    }
  }
}

// Of a region at (1, 10) every third pixel of every third row, each with its own values.
TEST_F(PackedMatteTest, ASampledFileHoldsEveryNthPixelBitForBit) {
  for (const bool colourless : {false, true}) {
    const Matte whole = random_matte(0, 75, colourless);
    const PositionedFile file = file_of(encode_matte(whole).value());
    const PackedMatteReader reader = PackedMatteReader::open(file).value();
    for (const auto& [region, max_pixels, step] : {std::tuple(MatteRegion{0, 0, 6, 75}, 450, 1),
                                                   {MatteRegion{0, 0, 6, 75}, 449, 2},
                                                   {MatteRegion{0, 0, 6, 75}, 1, 75},
                                                   {MatteRegion{1, 10, 5, 60}, 40, 3}}) {
      std::string bytes;
      ASSERT_OK(write_part(reader, {.region = region, .max_pixels = max_pixels}, into(bytes)));
      const Matte part = decode_matte(bytes).value();
      ASSERT_EQ(std::max(part.metadata.sampling_px(), 1), step);
      EXPECT_EQ(part.x0_px(), region.x_px / step);
      EXPECT_EQ(part.y0_px(), region.y_px / step);
      ASSERT_EQ(part.width_px(), (region.width_px - 1) / step + 1);
      ASSERT_EQ(part.height_px(), (region.height_px - 1) / step + 1);
      EXPECT_EQ(part.metadata.width_px(), (whole.metadata.width_px() - 1) / step + 1);
      for (int y = 0; y < part.height_px(); ++y) {
        for (int x = 0; x < part.width_px(); ++x) {
          const int from_x = region.x_px + x * step, from_y = region.y_px + y * step;
          EXPECT_EQ(part.foreground(x, y), whole.foreground(from_x, from_y));
          EXPECT_EQ(part.coverage(x, y), whole.coverage(from_x, from_y));
          EXPECT_EQ(part.flags(x, y), whole.flags(from_x, from_y));
          for (int c = 0; c < kChannels; ++c) {
            EXPECT_EQ(part.modes(x, y, c).back().x_px, whole.modes(from_x, from_y, c).back().x_px);
            EXPECT_EQ(part.modes(x, y, c).front().weight, whole.modes(from_x, from_y, c).front().weight);
          }
        }
      }
    }
  }
}

TEST_F(PackedMatteTest, RegionsBeyondThePictureAreRefused) {
  const PositionedFile file = file_of(encode_matte(random_matte(0, 75)).value());
  const PackedMatteReader reader = PackedMatteReader::open(file).value();
  for (const MatteRegion& region : {MatteRegion{0, 0, 7, 1},
                                    {0, 0, 1, 76},
                                    {6, 0, 1, 1},
                                    {0, 75, 1, 1},
                                    {-1, 0, 2, 2},
                                    {0, -1, 2, 2},
                                    {0, 0, 0, 1},
                                    {0, 0, 1, 0},
                                    {1 << 30, 0, 1 << 30, 1},
                                    {2, 2, 2147483647, 2147483647}}) {
    std::string part;
    const absl::Status status = write_part(reader, cut(region), into(part));
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
    EXPECT_NE(std::string(status.message()).find("6x75"), std::string::npos) << status;
  }
}

// A byte may be changed unnoticed only where no reader looks, or outside of the region.
TEST_F(PackedMatteTest, DamageWithinTheRegionIsRefused) {
  const Matte whole = random_matte(0, 8);
  const std::string good = encode_matte(whole).value();
  const MatteRegion region{1, 3, 3, 2};
  const std::string expected = encode_matte(part_of(whole, region)).value();
  int refused = 0, outside = 0;
  for (size_t at = 0; at < good.size(); at += 11) {
    std::string altered = good;
    altered[at] = static_cast<char>(altered[at] ^ (1 << (at % 8)));
    const PositionedFile file = file_of(altered);
    const absl::StatusOr<PackedMatteReader> reader = PackedMatteReader::open(file);
    std::string part;
    const bool made = reader.ok() && write_part(*reader, cut(region), into(part)).ok();
    (made ? outside : refused) += 1;
    EXPECT_TRUE(!made || part == expected) << "byte " << at;
  }
  EXPECT_GT(refused, 0);
  EXPECT_GT(outside, 0);  // rows above and below are not read
}

TEST_F(PackedMatteTest, NoTruncatedFileIsTakenForTheWhole) {
  const std::string good = encode_matte(random_matte(0, 8)).value();
  for (size_t size = 0; size < good.size(); size += 11) {
    const PositionedFile file = file_of(good.substr(0, size));
    const absl::StatusOr<PackedMatteReader> reader = PackedMatteReader::open(file);
    std::string part;
    EXPECT_FALSE(reader.ok() && write_part(*reader, cut({0, 0, 6, 8}), into(part)).ok()) << size;
  }
}

TEST(MatteRegion, IsReadFromText) {
  EXPECT_EQ(parse_region("640x480+100+50").value(), (MatteRegion{100, 50, 640, 480}));
  EXPECT_EQ(parse_region("1x1+0+0").value(), (MatteRegion{0, 0, 1, 1}));
  for (const char* text : {"", "640x480", "640x480+1", "640x480+1+", "640x480+1+2+3", "640x480+1+2 ",
                           " 1x1+0+0", "0x480+1+2", "640x0+1+2", "640x480+-1+2", "640x480+1-2", "-1x1+0+0",
                           "99999999999x1+0+0", "640X480+1+2", "1.5x1+0+0"}) {
    const absl::Status status = parse_region(text).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << text;
    EXPECT_NE(std::string(status.message()).find("WIDTHxHEIGHT+X+Y"), std::string::npos) << status;
  }
}

}  // namespace
}  // namespace glasswing
