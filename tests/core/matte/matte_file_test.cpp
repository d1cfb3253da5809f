#include "core/matte/matte_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "core/matte/matte_layers.h"
#include "tests/core/file/flipped.h"
#include "tests/core/image/exr_of_parts.h"
#include "tests/core/matte/random_matte.h"

namespace glasswing {
namespace {

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

TEST(MatteFile, ThousandsOfPartsAreRefusedBeforeTheyAreRead) {
  EXPECT_EQ(decode_matte(exr_of_parts(20'000)).status(), absl::DataLossError("it has more than 64 parts"));
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
  refused([](Matte& m) { m.metadata.set_footprint("box"); }, "values that no matte can have");  // xy is not 0
  refused([](Matte& m) { m.foreground(3, 0)[1] = INFINITY; }, "pixel (3, 0)");
}

// The pixels of one row are another matte's, everything else matches.
TEST(MatteFile, ARowThatIsNotTheFilesOwnIsNamed) {
  const Matte matte = random_matte(32, 40);
  Matte other = matte;
  other.modes(5, 37, 0)[1].yy_px2 += 1.0f;  // the picture's row 69
  const std::string good = encode_matte(matte).value(), strange = encode_matte(other).value();
  const std::string rows = "glasswing:rows";
  const size_t after_head = good.find(rows) + rows.size() + sizeof "string" + 1 + 4 + 40 * kRowChecksumDigits;
  const auto differ = std::mismatch(good.begin() + after_head, good.end(), strange.begin() + after_head);
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
