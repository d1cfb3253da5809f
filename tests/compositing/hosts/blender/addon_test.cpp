// The add-on in Blender, against the compositor that integrates each footprint.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "compositing/deliver/delivery_file.h"
#include "core/composite/compositor.h"
#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "core/rays/ray_file.h"
#include "tests/compositing/host_mattes.h"
#include "tests/compositing/hosts/blender/blender_cases.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using nlohmann::json;

constexpr int kWidth = 64, kHeight = 48;

// Where the goal is 40 dB.
double psnr_db(const RadianceImage& picture, const RadianceImage& expected) {
  EXPECT_EQ(picture.width_px, expected.width_px);
  EXPECT_EQ(picture.height_px, expected.height_px);
  double squares = 0.0;
  for (size_t i = 0; i < expected.samples.size(); ++i)
    squares += std::pow(picture.samples[i] - expected.samples[i], 2);
  return -10.0 * std::log10(squares / static_cast<double>(expected.samples.size()));
}

class BlenderAddOn : public BlenderCases {
 protected:
  std::string write_matte(const std::string& name, const Matte& matte) const {
    return write_bytes(name, encode_matte(matte).value());
  }
  std::string write_picture(const std::string& name, const RadianceImage& picture) const {
    return BlenderCases::write_picture(name, picture, Encoding::kDisplay);
  }
  // Of settings and the pictures' properties by monitor.
  void add_case(const std::string& name, json settings, json pictures) {
    BlenderCases::add_case(name, std::move(settings), {{"pictures", std::move(pictures)}});
  }
  // r, g, b of the case's picture; its alpha, too, if asked for.
  RadianceImage picture_of(const std::string& name, int width_px, int height_px,
                           std::vector<float>* alpha = nullptr) const {
    const absl::StatusOr<std::string> bytes = read_file(path(name));
    RadianceImage picture(width_px, height_px);
    const size_t pixels = picture.samples.size() / 3;
    EXPECT_EQ(bytes.value_or(error_of(name)).size(), pixels * 4 * sizeof(float)) << error_of(name);
    if (!bytes.ok() || bytes->size() != pixels * 4 * sizeof(float)) return picture;
    std::vector<float> samples(pixels * 4);
    std::memcpy(samples.data(), bytes->data(), bytes->size());
    for (size_t i = 0; i < pixels; ++i) {
      std::copy_n(&samples[i * 4], 3, &picture.samples[i * 3]);
      if (alpha) alpha->push_back(samples[i * 4 + 3]);
    }
    return picture;
  }
};

// Gaussians and boxes, on both monitors, which leak into the camera's channels.
TEST_F(BlenderAddOn, CompositesAsGlasswingDoes) {
  Matte gaussians = mixed_matte(kWidth, kHeight);
  Matte boxes = gaussians;
  boxes.metadata.set_footprint(std::string(kBoxFootprint));
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        for (Mode& mode : boxes.modes(x, y, c)) mode.xy_px2 = 0.0f;
      }
    }
  }
  Matte leaks = gaussians;
  for (int t = 0; t < 2; ++t) {
    v1::Crosstalk& mix = *leaks.metadata.add_crosstalk();
    for (int i = 0; i < 9; ++i) mix.add_share(i % 4 == 0 ? 0.9f : 0.02f * static_cast<float>(i % 3 + t));
  }
  const RadianceImage back = picture_of_waves(2 * kWidth, 2 * kHeight), left = picture_of_waves(90, 70);
  const std::string back_file = write_picture("back.exr", back), left_file = write_picture("left.png", left);
  const json pictures = {{"back", {{"image", back_file}}}, {"left", {{"image", left_file}}}};
  add_case("gaussians", {{"matte", write_matte("gaussians.exr", gaussians)}}, pictures);
  add_case("boxes", {{"matte", write_matte("boxes.exr", boxes)}}, pictures);
  add_case("leaks", {{"matte", write_matte("leaks.exr", leaks)}}, pictures);
  // A file of 16 bits whose data window hugs the object.
  Matte beside = gaussians;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (x < 7 || y < 5 || x > kWidth - 4 || y > kHeight - 9) beside.coverage(x, y) = 0.0f;
    }
  }
  ASSERT_OK(write_delivery(encode_matte(beside).value(), {.half = true, .hug = true}, path("hugged.exr")));
  const Matte hugged = read_matte(path("hugged.exr")).value();
  add_case("hugged", {{"matte", path("hugged.exr")}}, pictures);
  add_case("bright", {{"matte", path("leaks.exr")}, {"foreground_gain", 3.0}}, pictures);
  run();

  const std::vector<RadianceImage> behind = {
      back, resized(read_radiance(left_file, Encoding::kDisplay).value(), 2 * kWidth, 2 * kHeight)};
  Matte bright = leaks;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (float& light : bright.foreground(x, y)) light *= 3.0f;
    }
  }
  for (const auto& [name, matte] : {std::pair<const char*, const Matte*>{"gaussians", &gaussians},
                                    {"boxes", &boxes},
                                    {"leaks", &leaks},
                                    {"hugged", &hugged},
                                    {"bright", &bright}}) {
    const double db = psnr_db(picture_of(name, kWidth, kHeight), composite(*matte, behind).value());
    EXPECT_GT(db, 40.0) << name;
    RecordProperty(name, std::to_string(db));
  }
}

TEST_F(BlenderAddOn, MovesAndScalesPictures) {
  const Matte matte = mixed_matte(kWidth, kHeight);
  const RadianceImage back = picture_of_waves(2 * kWidth, 2 * kHeight);
  const std::string file = write_picture("back.exr", back);
  const std::string matte_file = write_matte("vase.exr", matte);
  add_case("moved", {{"matte", matte_file}},
           {{"back", {{"image", file}, {"offset", {12.0, -5.0}}, {"scale", 2.0}}}});
  run();
  // Twice as large about the middle, then moved; beyond its edges it goes on as it ends.
  RadianceImage placed(2 * kWidth, 2 * kHeight);
  for (int y = 0; y < placed.height_px; ++y) {
    for (int x = 0; x < placed.width_px; ++x) {
      const double u = kWidth + (x + 0.5 - kWidth - 12.0) / 2.0 - 0.5,
                   v = kHeight + (y + 0.5 - kHeight + 5.0) / 2.0 - 0.5;
      const int i = static_cast<int>(std::floor(u)), j = static_cast<int>(std::floor(v));
      const auto p = static_cast<float>(u - i), q = static_cast<float>(v - j);
      for (int c = 0; c < 3; ++c) {
        const auto at = [&](int column, int row) {
          return back.at(std::clamp(column, 0, back.width_px - 1), std::clamp(row, 0, back.height_px - 1), c);
        };
        placed.at(x, y, c) = (1.0f - q) * ((1.0f - p) * at(i, j) + p * at(i + 1, j)) +
                             q * ((1.0f - p) * at(i, j + 1) + p * at(i + 1, j + 1));
      }
    }
  }
  EXPECT_GT(psnr_db(picture_of("moved", kWidth, kHeight), composite(matte, {placed, {}}).value()), 40.0);
}

TEST_F(BlenderAddOn, APaneThatBendsNothingIsInvisibleInFootage) {
  const RadianceImage footage = picture_of_waves(160, 96);
  add_case("footage",
           {{"matte", write_matte("pane.exr", pane())},
            {"view", "FOOTAGE"},
            {"object_offset", {-20.0, 13.25}},
            {"object_scale", 1.5}},
           {{"back", {{"image", write_picture("footage.exr", footage)}}}});
  run();
  EXPECT_GT(psnr_db(picture_of("footage", 160, 96), footage), 35.0);
}

TEST_F(BlenderAddOn, TheObjectAloneIsPremultiplied) {
  const Matte matte = mixed_matte(kWidth, kHeight);
  const RadianceImage back = picture_of_waves(2 * kWidth, 2 * kHeight);
  add_case("object", {{"matte", write_matte("vase.exr", matte)}, {"view", "OBJECT"}},
           {{"back", {{"image", write_picture("back.exr", back)}}}});
  run();
  std::vector<float> alpha;
  const RadianceImage picture = picture_of("object", kWidth, kHeight, &alpha);
  ASSERT_EQ(alpha.size(), static_cast<size_t>(kWidth * kHeight));
  RadianceImage expected = composite(matte, {back, {}}).value();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const float covered = matte.coverage(x, y);
      EXPECT_EQ(alpha[y * kWidth + x], covered);
      for (int c = 0; c < 3; ++c) expected.at(x, y, c) *= covered;
    }
  }
  EXPECT_GT(psnr_db(picture, expected), 40.0);
}

// The mattes of a video in front of a sequence that begins again.
TEST_F(BlenderAddOn, WritesTheScenesFrames) {
  std::filesystem::create_directory(scratch_ / "video");
  std::vector<Matte> mattes(3, mixed_matte(kWidth, kHeight));
  std::vector<RadianceImage> pictures;
  for (int i = 0; i < 3; ++i) {
    Matte& matte = mattes[i];
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) matte.foreground(x, y)[0] = 0.25f * static_cast<float>(i);
    }
    write_matte(fmt::format("video/000{}.exr", i), matte);
  }
  for (int i = 0; i < 2; ++i) {
    pictures.push_back(picture_of_waves(2 * kWidth, 2 * kHeight));
    for (float& light : pictures.back().samples) light *= 1.0f - 0.5f * static_cast<float>(i);
    write_picture(fmt::format("back_0{}.exr", 8 + i), pictures.back());
  }
  add_case("frames", {{"matte", path("video")}, {"directory", path("made")}, {"frame_start", 3}},
           {{"back", {{"sequence", path("back_08.exr")}, {"frame_offset", 1}}}});
  cases_.back()["frames"] = {3, 5};
  run();
  for (size_t i = 0; i < 3; ++i) {
    const absl::StatusOr<RadianceImage> made =
        read_radiance(path(fmt::format("made/glasswing_000{}.exr", 3 + i)), Encoding::kLinear);
    ASSERT_OK(made) << error_of("frames");
    EXPECT_GT(psnr_db(*made, composite(mattes[i], {pictures[(i + 1) % 2], {}}).value()), 40.0) << i;
  }
}

TEST_F(BlenderAddOn, SaysWhatIsWrong) {
  ASSERT_OK(write_file_durably(path("text.exr"), "not a matte"));
  ASSERT_OK(write_file_durably(path("rays.exr"), encode_rays(RayMatte(8, 8, 1)).value()));
  const std::string whole = encode_matte(mixed_matte(kWidth, kHeight)).value();
  ASSERT_OK(write_file_durably(path("short.exr"), std::string_view(whole).substr(0, whole.size() / 2)));
  write_picture("picture.exr", picture_of_waves(8, 8));
  for (const char* const name : {"none", "text", "rays", "short", "picture"})
    add_case(name, {{"matte", path(name + std::string(".exr"))}}, json::object());
  add_case("no picture", {{"matte", write_matte("pane.exr", pane())}, {"view", "FOOTAGE"}}, json::object());
  run();
  for (const auto& [name, words] : {std::pair{"none", "No such file"},
                                    {"text", "text.exr is not an OpenEXR file"},
                                    {"rays", "rays.exr contains rays"},
                                    {"short", "truncated"},
                                    {"picture", "picture.exr is not a matte"},
                                    {"no picture", "the first monitor needs a picture"}})
    EXPECT_NE(error_of(name).find(words), std::string::npos) << name << ": " << error_of(name);
}

}  // namespace
}  // namespace glasswing
