// Colour spaces of pictures read and written: oiiotool, by the config's own spaces, is the other opinion.
#include "compositing/colour/picture_colours.h"

#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <random>

#include "core/file/file.h"
#include "core/matte/matte_file.h"
#include "tests/compositing/run_glasswing.h"
#include "tests/core/footprint/matte_object.h"
#include "tests/core/matte/other_program.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

// Rec. 709 is there by the matrix of the ACES configs; ours comes from chromaticities (ITU-R BT.709-6).
constexpr const char* kConfig = R"(ocio_profile_version: 2
roles: {aces_interchange: ACES2065-1, default: ACES2065-1, scene_linear: ACEScg}
displays:
  sRGB:
    - !<View> {name: Raw, colorspace: Raw}
colorspaces:
  - !<ColorSpace>
    name: ACES2065-1
  - !<ColorSpace>
    name: ACEScg
    aliases: [lin_ap1]
    to_scene_reference: !<BuiltinTransform> {style: ACEScg_to_ACES2065-1}
  - !<ColorSpace>
    name: ACEScct
    to_scene_reference: !<BuiltinTransform> {style: ACEScct_to_ACES2065-1}
  - !<ColorSpace>
    name: Linear Rec.709 (sRGB)
    from_scene_reference: !<MatrixTransform> {matrix: [2.52168618674388, -1.13413098823972, -0.387555198504164, 0, -0.276479914229922, 1.37271908766826, -0.0962391734383344, 0, -0.0153780649660342, -0.152975335867399, 1.16835340083343, 0, 0, 0, 0, 1]}
  - !<ColorSpace>
    name: sRGB - Texture
    from_scene_reference: !<GroupTransform>
      children:
        - !<MatrixTransform> {matrix: [2.52168618674388, -1.13413098823972, -0.387555198504164, 0, -0.276479914229922, 1.37271908766826, -0.0962391734383344, 0, -0.0153780649660342, -0.152975335867399, 1.16835340083343, 0, 0, 0, 0, 1]}
        - !<ExponentWithLinearTransform> {gamma: 2.4, offset: 0.055, direction: inverse}
  - !<ColorSpace>
    name: Raw
    isdata: true
)";

class PictureColoursTest : public ScratchTest {
 protected:
  PictureColoursTest() {
    ::unsetenv("OCIO");
    EXPECT_OK(write_file_durably(path("config.ocio"), kConfig));
    std::mt19937 random(7);
    // Halves, which read_radiance() makes of an EXR's samples.
    for (float& sample : picture_.samples) sample = static_cast<float>(random() % 1024) / 512.0f;
    EXPECT_OK(write_radiance(path("plate.exr"), picture_, Encoding::kLinear));
  }
  std::string path(const std::string& name) const { return (scratch_ / name).string(); }
  RadianceImage read(const std::string& name) const {
    absl::StatusOr<RadianceImage> picture = read_radiance(path(name), Encoding::kLinear);
    EXPECT_OK(picture);
    return *std::move(picture);
  }
  Outcome convert(const std::string& from, const std::string& to, std::vector<std::string> more) const {
    more.insert(more.begin(), {"convert", path(from), path(to), "--ocio-config", path("config.ocio")});
    return run_glasswing(more);
  }
  // By oiiotool; float samples.
  RadianceImage converted(const std::string& from, const std::string& in, const std::string& out) const {
    const Said said =
        run_program(fmt::format("oiiotool --colorconfig {} {} --colorconvert \"{}\" \"{}\" -d float -o {}",
                                path("config.ocio"), path(from), in, out, path("oiio.exr")));
    EXPECT_EQ(said.status, 0) << said.text;
    return read("oiio.exr");
  }
  static void expect_same(const RadianceImage& a, const RadianceImage& b, float tolerance) {
    ASSERT_EQ(a.samples.size(), b.samples.size());
    for (size_t i = 0; i < a.samples.size(); ++i)
      ASSERT_NEAR(a.samples[i], b.samples[i], tolerance * std::max(1.0f, std::abs(b.samples[i]))) << i;
  }

  RadianceImage picture_{17, 9};
  static constexpr float kHalf = 1.0f / 1024.0f;  // from one half to the next
};

TEST_F(PictureColoursTest, SpacesAreThoseOfOiiotool) {
  const std::string rec709 = "Linear Rec.709 (sRGB)";
  for (const std::string space : {"ACEScg", "lin_ap1", "ACES2065-1", "scene_linear", "ACEScct"}) {
    ASSERT_EQ(convert("plate.exr", "out.exr", {"--ocio-out", space}).status, 0) << space;
    expect_same(read("out.exr"), converted("plate.exr", rec709, space), kHalf);
    if (space == "ACEScct") continue;  // a plate of light above 1.5 would be 10,000 times that
    ASSERT_EQ(convert("plate.exr", "out.exr", {"--ocio-in", space}).status, 0) << space;
    expect_same(read("out.exr"), converted("plate.exr", space, rec709), kHalf);
  }
}

TEST_F(PictureColoursTest, ThereAndBackIsTheSame) {
  for (const std::string space : {"ACEScg", "ACES2065-1", "ACEScct", "sRGB - Texture"}) {
    const ColourSpace colours = ColourSpace::open(path("config.ocio"), space).value();
    RadianceImage picture = picture_;
    colours.from_linear(picture);
    colours.to_linear(picture);
    expect_same(picture, picture_, 2e-5f);
  }
}

// Our own sRGB, and the config's.
TEST_F(PictureColoursTest, CodesAreOfTheSpace) {
  for (float& sample : picture_.samples) sample *= 0.5f;
  ASSERT_OK(write_radiance(path("plate.exr"), picture_, Encoding::kLinear));
  ASSERT_EQ(convert("plate.exr", "out.png", {"--ocio-out", "sRGB - Texture"}).status, 0);
  const RadianceImage codes = read("out.png"), light = read("plate.exr");
  for (size_t i = 0; i < codes.samples.size(); ++i)
    ASSERT_NEAR(codes.samples[i], srgb_of_linear(light.samples[i]), 0.51f / 255.0f + 1e-4f);
  ASSERT_EQ(convert("out.png", "back.exr", {"--ocio-in", "sRGB - Texture"}).status, 0);
  const RadianceImage back = read("back.exr");
  const RadianceImage expected = read_radiance(path("out.png"), Encoding::kDisplay).value();
  expect_same(back, expected, kHalf);
}

// The primaries are found from the config's numbers, whatever the space is called.
TEST_F(PictureColoursTest, FilesSayTheirPrimaries) {
  const auto colour = [this](const std::string& space) {
    return ColourSpace::open(path("config.ocio"), space).value().colour();
  };
  EXPECT_EQ(colour("ACEScg").interop_id, "lin_ap1_scene");
  EXPECT_EQ(colour("lin_ap1").interop_id, "lin_ap1_scene");
  EXPECT_EQ(colour("ACES2065-1").interop_id, "lin_ap0_scene");
  EXPECT_EQ(colour("Linear Rec.709 (sRGB)").interop_id, "lin_rec709_scene");
  EXPECT_EQ(colour("ACEScct").interop_id, "unknown");
  EXPECT_EQ(colour("sRGB - Texture").chromaticities, std::nullopt);
  ASSERT_EQ(convert("plate.exr", "out.exr", {"--ocio-out", "ACEScg"}).status, 0);
  const PictureColour said = colour_of_file(path("out.exr"), Encoding::kDisplay);
  EXPECT_EQ(said.interop_id, "lin_ap1_scene");
  EXPECT_EQ(said.space, "ACEScg");
  const Imf::InputFile file(path("out.exr").c_str());
  EXPECT_EQ(Imf::chromaticities(file.header()).red, Imath::V2f(0.713f, 0.293f));
  EXPECT_EQ(Imf::chromaticities(file.header()).white, Imath::V2f(0.32168f, 0.33767f));
}

TEST_F(PictureColoursTest, ConvertedPicturesKeepWhatIsKnownOfThem) {
  const auto said = [this](const std::string& name) {
    return colour_of_file(path(name), Encoding::kDisplay).interop_id;
  };
  ASSERT_OK(write_radiance(path("photo.png"), picture_, Encoding::kDisplay));
  ASSERT_EQ(run_glasswing({"convert", path("photo.png"), path("photo.exr")}).status, 0);
  EXPECT_EQ(said("photo.exr"), "lin_rec709_scene");
  ASSERT_EQ(run_glasswing({"convert", path("photo.exr"), path("again.exr")}).status, 0);
  EXPECT_EQ(said("again.exr"), "lin_rec709_scene");
  ASSERT_EQ(run_glasswing({"convert", "--linear", path("photo.png"), path("raw.exr")}).status, 0);
  EXPECT_EQ(said("raw.exr"), "unknown");
  EXPECT_EQ(said("plate.exr"), "unknown");
  ASSERT_EQ(run_glasswing({"convert", path("plate.exr"), path("unknown.exr")}).status, 0);
  EXPECT_EQ(said("unknown.exr"), "unknown");
}

// The light of the plate passes the object as linear Rec. 709, and becomes ACEScg again.
TEST_F(PictureColoursTest, CompositesAreMadeInBetween) {
  Matte matte = random_object(8, 6, 2, 1);
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 8; ++x) matte.foreground(x, y) = {0.0f, 0.0f, 0.0f};
  }
  ASSERT_OK(write_file_durably(path("vase.exr"), encode_matte(matte).value()));
  const auto composite = [this](const std::string& plate, const std::string& out,
                                std::vector<std::string> more) {
    more.insert(more.begin(), {"composite", path("vase.exr"), "--background", path(plate), "-o", path(out)});
    return run_glasswing(more);
  };
  ASSERT_TRUE(::setenv("OCIO", path("config.ocio").c_str(), 1) == 0);
  ASSERT_EQ(composite("plate.exr", "out.exr", {"--ocio", "ACEScg"}).status, 0);
  const ColourSpace acescg = ColourSpace::open("", "ACEScg").value();
  RadianceImage plate = read("plate.exr");
  acescg.to_linear(plate);
  ASSERT_OK(write_radiance(path("rec709.exr"), plate, Encoding::kLinear));
  ASSERT_EQ(composite("rec709.exr", "expected.exr", {}).status, 0);
  RadianceImage expected = read("expected.exr");
  acescg.from_linear(expected);
  expect_same(read("out.exr"), expected, 4.0f * kHalf);
  EXPECT_EQ(colour_of_file(path("out.exr"), Encoding::kDisplay).interop_id, "lin_ap1_scene");
  // Without calibrated monitors nobody knows what the camera's channels are.
  EXPECT_EQ(colour_of_file(path("expected.exr"), Encoding::kDisplay).interop_id, "unknown");
  for (int monitor = 0; monitor < 2; ++monitor) {
    v1::Crosstalk& seen = *matte.metadata.add_crosstalk();
    for (const double share : {0.9, 0.1, 0.0, 0.1, 0.8, 0.1, 0.0, 0.1, 0.9}) seen.add_share(share);
  }
  ASSERT_OK(write_file_durably(path("vase.exr"), encode_matte(matte).value()));
  ASSERT_EQ(composite("rec709.exr", "expected.exr", {}).status, 0);
  EXPECT_EQ(colour_of_file(path("expected.exr"), Encoding::kDisplay).interop_id, "unknown");
  ASSERT_OK(write_radiance(path("photo.png"), plate, Encoding::kDisplay));
  ASSERT_EQ(composite("photo.png", "known.exr", {}).status, 0);
  EXPECT_EQ(colour_of_file(path("known.exr"), Encoding::kDisplay), linear_rec709());
  expect_one_line_error(composite("photo.png", "out.mp4", {"--frames", "2", "--ocio-out", "ACEScg"}),
                        "out.mp4 is a video, which is sRGB");
  ASSERT_OK(write_file_durably(path("waves.mp4"), "no video"));
  expect_one_line_error(composite("waves.mp4", "out.exr", {"--ocio-in", "ACEScg"}),
                        "waves.mp4 is a video, which is sRGB");
  ::unsetenv("OCIO");
}

TEST_F(PictureColoursTest, WhatIsMissingIsNamed) {
  const auto refused = [this](std::vector<std::string> more, const std::string& words) {
    more.insert(more.begin(), {"convert", path("plate.exr"), path("none.exr")});
    expect_one_line_error(run_glasswing(more), words);
    EXPECT_FALSE(std::filesystem::exists(path("none.exr")));
  };
  refused({"--ocio", "ACEScg"}, "--ocio-config must name one, or $OCIO");
  refused({"--ocio", "ACEScg", "--ocio-config", path("nowhere.ocio")}, "nowhere.ocio");
  refused({"--ocio", "ACES", "--ocio-config", path("config.ocio")},
          "no colour space \"ACES\"; it has: ACES2065-1, ACEScg");
  refused({"--ocio-in", "Raw", "--ocio-config", path("config.ocio")}, "\"Raw\" is for data");
  refused({"--ocio-config", path("config.ocio")}, "neither --ocio, --ocio-in nor --ocio-out");
  ASSERT_OK(write_file_durably(path("damaged.ocio"), "ocio_profile_version: 2\n  roles: {"));
  refused({"--ocio", "ACEScg", "--ocio-config", path("damaged.ocio")}, "damaged.ocio");
  std::string nameless = kConfig;
  nameless.replace(nameless.find("aces_interchange"), 16, "matte_paint");
  nameless.replace(nameless.find("Linear Rec.709 (sRGB)"), 21, "Film light of a kind");
  ASSERT_OK(write_file_durably(path("nameless.ocio"), nameless));
  refused({"--ocio", "ACEScg", "--ocio-config", path("nameless.ocio")},
          "does not say which of its spaces is linear Rec. 709");
}

// A config without the role, which names the space, and Blender's own, where both are told by the role.
TEST_F(PictureColoursTest, ConfigsTellRec709ByRoleOrByName) {
  std::string named = kConfig;
  named.replace(named.find("aces_interchange"), 16, "matte_paint");
  ASSERT_OK(write_file_durably(path("named.ocio"), named));
  RadianceImage by_name = picture_, by_role = picture_;
  ColourSpace::open(path("named.ocio"), "ACEScg").value().to_linear(by_name);
  ColourSpace::open(path("config.ocio"), "ACEScg").value().to_linear(by_role);
  expect_same(by_name, by_role, 1e-5f);
  const std::string blender = "/usr/share/blender/datafiles/colormanagement/config.ocio";
  if (!std::filesystem::exists(blender)) GTEST_SKIP() << "blender is not installed";
  const ColourSpace acescg = ColourSpace::open(blender, "Linear ACEScg").value();
  EXPECT_EQ(acescg.colour().interop_id, "lin_ap1_scene");
  EXPECT_EQ(ColourSpace::open(blender, "Linear").value().colour().interop_id, "lin_rec709_scene");
  RadianceImage blenders = picture_;
  acescg.to_linear(blenders);
  expect_same(blenders, by_role, 2e-4f);
}

}  // namespace
}  // namespace glasswing
