#include "core/pattern/id_patch.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <random>

#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kMonitorWidth = 128, kMonitorHeight = 96;
constexpr IdPatch kPatch{.width_px = kMonitorWidth, .first_row = 84, .rows = 12};

// A camera that sees the monitor rotated and scaled, blurred by its lens, with noise; an object hides a disc
// of it.
class SimulatedView {
 public:
  explicit SimulatedView(double noise_sd, double hidden_px = 0.0)
      : noise_(0.0, noise_sd), hidden_px_(hidden_px) {}

  Image16 frame(const RadianceImage& picture) {
    constexpr int kWidth = 160, kHeight = 120;
    Image16 frame(kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double u = 0.9 * (x - 80) - 0.05 * (y - 60) + 64.0, v = 0.05 * (x - 80) + 0.9 * (y - 60) + 48.0;
        for (int c = 0; c < 3; ++c) {
          // The pixel's box and the lens blur: nine points of a Gaussian of 0.5 px.
          double light = 0.0, weight = 0.0;
          for (int j = -1; j <= 1; ++j) {
            for (int i = -1; i <= 1; ++i) {
              const double own = std::exp(-0.5 * (i * i + j * j) * 1.0);
              light += own * radiance(picture, u + 0.5 * i, v + 0.5 * j, c);
              weight += own;
            }
          }
          const double value = 0.05 + 0.6 * light / weight + noise_(random_);
          frame.at(x, y, c) = code16_of(static_cast<float>(value));
        }
      }
    }
    return frame;
  }

 private:
  double radiance(const RadianceImage& picture, double u, double v, int c) const {
    if (std::hypot(u - 64.0, v - 90.0) < hidden_px_) return 0.1;
    const int x = static_cast<int>(std::floor(u)), y = static_cast<int>(std::floor(v));
    if (x < 0 || x >= picture.width_px || y < 0 || y >= picture.height_px) return 0.0;
    return static_cast<double>(picture.at(x, y, c));
  }
  std::normal_distribution<double> noise_;
  const double hidden_px_;
  std::mt19937 random_{11};
};

// A stripe at a random position, with the patch below.
RadianceImage picture_of(std::uint16_t id, std::mt19937& random) {
  std::uniform_real_distribution<double> place(0.0, kMonitorWidth);
  const double r = place(random);
  RadianceImage picture(kMonitorWidth, kMonitorHeight);
  for (int y = 0; y < kPatch.first_row; ++y) {
    for (int x = 0; x < kMonitorWidth; ++x) {
      for (int c = 0; c < 3; ++c)
        picture.at(x, y, c) = static_cast<float>(std::exp(-0.5 * std::pow((x + 0.5 - r) / 4.0, 2)));
    }
  }
  kPatch.draw(id, picture);
  return picture;
}

absl::StatusOr<PatchReader> learned(SimulatedView& view, std::mt19937& random) {
  std::vector<Image16> frames;
  for (const std::uint16_t id : patch_learning_ids()) frames.push_back(view.frame(picture_of(id, random)));
  return PatchReader::learn(frames);
}

TEST(IdPatch, AsMuchLightWhateverTheId) {
  const auto light = [](std::uint16_t id) {
    RadianceImage picture(kMonitorWidth, kMonitorHeight);
    kPatch.draw(id, picture);
    double sum = 0.0;
    for (const float sample : picture.samples) sum += static_cast<double>(sample);
    return sum;
  };
  for (const std::uint16_t id : {std::uint16_t{0}, std::uint16_t{0xffff}, std::uint16_t{0xf00d}})
    EXPECT_EQ(light(id), light(0x5a5a));
}

// Reads the right id or none; and the right one unless the noise is as large as the contrast of the cells.
TEST(IdPatch, IsReadBackRightOrNotAtAll) {
  for (const double noise_sd : {0.005, 0.03, 0.3}) {
    std::mt19937 random(5);
    SimulatedView quiet(0.005), view(noise_sd);
    const PatchReader reader = learned(quiet, random).value();
    int read = 0;
    for (int i = 0; i < 60; ++i) {
      const auto id = static_cast<std::uint16_t>(random());
      const std::optional<std::uint16_t> found = reader.read(view.frame(picture_of(id, random)));
      if (!found) continue;
      ++read;
      EXPECT_EQ(*found, id);
    }
    if (noise_sd < 0.1) {
      EXPECT_EQ(read, 60) << noise_sd;
    }
  }
}

TEST(IdPatch, AFrameOfTwoPicturesIsNotRead) {
  std::mt19937 random(6);
  SimulatedView view(0.005);
  const PatchReader reader = learned(view, random).value();
  const RadianceImage before = picture_of(0x1111, random), after = picture_of(0x2222, random);
  for (const float part : {0.13f, 0.35f, 0.5f, 0.65f, 0.87f}) {
    RadianceImage both = before;
    for (size_t i = 0; i < both.samples.size(); ++i)
      both.samples[i] = part * before.samples[i] + (1.0f - part) * after.samples[i];
    EXPECT_EQ(reader.read(view.frame(both)), std::nullopt) << part;
  }
}

// The object hides a disc before the middle of the patch.
TEST(IdPatch, APartlyHiddenPatchIsReadByTheBitsThatAreSeen) {
  std::mt19937 random(7);
  const auto learned_before = [](double hidden_px) {
    SimulatedView view(0.005, hidden_px);
    std::vector<Image16> frames;
    for (const std::uint16_t id : patch_learning_ids()) {
      RadianceImage picture(kMonitorWidth, kMonitorHeight);
      kPatch.draw(id, picture);
      frames.push_back(view.frame(picture));
    }
    return PatchReader::learn(frames);
  };
  SimulatedView view(0.005, 9.0);
  const absl::StatusOr<PatchReader> reader = learned_before(9.0);
  ASSERT_OK(reader);
  EXPECT_NE(reader->bits(), 0xffff);
  EXPECT_GE(std::popcount(reader->bits()), IdPatch::kMinBits);
  for (int i = 0; i < 30; ++i) {
    const auto id = static_cast<std::uint16_t>(random());
    const std::optional<std::uint16_t> found = reader->read(view.frame(picture_of(id, random)));
    ASSERT_TRUE(found);
    EXPECT_EQ(*found, id & reader->bits());
  }
  const absl::Status status = learned_before(40.0).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_NE(std::string(status.message()).find("of the 16 bits"), std::string::npos) << status;
}

// Of eight showings in a row, whose ids are multiples of kSpread (server/capture/step_player), no two have
// kMinBits bits in common: counted over all ids.
TEST(IdPatch, NoPictureHasTheVisibleBitsOfOneShortlyBefore) {
  constexpr std::uint32_t kSpread = 40503;
  for (std::uint32_t id = 0; id < 0x10000; ++id) {
    for (std::uint32_t later = 1; later < 8; ++later) {
      const std::uint32_t differing = (id ^ (id + later * kSpread)) & 0xffff;
      ASSERT_LT(IdPatch::kBits - std::popcount(differing), IdPatch::kMinBits) << id << " " << later;
    }
  }
}

// Frames of ids in another order, or of two ids each: hidden cells make no such thing.
TEST(IdPatch, PixelsThatChangeAtOtherTimesContradict) {
  const std::span<const std::uint16_t> ids = patch_learning_ids();
  for (const double hidden_px : {0.0, 9.0, 40.0}) {
    SimulatedView view(0.005, hidden_px);
    const auto frame_of = [&](std::uint16_t id, std::uint16_t other, float part) {
      RadianceImage picture(kMonitorWidth, kMonitorHeight), second = picture;
      kPatch.draw(id, picture);
      kPatch.draw(other, second);
      for (size_t i = 0; i < picture.samples.size(); ++i)
        picture.samples[i] = part * picture.samples[i] + (1.0f - part) * second.samples[i];
      return view.frame(picture);
    };
    for (const size_t late : {1u, 2u, 3u}) {
      for (const float part : {0.0f, 0.5f}) {
        std::vector<Image16> frames;
        for (size_t i = 0; i < ids.size(); ++i)
          frames.push_back(frame_of(ids[i], i < late ? ids[0] : ids[i - late], part));
        EXPECT_TRUE(absl::IsOutOfRange(PatchReader::learn(frames).status())) << late << " " << part;
      }
    }
    std::vector<Image16> right;
    for (const std::uint16_t id : ids) right.push_back(frame_of(id, id, 1.0f));
    EXPECT_FALSE(absl::IsOutOfRange(PatchReader::learn(right).status())) << hidden_px;
  }
}

// A short exposure, in which noise is half the contrast, is not taken for one.
TEST(IdPatch, NoiseDoesNotContradict) {
  for (const double noise_sd : {0.03, 0.1, 0.3}) {
    SimulatedView view(noise_sd);
    for (int i = 0; i < 20; ++i) {
      std::vector<Image16> frames;
      for (const std::uint16_t id : patch_learning_ids()) {
        RadianceImage picture(kMonitorWidth, kMonitorHeight);
        kPatch.draw(id, picture);
        frames.push_back(view.frame(picture));
      }
      EXPECT_FALSE(absl::IsOutOfRange(PatchReader::learn(frames).status())) << noise_sd;
    }
  }
}

}  // namespace
}  // namespace glasswing
