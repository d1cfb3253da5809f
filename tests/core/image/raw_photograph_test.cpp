// Raw photographs against LibRaw's own program, unprocessed_raw, and against what was written.
#include "core/image/raw_photograph.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

#include "core/image/image_file.h"
#include "tests/core/image/dng.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class RawPhotographs : public testing::Test {
 protected:
  fs::path written(const Dng& dng, const std::string& name = "a.dng") const {
    write_dng(directory_ / name, dng);
    return directory_ / name;
  }
  static absl::StatusOr<RawPhotograph> decoded(const fs::path& path) {
    return decode_raw(read_file(path).value());
  }
  // The whole sensor's codes, as unprocessed_raw writes them.
  static std::vector<std::uint16_t> unprocessed(const fs::path& dng) {
    EXPECT_EQ(
        std::system(fmt::format("unprocessed_raw -T {} > {}.log 2>&1", dng.string(), dng.string()).c_str()),
        0);
    TIFF* const file = TIFFOpen((dng.string() + ".tiff").c_str(), "r");
    if (file == nullptr) return {};
    std::uint32_t width = 0, height = 0;
    TIFFGetField(file, TIFFTAG_IMAGEWIDTH, &width);
    TIFFGetField(file, TIFFTAG_IMAGELENGTH, &height);
    std::vector<std::uint16_t> codes(size_t{width} * height);
    for (std::uint32_t y = 0; y < height; ++y) TIFFReadScanline(file, codes.data() + size_t{y} * width, y, 0);
    TIFFClose(file);
    return codes;
  }

  const TemporaryDirectory directory_;
};

// Noise of all codes, of a sensor with an odd number of columns where its bits allow it.
Dng noise(int bits, std::string_view mosaic) {
  Dng dng{.width_px = 64, .height_px = 46, .codes = {}, .bits = bits, .mosaic = mosaic};
  dng.white = (1u << bits) - 1;
  std::mt19937 random(static_cast<unsigned>(bits));
  for (int i = 0; i < dng.width_px * dng.height_px; ++i)
    dng.codes.push_back(static_cast<std::uint16_t>(random() % (dng.white + 1)));
  return dng;
}

TEST_F(RawPhotographs, AreEqualToTheLastCodeInEveryLayout) {
  for (const std::string_view mosaic : {"RGGB", "BGGR", "GRBG", "GBRG"}) {
    for (const int bits : {8, 12, 14, 16}) {
      for (const bool bordered : {false, true}) {
        SCOPED_TRACE(fmt::format("{} of {} bits{}", mosaic, bits, bordered ? ", with borders" : ""));
        Dng dng = noise(bits, mosaic);
        dng.black = {static_cast<float>(bits == 8 ? 12 : 200)};
        const std::array<std::uint32_t, 4> active{4, 6, 44, 60};  // top, left, bottom, right
        if (bordered) dng.active = active;
        const fs::path path = written(dng);
        const absl::StatusOr<RawPhotograph> raw = decoded(path);
        ASSERT_OK(raw);
        EXPECT_EQ(raw->mosaic, mosaic);
        EXPECT_EQ(raw->black, static_cast<int>(dng.black[0]));
        EXPECT_EQ(raw->white, static_cast<int>(dng.white));
        const std::vector<std::uint16_t> all = unprocessed(path);
        ASSERT_EQ(all, dng.codes);
        const int left = bordered ? 6 : 0, top = bordered ? 4 : 0;
        ASSERT_EQ(raw->codes.width_px, bordered ? 54 : dng.width_px);
        ASSERT_EQ(raw->codes.height_px, bordered ? 40 : dng.height_px);
        int differing = 0;
        for (int y = 0; y < raw->codes.height_px; ++y) {
          for (int x = 0; x < raw->codes.width_px; ++x)
            differing += raw->codes.at(x, y, 0) != all[(y + top) * dng.width_px + x + left];
        }
        EXPECT_EQ(differing, 0);
      }
    }
  }
}

TEST_F(RawPhotographs, OfTilesLosslessJpegsAndGreySensorsAreTheSame) {
  for (const int bits : {8, 12, 14, 16}) {
    for (const int tile_px : {0, 32}) {
      for (const bool jpeg : {false, true}) {
        for (const bool mono : {false, true}) {
          SCOPED_TRACE(fmt::format("{} bits, tiles of {} px, jpeg {}, mono {}", bits, tile_px, jpeg, mono));
          Dng dng = noise(bits, "RGGB");
          dng.tile_px = tile_px;
          dng.jpeg = jpeg;
          dng.mono = mono;
          const fs::path path = written(dng);
          const absl::StatusOr<RawPhotograph> raw = decoded(path);
          if (tile_px > 0 && !jpeg) {  // LibRaw 0.20 reads them as if they were rows
            EXPECT_TRUE(absl::IsDataLoss(raw.status())) << raw.status();
            continue;
          }
          ASSERT_OK(raw);
          EXPECT_EQ(raw->mosaic, mono ? "" : "RGGB");
          ASSERT_EQ(raw->codes.samples.size(), dng.codes.size());
          int differing = 0;
          for (size_t i = 0; i < dng.codes.size(); ++i) differing += raw->codes.samples[i] != dng.codes[i];
          EXPECT_EQ(differing, 0);
          EXPECT_EQ(unprocessed(path), dng.codes);
        }
      }
    }
  }
}

TEST_F(RawPhotographs, AreScaledSoThatEachCodeIsKeptAndWhiteIsFullScale) {
  for (const int bits : {8, 12, 14, 16}) {
    Dng dng = noise(bits, "GRBG");
    dng.black = {16.0f};
    const CodedPhotograph photograph = read_photograph(written(dng)).value();
    EXPECT_TRUE(photograph.raw);
    EXPECT_EQ(photograph.bits, bits);
    EXPECT_EQ(photograph.mosaic, "GRBG");
    EXPECT_DOUBLE_EQ(photograph.black_level, 16.0 / dng.white);
    for (size_t i = 0; i < dng.codes.size(); ++i) {
      const double code = photograph.codes.samples[i] * static_cast<double>(dng.white) / 65535.0;
      ASSERT_EQ(std::lround(code), dng.codes[i]) << bits << " bits";
    }
  }
}

TEST_F(RawPhotographs, CodesBelowBlackStayAndThoseAboveWhiteAreSaturated) {
  Dng dng = noise(12, "RGGB");
  dng.black = {256.0f};
  dng.white = 4000;
  dng.codes[0] = 3;
  dng.codes[1] = 4095;
  dng.codes[2] = 4000;
  const RawPhotograph raw = decoded(written(dng)).value();
  EXPECT_EQ(raw.codes.samples[0], 3);
  EXPECT_EQ(raw.codes.samples[1], 4095);
  const CodedPhotograph photograph = read_photograph(written(dng)).value();
  EXPECT_EQ(photograph.codes.samples[0], std::lround(65535.0 * 3 / 4000));
  EXPECT_EQ(photograph.codes.samples[1], 65535);
  EXPECT_EQ(photograph.codes.samples[2], 65535);
}

TEST_F(RawPhotographs, BlackLevelsOfEachPhotositeAreMadeOne) {
  Dng dng = noise(12, "RGGB");
  dng.black = {100.0f, 104.0f, 110.0f, 102.0f};
  for (std::uint16_t& code : dng.codes) code = std::min<std::uint16_t>(code, 4000);
  const RawPhotograph raw = decoded(written(dng)).value();
  EXPECT_EQ(raw.black, 110);
  for (int y = 0; y < dng.height_px; ++y) {
    for (int x = 0; x < dng.width_px; ++x) {
      const size_t at = y * dng.width_px + x;
      const auto black = static_cast<int>(dng.black[y % 2 * 2 + x % 2]);
      ASSERT_EQ(raw.codes.samples[at] - raw.black, dng.codes[at] - black) << x << " " << y;
    }
  }
}

TEST_F(RawPhotographs, LinearisationTablesAreApplied) {
  Dng dng = noise(8, "RGGB");
  for (unsigned code = 0; code < 256; ++code)
    dng.linearisation.push_back(static_cast<std::uint16_t>(code * code / 16));
  dng.white = 255 * 255 / 16;
  const fs::path path = written(dng);
  const RawPhotograph raw = decoded(path).value();
  EXPECT_EQ(raw.codes.samples, unprocessed(path));
  for (size_t i = 0; i < dng.codes.size(); ++i)
    ASSERT_EQ(raw.codes.samples[i], dng.codes[i] * dng.codes[i] / 16);
}

TEST_F(RawPhotographs, LieAsTheSensorDoesAndTellTheirExposure) {
  Dng dng = noise(14, "RGGB");
  dng.orientation = 6;  // turned by a quarter
  dng.exposure_s = 1.0 / 64.0;
  dng.iso = 400;
  const fs::path path = written(dng);
  const RawPhotograph raw = decoded(path).value();
  EXPECT_EQ(raw.codes.samples, dng.codes);
  EXPECT_TRUE(raw.facts.turned);
  ASSERT_TRUE(raw.facts.exposure_ms && raw.facts.iso);
  EXPECT_NEAR(*raw.facts.exposure_ms, 15.625, 1e-3);
  EXPECT_EQ(*raw.facts.iso, 400.0);
  EXPECT_EQ(exposure_noted_in(path), raw.facts.exposure_ms);
}

TEST_F(RawPhotographs, FilesThatAreCutOffAreRefusedByName) {
  for (const int bits : {8, 12, 14, 16}) {
    const fs::path path = written(noise(bits, "RGGB"));
    const std::string whole = read_file(path).value();
    // libtiff writes the directory first or last; a cut into either must be noticed.
    for (size_t size = 0; size + 1 < whole.size(); size += 1 + whole.size() / 30) {
      const fs::path part = directory_ / "part.dng";
      ASSERT_TRUE(write_file_durably(part, whole.substr(0, size)).ok());
      const absl::Status status = read_photograph(part).status();
      ASSERT_TRUE(absl::IsDataLoss(status))
          << bits << " bits, " << size << " of " << whole.size() << " " << status;
      EXPECT_THAT(std::string(status.message()), HasSubstr(part.string()));
    }
  }
}

TEST_F(RawPhotographs, OtherFilesAreRefusedWithAReason) {
  const fs::path none = directory_ / "none.nef";
  ASSERT_TRUE(write_file_durably(none, "no photograph").ok());
  EXPECT_THAT(std::string(read_photograph(none).status().message()), HasSubstr(none.string()));
  Dng odd = noise(12, "RGBG");
  EXPECT_THAT(std::string(decoded(written(odd)).status().message()), HasSubstr("a pattern other than RGGB"));
  Dng white = noise(12, "RGGB");
  white.black = {4000.0f};
  white.white = 4000;
  EXPECT_THAT(std::string(decoded(written(white)).status().message()), HasSubstr("white"));
}

}  // namespace
}  // namespace glasswing
