// Reads matte files by other programs: exrheader (OpenEXR) and oiiotool (OpenImageIO).
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <map>
#include <random>
#include <set>
#include <sstream>

#include "core/file/file.h"
#include "core/matte/matte_file.h"
#include "tests/core/matte/other_program.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kX0 = 3, kY0 = 2, kWidth = 7, kHeight = 5, kFullWidth = 12, kFullHeight = 9;
constexpr std::array<const char*, 9> kLayers{"weight", "x",       "y",         "xx",       "xy",
                                             "yy",     "texture", "weight_sd", "centre_sd"};

// A tile, so that data and display window differ. Values are multiples of 1/64, which six decimals represent.
Matte matte_to_read(bool colourless) {
  std::mt19937 random(5);
  const auto value = [&random] { return static_cast<float>(random() % 6400) / 64.0f; };
  Matte matte(kX0, kY0, kWidth, kHeight, 2, colourless);
  matte.metadata.set_format_version(1);
  matte.metadata.set_session("vase");
  matte.metadata.set_width_px(kFullWidth);
  matte.metadata.set_height_px(kFullHeight);
  for (const char* name : {"back", "left"}) matte.metadata.add_monitors()->set_name(name);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      matte.coverage(x, y) = value() / 128.0f;
      matte.flags(x, y) = static_cast<std::uint8_t>(random() % 16);
      for (int c = 0; c < kChannels; ++c) {
        matte.foreground(x, y)[c] = value();
        for (Mode& mode : matte.modes(x, y, c)) {
          mode = {.weight = value(),
                  .x_px = value() - 50.0f,
                  .y_px = value() - 50.0f,
                  .xx_px2 = value(),
                  .xy_px2 = value() - 50.0f,
                  .yy_px2 = value(),
                  .texture = static_cast<std::int32_t>(random() % 2),
                  .weight_sd = value(),
                  .centre_sd_px = value()};
        }
      }
    }
  }
  return matte;
}

float value_of(const Mode& mode, size_t layer) {
  const std::array<float, kLayers.size()> values{mode.weight,         mode.x_px,      mode.y_px,
                                                 mode.xx_px2,         mode.xy_px2,    mode.yy_px2,
                                                 float(mode.texture), mode.weight_sd, mode.centre_sd_px};
  return values[layer];
}

struct Part {
  std::map<std::string, std::string> attributes;
  std::vector<std::string> channels;  // "NAME, TYPE, SAMPLING"
};

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> words;
  std::istringstream in(text);
  for (std::string word; std::getline(in, word, at);) words.push_back(word);
  return words;
}

std::vector<Part> parts_in(const std::string& header) {
  std::vector<Part> parts;
  bool in_channels = false;
  for (const std::string& line : split(header, '\n')) {
    if (line.starts_with(" part ")) parts.emplace_back();
    if (parts.empty()) continue;
    if (in_channels && line.starts_with("    ")) {
      parts.back().channels.push_back(line.substr(4));
      continue;
    }
    in_channels = line.starts_with("channels (");
    const size_t type = line.find(" (type "), value = line.find("): ");
    if (type != std::string::npos && value != std::string::npos)
      parts.back().attributes[line.substr(0, type)] = line.substr(value + 3);
  }
  return parts;
}

// The samples by channel, row by row, of every part.
std::map<std::string, std::vector<float>> planes_in(const std::string& dump) {
  std::map<std::string, std::vector<float>> planes;
  std::vector<std::string> channels;
  for (const std::string& line : split(dump, '\n')) {
    const std::string list = "    channel list: ", pixel = "    Pixel (";
    if (line.starts_with(list)) {
      channels.clear();
      std::istringstream names(line.substr(list.size()));
      for (std::string name; names >> name;) channels.push_back(name.substr(0, name.find(',')));
    } else if (line.starts_with(pixel)) {
      std::istringstream values(line.substr(line.find("): ") + 3));
      for (const std::string& channel : channels) values >> planes[channel].emplace_back();
    }
  }
  return planes;
}

class ExrPrograms : public testing::TestWithParam<bool> {  // colourless
 protected:
  ExrPrograms() { EXPECT_OK(write_file_durably(path_, encode_matte(matte_).value())); }
  ~ExrPrograms() override { std::filesystem::remove(path_); }

  std::vector<std::string> colours() const {
    return GetParam() ? std::vector<std::string>{"Y"} : std::vector<std::string>{"R", "G", "B"};
  }

  const Matte matte_ = matte_to_read(GetParam());
  const std::string path_ = fmt::format("{}exr_programs_test.{}.exr", testing::TempDir(), ::getpid());
};

TEST_P(ExrPrograms, ExrheaderListsPartsChannelsAndWindows) {
  const Said said = run_program("exrheader " + path_);
  ASSERT_EQ(said.status, 0) << said.text;
  const std::vector<Part> parts = parts_in(said.text);
  ASSERT_EQ(parts.size(), 4u) << said.text;
  const std::array<std::string, 4> names{"preview", "foreground", "mode1", "mode2"};
  for (size_t i = 0; i < parts.size(); ++i) {
    const auto& attributes = parts[i].attributes;
    EXPECT_EQ(attributes.at("name"), fmt::format("\"{}\"", names[i]));
    EXPECT_EQ(attributes.at("type"), "\"scanlineimage\"");
    EXPECT_EQ(attributes.at("compression"), "zip, individual scanlines");
    EXPECT_EQ(attributes.at("dataWindow"),
              fmt::format("({} {}) - ({} {})", kX0, kY0, kX0 + kWidth - 1, kY0 + kHeight - 1));
    EXPECT_EQ(attributes.at("displayWindow"),
              fmt::format("(0 0) - ({} {})", kFullWidth - 1, kFullHeight - 1));
    EXPECT_NE(attributes.at("glasswing").find("vase"), std::string::npos);
    EXPECT_TRUE(attributes.contains("glasswing:conventions"));
    EXPECT_EQ(attributes.contains("glasswing:checksum"), i == 0);
    EXPECT_EQ(attributes.contains("glasswing:rows"), i == 0);
    std::set<std::string> expected;
    const auto expect = [&expected](const std::string& name) {
      expected.insert(name + ", 32-bit floating-point, sampling 1 1");
    };
    if (i == 0) {
      for (const char* name : {"R", "G", "B", "A"}) expect(name);
    } else if (i == 1) {
      for (const char* name : {"F.R", "F.G", "F.B", "coverage.Y", "flags.Y"})
        expect(fmt::format("foreground.{}", name));
    } else {
      for (const char* layer : kLayers) {
        for (const std::string& colour : colours()) expect(fmt::format("{}.{}.{}", names[i], layer, colour));
      }
    }
    EXPECT_EQ(std::set<std::string>(parts[i].channels.begin(), parts[i].channels.end()), expected);
  }
}

// Nuke ignores part names if a channel's name has a dot, joins the text before the last dot with "_", and
// takes R, G, B as a layer's colours; Blender expects LAYER.PASS.C. So names must be complete and unique over
// all parts.
TEST_P(ExrPrograms, LayersGroupInACompositor) {
  std::map<std::string, std::string> layers;  // name in Nuke to channels
  for (const Part& part : parts_in(run_program("exrheader " + path_).text)) {
    for (const std::string& channel : part.channels) {
      std::vector<std::string> words = split(channel.substr(0, channel.find(',')), '.');
      const std::string last = words.back();
      EXPECT_EQ(last.size(), 1u) << channel;
      words.pop_back();
      EXPECT_TRUE(words.empty() || words.size() == 2) << channel;
      std::string& channels = layers[fmt::format("{}", fmt::join(words, "_"))];
      EXPECT_EQ(channels.find(last), std::string::npos) << channel << " is there twice";
      channels += last;
    }
  }
  EXPECT_EQ(layers.at(""), "ABGR");
  EXPECT_EQ(layers.at("foreground_F"), "BGR");
  EXPECT_EQ(layers.at("foreground_coverage"), "Y");
  for (const char* mode : {"mode1", "mode2"}) {
    for (const char* layer : kLayers) {
      EXPECT_EQ(layers.at(fmt::format("{}_{}", mode, layer)), GetParam() ? "Y" : "BGR");
    }
  }
  EXPECT_EQ(layers.size(), 4 + 2 * kLayers.size());
}

TEST_P(ExrPrograms, OiiotoolReadsEveryPixel) {
  const Said said = run_program("oiiotool -v -a --info --dumpdata " + path_);
  ASSERT_EQ(said.status, 0) << said.text;
  const std::map<std::string, std::vector<float>> planes = planes_in(said.text);
  const auto expect_plane = [&](const std::string& channel, const auto& get) {
    ASSERT_TRUE(planes.contains(channel)) << channel;
    std::vector<float> expected;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) expected.push_back(get(x, y));
    }
    EXPECT_EQ(planes.at(channel), expected) << channel;
  };
  const std::array<std::string, 3> kColours{"R", "G", "B"};
  for (size_t c = 0; c < 3; ++c) {
    expect_plane("foreground.F." + kColours[c], [&](int x, int y) { return matte_.foreground(x, y)[c]; });
    expect_plane(kColours[c], [&](int x, int y) {
      float light = matte_.foreground(x, y)[c];
      for (const Mode& mode : matte_.modes(x, y, static_cast<int>(c))) light += 0.5f * mode.weight;
      return matte_.coverage(x, y) * light;
    });
  }
  for (const char* coverage : {"A", "foreground.coverage.Y"})
    expect_plane(coverage, [&](int x, int y) { return matte_.coverage(x, y); });
  expect_plane("foreground.flags.Y", [&](int x, int y) { return static_cast<float>(matte_.flags(x, y)); });
  for (size_t m = 0; m < 2; ++m) {
    for (size_t layer = 0; layer < kLayers.size(); ++layer) {
      for (size_t c = 0; c < colours().size(); ++c) {
        expect_plane(fmt::format("mode{}.{}.{}", m + 1, kLayers[layer], colours()[c]), [&](int x, int y) {
          return value_of(matte_.modes(x, y, static_cast<int>(c))[m], layer);
        });
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Colours, ExrPrograms, testing::Bool(),
                         [](const auto& test) { return test.param ? "Colourless" : "Rgb"; });

}  // namespace
}  // namespace glasswing
