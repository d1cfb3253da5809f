// A mesh of kinds of pictures, written by oiiotool: each is read as oiiotool reads it, or refused by name;
// none is read otherwise. And the odd files of GLASSWING_DATA/odd, where they are.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status.h"
#include "core/file/file.h"
#include "core/image/image_file.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// The same TIFF 6.0, uncompressed, of one strip and of whole bytes, in the other byte order.
std::string big_endian_of(std::string bytes) {
  const auto number = [&](size_t at, size_t size) {
    size_t value = 0;
    for (size_t i = size; i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
    return value;
  };
  const auto swap = [&](size_t at, size_t size) {
    std::reverse(bytes.begin() + at, bytes.begin() + at + size);
  };
  constexpr size_t kEntry = 12;
  const size_t directory = number(4, 4), count = number(directory, 2);
  size_t sample = 1, begin = 0, length = 0;
  std::vector<std::pair<size_t, size_t>> swaps{{2, 2}, {4, 4}, {directory, 2}};
  for (size_t entry = directory + 2; entry < directory + 2 + count * kEntry; entry += kEntry) {
    const size_t tag = number(entry, 2), type = number(entry + 2, 2);
    // BYTE, ASCII, SHORT, LONG, and RATIONAL, which is two LONG.
    const size_t size = type <= 2 ? 1 : type == 3 ? 2 : 4;
    const size_t values = number(entry + 4, 4) * (type == 5 ? 2 : 1);
    const bool inside = size * values <= 4;
    const size_t place = inside ? entry + 8 : number(entry + 8, 4);
    for (size_t i = 0; i < values; ++i) swaps.emplace_back(place + i * size, size);
    if (!inside) swaps.emplace_back(entry + 8, 4);
    swaps.insert(swaps.end(), {{entry, 2}, {entry + 2, 2}, {entry + 4, 4}});
    if (tag == 258) sample = number(place, 2) / 8;
    if (tag == 273) begin = number(place, size);
    if (tag == 279) length = number(place, size);
  }
  for (size_t at = begin; at < begin + length; at += sample) swaps.emplace_back(at, sample);
  for (const auto& [at, size] : swaps) swap(at, size);
  bytes[0] = bytes[1] = 'M';
  return bytes;
}

class ForeignPictures : public testing::Test {
 protected:
  void SetUp() override {
    if (std::system("command -v oiiotool >/dev/null") != 0) GTEST_SKIP() << "oiiotool is not installed";
    RadianceImage image(24, 17);
    std::mt19937 random(7);
    std::uniform_real_distribution<float> light(0.0f, 1.0f);
    for (float& sample : image.samples) sample = light(random);
    const absl::Status written = write_radiance(at("source.exr"), image, Encoding::kLinear);
    ASSERT_OK(written);
  }
  fs::path at(const std::string& name) const { return directory_ / name; }

  struct Kind {
    std::string options;  // of oiiotool, for writing
    std::string name;     // "tif"
    double tolerance = 0.0;
    bool refused = false;
    std::string shown{};         // what oiiotool does with what it reads
    std::string before_read{};   // and how it reads
    bool as_the_sensor = false;  // by read_photograph()
    bool big_endian = false;     // the file is rewritten so
  };

  // "oiiotool source.exr OPTIONS -o NAME" of each, as we read it, and as oiiotool does.
  void expect_alike(const std::vector<Kind>& kinds) {
    std::string write = "oiiotool", read = "oiiotool";
    for (size_t i = 0; i < kinds.size(); ++i) {
      const Kind& kind = kinds[i];
      // oiiotool goes on with what it was told for the file before.
      write +=
          fmt::format(" source.exr --scanline --planarconfig contig {} -o {}.{}", kind.options, i, kind.name);
      read += fmt::format(" {} {}.{} {} --croptofull --ch 0,1,2 --chnames R,G,B -d float -o {}.exr",
                          kind.before_read, i, kind.name, kind.shown, expected(i));
    }
    run(write);
    for (size_t i = 0; i < kinds.size(); ++i) {
      const fs::path file = at(fmt::format("{}.{}", i, kinds[i].name));
      if (!kinds[i].big_endian) continue;
      const absl::Status written = write_file_durably(file, big_endian_of(read_file(file).value()));
      ASSERT_OK(written);
    }
    run(read);
    for (size_t i = 0; i < kinds.size(); ++i) {
      SCOPED_TRACE(fmt::format("{} -o {}.{}", kinds[i].options, i, kinds[i].name));
      expect_alike(kinds[i], i);
    }
  }

  void run(const std::string& command) const {
    ASSERT_EQ(std::system(fmt::format("cd {} && {} >log 2>&1", directory_.string(), command).c_str()), 0)
        << read_file(at("log")).value();
  }

  static std::string expected(size_t kind) { return fmt::format("expected_{}", kind); }

  void expect_alike(const Kind& kind, size_t number) const {
    const fs::path file = at(fmt::format("{}.{}", number, kind.name));
    const absl::StatusOr<RadianceImage> ours =
        kind.as_the_sensor ? light_of(read_photograph(file)) : read_radiance(file, Encoding::kLinear);
    ASSERT_EQ(!ours.ok(), kind.refused) << ours.status();
    if (kind.refused) return;
    const RadianceImage theirs = read_radiance(at(expected(number) + ".exr"), Encoding::kLinear).value();
    ASSERT_EQ(ours->width_px, theirs.width_px);
    ASSERT_EQ(ours->height_px, theirs.height_px);
    for (size_t i = 0; i < theirs.samples.size(); ++i)
      ASSERT_NEAR(ours->samples[i], theirs.samples[i], kind.tolerance) << i;
  }

  static absl::StatusOr<RadianceImage> light_of(const absl::StatusOr<CodedPhotograph>& photograph) {
    GW_RETURN_IF_ERROR(photograph.status());
    RadianceImage light(photograph->codes.width_px, photograph->codes.height_px);
    std::ranges::transform(photograph->codes.samples, light.samples.begin(),
                           [](std::uint16_t code) { return static_cast<float>(code) / 65535.0f; });
    return light;
  }

  const TemporaryDirectory directory_;
};

constexpr const char* kGray = "--ch 0,0,0";

// Half a code, and what float rounds it to.
double half_a_code(int bits) {
  return 0.5 / (std::exp2(bits) - 1.0) + 1e-6;
}

TEST_F(ForeignPictures, OpenExrOfAnyWindowDepthAndCompression) {
  std::vector<Kind> kinds;
  for (const char* window : {"", "--fullsize 40x30-5-6", "--crop 12x9+4+3", "--fullsize 12x9+4+3",
                             "--origin +7-3 --fullsize 24x17+7-3"}) {
    kinds.push_back({fmt::format("{} -d half --compression zip", window), "exr"});
    kinds.push_back({fmt::format("{} -d float --compression piz --tile 8 8", window), "exr"});
  }
  for (const char* compression : {"none", "zips", "rle"})
    kinds.push_back({fmt::format("-d half --compression {}", compression), "exr"});
  expect_alike(kinds);
}

TEST_F(ForeignPictures, TiffsOfAnyDepthChannelsAndLayout) {
  struct Depth {
    const char* name;
    double tolerance;
  };
  constexpr const char* kBigEndian = "--compression none";
  constexpr const char* kPlanes = "--compression none --planarconfig separate";
  constexpr const char* kTiles = "--compression zip --tile 16 16";
  std::vector<Kind> kinds;
  for (const int channels : {1, 2, 3, 4}) {
    constexpr std::array kNames{"R", "R,A=0.5", "R,G,B", "R,G,B,A=0.5"};
    for (const Depth& depth : {Depth{"uint8", half_a_code(8)},
                               {"uint10", half_a_code(10)},
                               {"uint12", half_a_code(12)},
                               {"uint16", half_a_code(16)},
                               {"uint32", 0.0},
                               {"float", 0.0},
                               {"double", 0.0}}) {
      const std::string name = depth.name;
      const bool eight = name == "uint8";
      for (const std::string layout : {kBigEndian, "--compression lzw", "--compression packbits",
                                       "--compression none --attrib tiff:bigtiff 1", kPlanes, kTiles}) {
        // oiiotool interleaves codes of 10 and 12 bits all the same.
        const bool planes = layout == kPlanes && channels > 1 && (name == "uint16" || name == "float");
        const bool refused =
            name == "uint32" || name == "double" || planes || (channels == 2 && (!eight || layout == kTiles));
        kinds.push_back({.options = fmt::format("--ch {} -d {} {}", kNames[channels - 1], name, layout),
                         .name = "tif",
                         .tolerance = depth.tolerance,
                         .refused = refused,
                         .shown = channels < 3 ? kGray : "",
                         .big_endian = layout == kBigEndian && name != "uint10" && name != "uint12"});
      }
    }
  }
  expect_alike(kinds);
}

TEST_F(ForeignPictures, CodedPicturesOfAnyDepthAndChannels) {
  std::vector<Kind> kinds;
  for (const bool gray : {false, true}) {
    const std::string channels = gray ? "--ch R" : "--ch R,G,B", shown = gray ? kGray : "";
    for (const int bits : {8, 16}) {
      const double code = half_a_code(bits);
      const std::string depth = fmt::format("{} -d uint{}", channels, bits);
      kinds.push_back({depth, "png", code, false, shown});
      // Alpha is dropped; colours are as they are stored.
      kinds.push_back({fmt::format("--ch {},A=0.5 -d uint{}", gray ? "R" : "R,G,B", bits), "png", code, false,
                       shown, "--iconfig oiio:UnassociatedAlpha 1"});
      // oiiotool truncates codes of 16 bits there.
      kinds.push_back({depth, gray ? "pgm" : "ppm", 5.0 * code, false, shown});
      if (bits == 8) kinds.push_back({depth, "bmp", code, false, shown});
    }
  }
  kinds.push_back({"-d uint8", "webp", half_a_code(8)});
  kinds.push_back({"-d uint8 --compression lossless", "webp", half_a_code(8)});
  kinds.push_back({"--ch R,G,B,A=0.5 -d uint8 --compression lossless", "webp", 2.0 * half_a_code(8), false,
                   "--unpremult"});
  kinds.push_back({"-d uint8", "hdr", 0.0});
  for (const char* other : {"gif", "heic", "avif", "tga", "dpx"})
    kinds.push_back({"-d uint8", other, 0.0, true});
  expect_alike(kinds);
}

TEST_F(ForeignPictures, PicturesThatAreTurned) {
  // Which sides the first row and the first column are (TIFF 6.0, page 36), of 1 to 8. oiiotool's --reorient
  // mixes up 5 and 7.
  constexpr std::array kTurns{
      "",           "--flop", "--rotate180", "--flip", "--transpose", "--rotate90", "--transpose --rotate180",
      "--rotate270"};
  std::vector<Kind> kinds;
  for (size_t orientation = 1; orientation <= kTurns.size(); ++orientation) {
    for (const auto& [depth, name] :
         {std::pair{"uint8", "tif"}, {"uint16", "tif"}, {"float", "tif"}, {"uint8", "jpg"}}) {
      const std::string options = fmt::format("-d {} --attrib Orientation {}", depth, orientation);
      const double tolerance = std::string(depth) == "float" ? 0.0 : half_a_code(8);
      kinds.push_back(
          {.options = options, .name = name, .tolerance = tolerance, .shown = kTurns[orientation - 1]});
      kinds.push_back({.options = options,
                       .name = name,
                       .tolerance = tolerance,
                       .refused = std::string(depth) == "float",
                       .as_the_sensor = true});
    }
  }
  expect_alike(kinds);
}

TEST_F(ForeignPictures, FilesThatWentWrongElsewhere) {
  const char* data = std::getenv("GLASSWING_DATA");
  const fs::path here = fs::absolute(__FILE__).parent_path();
  const fs::path odd = (data != nullptr ? fs::path(data) : here / "../../../../shared/data") / "odd";
  if (!fs::exists(odd)) GTEST_SKIP() << "no data at " << odd;
  const auto read = [&](const char* name) { return read_radiance(odd / name, Encoding::kLinear); };
  const RadianceImage crop = read("exr_data_window/crop.exr").value(),
                      expected = read("exr_data_window/expected.exr").value(),
                      overscan = read("exr_data_window/overscan.exr").value();
  EXPECT_EQ(crop.width_px, 256);
  EXPECT_EQ(crop.height_px, 192);
  for (int y = 0; y < crop.height_px; ++y) {  // 128x96+64+48
    for (int x = 0; x < crop.width_px; ++x) {
      const bool inside = x >= 64 && x < 192 && y >= 48 && y < 144;
      ASSERT_EQ(crop.at(x, y, 1), inside ? expected.at(x, y, 1) : 0.0f) << x << " " << y;
    }
  }
  EXPECT_EQ(overscan.width_px, 256);
  for (const char* name : {"blender.exr", "layer.exr", "multipart_zfirst.exr"}) {
    const RadianceImage image = read_radiance(odd / "exr_layers_black" / name, Encoding::kLinear).value();
    EXPECT_TRUE(std::ranges::any_of(image.samples, [](float light) { return light > 0.0f; })) << name;
  }
  const absl::Status depth = read("exr_layers_black/z.exr").status();
  EXPECT_NE(depth.message().find("none of its layers has colours; its channels are Z"), std::string::npos)
      << depth;
}

}  // namespace
}  // namespace glasswing
