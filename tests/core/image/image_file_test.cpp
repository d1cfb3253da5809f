#include "core/image/image_file.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <cstdlib>
#include <random>

#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/image/exr_limits.h"
#include "tests/core/image/exr_of_parts.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

RadianceImage random_picture(int width, int height) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> light(0.0f, 1.0f);
  RadianceImage image(width, height);
  for (float& sample : image.samples) sample = light(random);
  return image;
}

class ImageFile : public testing::Test {
 protected:
  const TemporaryDirectory directory_;
};

TEST_F(ImageFile, EveryFormatKeepsThePicture) {
  const RadianceImage image = random_picture(9, 5);
  struct Case {
    const char* file;
    Encoding encoding;
    float step;  // one stored code, as linear light; the allowed error is half of it
  };
  // The slope of sRGB is at most 2.4 / 1.055 = 2.28, at white, so one 8-bit code is at most 2.28 / 255 of
  // light.
  for (const Case& each : {Case{"a.exr", Encoding::kLinear, 0.0f},
                           {"a.png", Encoding::kLinear, 1.0f / 65535},
                           {"a.tif", Encoding::kLinear, 1.0f / 65535},
                           {"b.png", Encoding::kDisplay, 2.3f / 255}}) {
    ASSERT_OK(write_radiance(directory_ / each.file, image, each.encoding));
    const RadianceImage back = read_radiance(directory_ / each.file, each.encoding).value();
    ASSERT_EQ(back.samples.size(), image.samples.size());
    for (size_t i = 0; i < image.samples.size(); ++i)
      EXPECT_NEAR(back.samples[i], image.samples[i], 0.51f * each.step) << each.file;
  }
  EXPECT_TRUE(absl::IsInvalidArgument(write_radiance(directory_ / "a.gif", image, Encoding::kDisplay)));
}

TEST_F(ImageFile, DamagedPngsAreNamed) {
  Image16 image(6, 4);
  for (size_t i = 0; i < image.samples.size(); ++i) image.samples[i] = static_cast<std::uint16_t>(i * 800);
  const std::string good = encode_png16(image).value();
  EXPECT_EQ(decode_png(good).value().samples, image.samples);
  const fs::path path = directory_ / "frame.png";
  for (size_t i = 8; i < good.size(); ++i) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 0x10);
    ASSERT_OK(write_file_durably(path, bad));
    const absl::Status status = read_frame_file(path).status();
    EXPECT_TRUE(absl::IsDataLoss(status)) << "byte " << i;
    EXPECT_NE(std::string(status.message()).find("frame.png"), std::string::npos);
  }
  for (size_t length = 0; length < good.size(); ++length) {
    ASSERT_OK(write_file_durably(path, good.substr(0, length)));
    EXPECT_FALSE(read_frame_file(path).ok()) << length << " bytes";
  }
  EXPECT_TRUE(absl::IsDataLoss(read_frame_file(directory_ / "missing.png").status()));
}

TEST_F(ImageFile, SizesAreKnownBeforeAPixelIsDecoded) {
  const Image16 image(6, 4);
  EXPECT_EQ(picture_size(encode_png16(image).value()).value(), (PictureSize{6, 4}));
  EXPECT_EQ(picture_size(encode_tiff(image)).value(), (PictureSize{6, 4}));
  // Big endian, 16-bit sides: width 300, height 2.
  const std::string other(
      "MM\0\x2a\0\0\0\x08\0\x02\x01\0\0\x03\0\0\0\x01\x01\x2c\0\0"
      "\x01\x01\0\x03\0\0\0\x01\0\x02\0\0",
      34);
  EXPECT_EQ(picture_size(other).value(), (PictureSize{300, 2}));
  for (size_t length = 0; length < other.size(); ++length) (void)picture_size(other.substr(0, length));

  // For a duplicate tag, decoders differ in which value they use.
  std::string twice = other;
  twice[9] = 3;
  twice += std::string("\x01\0\0\x03\0\0\0\x01\0\x03\0\0", 12);
  EXPECT_FALSE(picture_size(twice).ok());

  // A small file that promises 10^9 pixels, with a valid CRC.
  std::string lying = encode_png16(image).value();
  const std::string sides("\0\0\x80\0\0\0\x80\0", 8);
  lying.replace(16, 8, sides);
  const uLong crc = crc32(0, reinterpret_cast<const Bytef*>(&lying[12]), 17);
  for (size_t i = 0; i < 4; ++i) lying[29 + i] = static_cast<char>(crc >> (24 - 8 * i));
  EXPECT_NE(std::string(picture_size(lying).status().message()).find("32768x32768"), std::string::npos);
  EXPECT_TRUE(absl::IsInvalidArgument(decode_png(lying).status()));
  const fs::path path = directory_ / "lying.png";
  ASSERT_OK(write_file_durably(path, lying));
  EXPECT_TRUE(absl::IsDataLoss(read_frame_file(path).status()));
  EXPECT_TRUE(absl::IsDataLoss(decode_radiance(lying, Encoding::kDisplay).status()));
  // Nothing is decoded whose size is unknown.
  EXPECT_TRUE(absl::IsDataLoss(decode_radiance("P6\n32768 32768\n255\n", Encoding::kDisplay).status()));

  ASSERT_OK(write_file_durably(path, encode_png16(image).value()));
  EXPECT_OK(read_frame_file(path, PictureSize{6, 4}));
  const absl::Status status = read_frame_file(path, PictureSize{4, 6}).status();
  EXPECT_NE(std::string(status.message()).find("lying.png is 6x4; the manifest says that frames are 4x6"),
            std::string::npos)
      << status;
}

// A sun is brighter than a half can say, and data windows may begin anywhere.
TEST_F(ImageFile, OpenExrIsReadInAllItsDigits) {
  const RadianceImage light = [] {
    RadianceImage image = random_picture(4, 3);
    image.at(2, 1, 0) = 1.25e6f;
    return image;
  }();
  const auto write = [&](const char* name, std::vector<const char*> channels) {
    Imf::Header header({{-3, 20}, {0, 22}}, {{-3, 20}, {0, 22}});
    Imf::FrameBuffer frame;
    for (size_t c = 0; c < channels.size(); ++c) {
      header.channels().insert(channels[c], Imf::Channel(Imf::FLOAT));
      frame.insert(channels[c], Imf::Slice::Make(Imf::FLOAT, light.samples.data() + c, header.dataWindow(),
                                                 3 * sizeof(float), 4 * 3 * sizeof(float)));
    }
    Imf::OutputFile file((directory_ / name).c_str(), header);
    file.setFrameBuffer(frame);
    file.writePixels(3);
  };
  write("colours.exr", {"R", "G", "B"});
  EXPECT_EQ(read_radiance(directory_ / "colours.exr", Encoding::kLinear).value().samples, light.samples);
  write("red.exr", {"R"});
  const RadianceImage red = read_radiance(directory_ / "red.exr", Encoding::kLinear).value();
  EXPECT_EQ(red.at(2, 1, 0), 1.25e6f);
  EXPECT_EQ(red.at(2, 1, 1), 0.0f);
  write("luminance.exr", {"Y"});
  const RadianceImage gray = read_radiance(directory_ / "luminance.exr", Encoding::kLinear).value();
  for (int c = 0; c < 3; ++c) EXPECT_EQ(gray.at(2, 1, c), 1.25e6f);
}

TEST_F(ImageFile, OpenExrOfTooManyPartsIsRefusedBeforeItIsRead) {
  const fs::path path = directory_ / "parts.exr";
  const auto read = [&](const std::string& bytes) {
    EXPECT_EQ(write_file_durably(path, bytes), absl::OkStatus());
    return read_radiance(path, Encoding::kLinear).status();
  };
  EXPECT_EQ(read(exr_of_parts(1)), absl::OkStatus());
  EXPECT_EQ(read(exr_of_parts(kMaxExrParts)), absl::OkStatus());
  EXPECT_EQ(read(exr_of_parts(1, kMaxExrChannels - 3)), absl::OkStatus());
  const std::string name = path.string();
  for (const int parts : {kMaxExrParts + 1, 20'000})
    EXPECT_EQ(read(exr_of_parts(parts)),
              absl::InvalidArgumentError(fmt::format("{}: it has more than {} parts", name, kMaxExrParts)));
  const auto channels =
      absl::InvalidArgumentError(fmt::format("{}: it has more than {} channels", name, kMaxExrChannels));
  EXPECT_EQ(read(exr_of_parts(1, kMaxExrChannels - 2)), channels);
  EXPECT_EQ(read(exr_of_parts(2, kMaxExrChannels / 2)), channels);
  EXPECT_EQ(read_radiance(path, Encoding::kLinear).status(), channels);
  // The library would allocate the two gigabytes that an attribute is said to have.
  const std::string good = exr_of_parts(1);
  const size_t size_at = good.find("box2i") + 6;
  const std::string lying = good.substr(0, size_at) + "\xff\xff\xff\x7f" + good.substr(size_at + 4);
  EXPECT_EQ(read(lying), absl::DataLossError(name + ": its headers do not end within it"));
  for (size_t size = 0; size < good.size(); ++size) EXPECT_FALSE(read(good.substr(0, size)).ok()) << size;
}

// Rec. 709 and D65, ITU-R BT.709-6.
// Layers and parts that another program names.
TEST_F(ImageFile, OpenExrSaysWhichLayerIsRead) {
  const auto made = [&](const std::string& words) {
    const fs::path path = directory_ / "layers.exr";
    const std::string command = fmt::format("oiiotool --create 8x8 3 {} -o {}", words, path.string());
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
    return layer_of_file(path);
  };
  EXPECT_EQ(made(""), "");
  EXPECT_EQ(made("--chnames Y,Z,mask --ch Y"), "");
  EXPECT_EQ(made("--chnames 'View Layer.Combined.R,View Layer.Combined.G,View Layer.Combined.B'"),
            "layer View Layer.Combined");
  const std::string depth_first =
      "--chnames r.x,r.y,r.z --attrib oiio:subimagename depth --create 8x8 3 --attrib oiio:subimagename "
      "beauty "
      "--siappend";
  EXPECT_EQ(made(depth_first), "part 2, beauty");
  EXPECT_EQ(layer_of_file(directory_ / "none.exr"), "");
}

TEST_F(ImageFile, OpenExrSaysItsPrimaries) {
  ASSERT_OK(
      write_radiance(directory_ / "p.exr", random_picture(9, 5), Encoding::kLinear, 0, linear_rec709()));
  const Imf::InputFile file((directory_ / "p.exr").c_str());
  ASSERT_TRUE(Imf::hasChromaticities(file.header()));
  const Imf::Chromaticities& said = Imf::chromaticities(file.header());
  EXPECT_EQ(said.red, Imath::V2f(0.64f, 0.33f));
  EXPECT_EQ(said.green, Imath::V2f(0.30f, 0.60f));
  EXPECT_EQ(said.blue, Imath::V2f(0.15f, 0.06f));
  EXPECT_EQ(said.white, Imath::V2f(0.3127f, 0.3290f));
  EXPECT_EQ(file.header().typedAttribute<Imf::StringAttribute>("oiio:ColorSpace").value(), "lin_rec709");
}

TEST_F(ImageFile, PhotographsKeepTheirCodes) {
  const fs::path path = directory_ / "photo.png";
  ASSERT_OK(write_radiance(path, random_picture(9, 5), Encoding::kDisplay));
  const CodedPhotograph coarse = read_photograph(path).value();
  EXPECT_EQ(coarse.bits, 8);
  for (const std::uint16_t code : coarse.codes.samples) EXPECT_EQ(code % 257, 0);
  Image16 fine(3, 2);
  for (size_t i = 0; i < fine.samples.size(); ++i) fine.samples[i] = static_cast<std::uint16_t>(i * 3641);
  for (const std::string& bytes : {encode_png16(fine).value(), encode_tiff(fine)}) {
    ASSERT_OK(write_file_durably(path, bytes));
    const CodedPhotograph back = read_photograph(path).value();
    EXPECT_EQ(back.bits, 16);
    EXPECT_EQ(back.codes.samples, fine.samples);
  }
  ASSERT_OK(write_radiance(directory_ / "photo.exr", random_picture(9, 5), Encoding::kLinear));
  EXPECT_TRUE(absl::IsDataLoss(read_photograph(directory_ / "photo.exr").status()));
  EXPECT_TRUE(absl::IsDataLoss(read_photograph(directory_ / "missing.png").status()));
}

TEST_F(ImageFile, CodesOfFewerBitsAreStretchedToTheirWhite) {
  const fs::path path = directory_ / "photo.png";
  struct {
    int white, bits, shift;
  } const kinds[] = {{1023, 10, 0},  {4095, 12, 0},  {16383, 14, 0},
                     {65472, 10, 6}, {65520, 12, 4}, {1000, 10, 0}};
  for (const auto& [white, bits, shift] : kinds) {
    Image16 codes(4, 1);
    for (size_t i = 0; i < codes.samples.size(); ++i)
      codes.samples[i] = static_cast<std::uint16_t>(static_cast<size_t>(white >> shift) * i / 11 << shift);
    ASSERT_OK(write_file_durably(path, encode_png16(codes).value()));
    const CodedPhotograph photograph = read_photograph(path, white).value();
    EXPECT_EQ(photograph.bits, bits) << white;
    for (size_t i = 0; i < codes.samples.size(); ++i)
      EXPECT_NEAR(photograph.codes.samples[i], 65535.0 * codes.samples[i] / white, 0.51) << white;
    EXPECT_EQ(photograph.codes.samples.back(), 65535);
    EXPECT_EQ(read_photograph(path, white - 1).status().message(),
              fmt::format("{}: its largest code is {}, above white, {}", path.string(), white, white - 1));
  }
  ASSERT_OK(write_radiance(path, random_picture(9, 5), Encoding::kDisplay));
  EXPECT_TRUE(absl::IsInvalidArgument(read_photograph(path, 256).status()));
}

// OpenCV alone decodes the missing part as grey.
TEST_F(ImageFile, AJpegThatIsCutOffIsNamed) {
  const std::string good = encode_jpeg(random_picture(40, 30)).value();
  EXPECT_EQ(picture_size(good).value(), (PictureSize{40, 30}));
  const fs::path path = directory_ / "photo.jpg";
  ASSERT_OK(write_file_durably(path, good));
  const CodedPhotograph photograph = read_photograph(path).value();
  EXPECT_EQ(photograph.bits, 8);
  EXPECT_EQ(photograph.codes.width_px, 40);
  for (size_t length = 0; length < good.size(); length += 7) {
    ASSERT_OK(write_file_durably(path, good.substr(0, length)));
    const absl::Status status = read_photograph(path).status();
    EXPECT_TRUE(absl::IsDataLoss(status)) << length << " bytes";
    EXPECT_NE(std::string(status.message()).find("photo.jpg"), std::string::npos);
  }
}

TEST(Resized, KeepsTheMeanWhenItShrinks) {
  const RadianceImage image = random_picture(12, 8);
  const RadianceImage small = resized(image, 4, 4);
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 4; ++x) {
      float mean = 0.0f;
      for (int v = 0; v < 2; ++v) {
        for (int u = 0; u < 3; ++u) mean += image.at(3 * x + u, 2 * y + v, 1) / 6.0f;
      }
      EXPECT_NEAR(small.at(x, y, 1), mean, 1e-5f);
    }
  }
}

}  // namespace
}  // namespace glasswing
