#include "core/matte/matte_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "core/matte/join_mattes.h"
#include "core/matte/matte_layers.h"
#include "tests/core/base/flipped.h"

namespace glasswing {
namespace {

Matte random_matte(int y0, int height, bool colourless = false) {
  std::mt19937 random(static_cast<unsigned>(y0 + 1));
  std::uniform_real_distribution<float> value(0.0f, 100.0f);
  Matte matte(0, y0, 6, height, 2, colourless);
  matte.metadata.set_format_version(1);
  matte.metadata.set_session("s");
  matte.metadata.set_width_px(6);
  matte.metadata.set_height_px(std::max(5, y0 + height));
  matte.metadata.add_monitors()->set_name("back");
  matte.metadata.add_monitors()->set_name("left");
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < 6; ++x) {
      matte.coverage(x, y) = static_cast<float>(x % 2);
      matte.flags(x, y) = static_cast<std::uint8_t>(random() % 16);
      for (int c = 0; c < 3; ++c) {
        matte.foreground(x, y)[static_cast<size_t>(c)] = value(random);
        for (Mode& mode : matte.modes(x, y, c)) {
          mode = {value(random),
                  value(random) - 50.0f,
                  value(random),
                  value(random),
                  value(random),
                  value(random),
                  static_cast<std::int32_t>(random() % 2)};
        }
      }
    }
  }
  return matte;
}

void expect_same(const Matte& a, const Matte& b) {
  ASSERT_EQ(a.modes_per_channel(), b.modes_per_channel());
  for (int y = 0; y < a.height_px(); ++y) {
    for (int x = 0; x < a.width_px(); ++x) {
      EXPECT_EQ(a.foreground(x, y), b.foreground(x, y));
      EXPECT_EQ(a.coverage(x, y), b.coverage(x, y));
      EXPECT_EQ(a.flags(x, y), b.flags(x, y));
      for (int c = 0; c < 3; ++c) {
        for (size_t m = 0; m < a.modes(x, y, c).size(); ++m) {
          const Mode &p = a.modes(x, y, c)[m], &q = b.modes(x, y, c)[m];
          EXPECT_TRUE(p.weight == q.weight && p.x_px == q.x_px && p.y_px == q.y_px && p.xx_px2 == q.xx_px2 &&
                      p.xy_px2 == q.xy_px2 && p.yy_px2 == q.yy_px2 && p.texture == q.texture);
        }
      }
    }
  }
}

TEST(MatteFile, RoundTripsBitForBitAndDeterministically) {
  const Matte matte = random_matte(2, 3);
  const std::string bytes = encode_matte(matte).value();
  EXPECT_EQ(bytes, encode_matte(matte).value());
  const Matte back = decode_matte(bytes).value();
  EXPECT_EQ(back.y0_px(), 2);
  EXPECT_EQ(back.metadata.SerializeAsString(), matte.metadata.SerializeAsString());
  expect_same(matte, back);
}

TEST(MatteFile, ColourlessModesAreStoredOnce) {
  const Matte matte = random_matte(0, 5, true);
  const std::string bytes = encode_matte(matte).value();
  const Matte back = decode_matte(bytes).value();
  EXPECT_TRUE(back.is_colourless());
  expect_same(matte, back);
  EXPECT_EQ(back.modes(3, 2, 0).data(), back.modes(3, 2, 2).data());
  EXPECT_LT(bytes.size(), encode_matte(random_matte(0, 5)).value().size());
}

// Some rows of a matte as a tile.
Matte rows_of(const Matte& whole, int first, int count) {
  Matte tile(0, first, whole.width_px(), count, whole.modes_per_channel(), whole.is_colourless());
  tile.metadata = whole.metadata;
  for (int y = 0; y < count; ++y) {
    for (int x = 0; x < whole.width_px(); ++x) {
      tile.foreground(x, y) = whole.foreground(x, first + y);
      tile.coverage(x, y) = whole.coverage(x, first + y);
      tile.flags(x, y) = whole.flags(x, first + y);
      for (int c = 0; c < kChannels; ++c)
        std::ranges::copy(whole.modes(x, first + y, c), tile.modes(x, y, c).begin());
    }
  }
  return tile;
}

absl::StatusOr<std::string> joined(const std::vector<std::string>& tiles) {
  return join_mattes(std::vector<std::string_view>(tiles.begin(), tiles.end()));
}

TEST(MatteFile, TilesInAnyOrderMakeTheFileOfTheWhole) {
  for (const bool colourless : {false, true}) {
    const Matte whole = random_matte(0, 75, colourless);
    std::vector<std::string> tiles;
    for (const auto& [first, count] : {std::pair(48, 27), std::pair(0, 17), std::pair(17, 31)})
      tiles.push_back(encode_matte(rows_of(whole, first, count)).value());
    const std::string file = encode_matte(whole).value();
    EXPECT_TRUE(joined(tiles).value() == file);
    EXPECT_TRUE(joined({file}).value() == file);
  }
}

TEST(MatteFile, TilesThatMakeNoWholeAreNamed) {
  const Matte whole = random_matte(0, 75);
  const auto tile = [&](int first, int count) { return encode_matte(rows_of(whole, first, count)).value(); };
  const auto refused = [&](const std::vector<std::string>& tiles, const std::string& words) {
    const absl::Status status = joined(tiles).status();
    EXPECT_NE(std::string(status.message()).find(words), std::string::npos) << status << " for " << words;
  };
  refused({}, "no tile");
  refused({tile(0, 32)}, "no tile covers row 32");
  refused({tile(16, 59)}, "no tile covers row 0");
  refused({tile(0, 32), tile(16, 59)}, "two tiles cover row 16");
  refused({tile(0, 32), encode_matte(rows_of(random_matte(0, 75, true), 32, 43)).value()}, "other layers");
  refused({tile(0, 32), tile(32, 43).substr(0, 3000)}, "damaged");
  Matte taller = random_matte(0, 80);
  refused({tile(0, 32), encode_matte(rows_of(taller, 32, 48)).value()},
          "covers row 79, which the picture has not");
}

// Truncated anywhere, or with any sampled bit flipped, a file is refused or decodes to the same matte: never
// a crash, never another matte.
TEST(MatteFile, DamageIsSeen) {
  const Matte matte = random_matte(0, 2);
  const std::string good = encode_matte(matte).value();
  for (size_t length = 0; length + 1 < good.size(); length += 7) {
    EXPECT_FALSE(decode_matte(good.substr(0, length)).ok()) << length;
  }
  for (size_t i = 0; i < good.size(); i += 3) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ (1 << (i % 8)));
    const absl::StatusOr<Matte> read = decode_matte(bad);
    if (read.ok()) expect_same(matte, *read);
  }
}

// With matching checksums: only the headers are wrong.
TEST(MatteFile, WhatItSaysOfItselfIsNotBelieved) {
  const auto refused = [](const std::function<void(Matte&)>& change, const std::string& words) {
    Matte matte = random_matte(0, 2);
    change(matte);
    const absl::Status status = decode_matte(encode_matte(matte).value()).status();
    EXPECT_NE(std::string(status.message()).find(words), std::string::npos) << status << " for " << words;
  };
  refused([](Matte& m) { m.metadata.set_width_px(1000000); }, "picture of 1000000x5");
  refused([](Matte& m) { m.metadata.set_width_px(-1); }, "picture of -1x5");
  refused([](Matte& m) { m.metadata.set_height_px(1); }, "pixels up to (5, 1)");
  refused([](Matte& m) { m.metadata.set_format_version(2); }, "format_version is 2");
  refused(
      [](Matte& m) {
        for (int i = 0; i < 5000; ++i) m.metadata.add_monitors();
      },
      "names 5002 monitors");
  refused([](Matte& m) { m.modes(5, 1, 2)[1].texture = 2; }, "pixel (5, 1)");
  refused([](Matte& m) { m.metadata.set_footprint("disc"); }, "footprints are \"disc\"");
  refused([](Matte& m) { m.metadata.set_footprint("box"); }, "values that no matte has");  // xy is not 0
  refused([](Matte& m) { m.foreground(3, 0)[1] = INFINITY; }, "pixel (3, 0)");
}

// A header that promises gigabytes is refused, since its tiles do not cover it.
TEST(MatteFile, NoWholeIsLargerThanItsTiles) {
  Matte tile = random_matte(0, 2);
  tile.metadata.set_width_px(16384);
  tile.metadata.set_height_px(16384);
  const absl::Status status = joined({encode_matte(tile).value()}).status();
  EXPECT_NE(std::string(status.message()).find("row 0"), std::string::npos) << status;
}

// The pixels of one row are another matte's, everything else matches.
TEST(MatteFile, ARowThatIsNotTheFilesOwnIsNamed) {
  const Matte matte = random_matte(32, 40);
  Matte other = matte;
  other.modes(5, 37, 0)[1].yy_px2 += 1.0f;  // the picture's row 69
  const std::string good = encode_matte(matte).value(), strange = encode_matte(other).value();
  const std::string rows = "glasswing:rows";
  const size_t after_head = good.find(rows) + rows.size() + sizeof "string" + 1 + 4 + 40 * kRowChecksumDigits;
  const auto differ = std::mismatch(good.begin() + static_cast<std::ptrdiff_t>(after_head), good.end(),
                                    strange.begin() + static_cast<std::ptrdiff_t>(after_head));
  std::string mixed(good.begin(), differ.first);
  mixed.append(differ.second, strange.end());
  const absl::Status status = decode_matte(mixed).status();
  EXPECT_NE(std::string(status.message()).find("row 69"), std::string::npos) << status;
}

TEST(MatteFile, TheOutlineIsTold) {
  const MatteOutline outline = outline_of(encode_matte(random_matte(32, 40, true)).value()).value();
  EXPECT_EQ(outline.y0_px, 32);
  EXPECT_EQ(outline.height_px, 40);
  EXPECT_EQ(outline.modes_per_channel, 2);
  EXPECT_TRUE(outline.colourless);
}

TEST(MatteFile, NoByteIsAlteredUnnoticed) {
  const Matte matte = random_matte(0, 5);
  const std::string bytes = encode_matte(matte).value();
  int refused = 0;
  for_each_flip(bytes, 0, 1, [&](const std::string& altered, size_t at) {
    const absl::StatusOr<Matte> read = decode_matte(altered);
    EXPECT_EQ(verify_matte(altered).ok(), read.ok()) << "byte " << at;
    refused += !read.ok();
    if (!read.ok()) return;
    EXPECT_EQ(read->metadata.SerializeAsString(), matte.metadata.SerializeAsString()) << "byte " << at;
    expect_same(*read, matte);
  });
  EXPECT_GT(refused, 0);
}

}  // namespace
}  // namespace glasswing
