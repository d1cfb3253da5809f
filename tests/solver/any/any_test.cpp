// Light of shapes that no few Gaussians describe. Truth is by brute force: sums over a monitor's flat pixels
// (tests/gate/light.h).
#include <google/protobuf/text_format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <numbers>
#include <optional>
#include <tuple>

#include "core/composite/compositor.h"
#include "core/composite/fast_compositor.h"
#include "core/design/plan_design.h"
#include "core/footprint/composite_error.h"
#include "core/matte/matte_file.h"
#include "core/matte/packed_matte.h"
#include "solver/any/pyramid_fit.h"
#include "tests/solver/any/shape_scene.h"

namespace glasswing {
namespace {

using any_shape::kMonitor;
using any_shape::Shape;
using any_shape::shares_of;
using any_shape::solved;
using gate::Scene;

const std::map<std::string, Shape>& shapes() {
  static const std::map<std::string, Shape> all{
      {"ring", [](double x, double y) { return std::exp(-0.5 * std::pow(std::hypot(x, y) - 12.0, 2)); }},
      {"crescent",
       [](double x, double y) { return std::hypot(x, y) < 10.0 && std::hypot(x - 5.0, y - 2.0) > 8.0; }},
      {"box", [](double x, double y) { return std::abs(x) < 10.0 && std::abs(y) < 6.0; }},
      {"letter",
       [](double x, double y) {
         return (std::abs(x + 6.0) < 2.0 && std::abs(y) < 11.0) ||
                (x > -8.0 && x < 6.0 && (std::abs(y + 9.0) < 2.0 || std::abs(y) < 2.0)) ||
                (std::abs(x - 5.0) < 2.0 && y > -11.0 && y < 2.0) ||
                (std::abs(x - 0.75 * y + 0.5) < 2.2 && y >= 1.0 && y < 11.0);
       }},
      {"spokes",
       [](double x, double y) {
         for (const double turn : {0.3, 2.394, 4.489}) {
           const double along = x * std::cos(turn) + y * std::sin(turn),
                        across = y * std::cos(turn) - x * std::sin(turn);
           if (along > 0.0 && along < 16.0 && std::abs(across) < 1.2) return 1.0;
         }
         return 0.0;
       }},
      {"lobe",
       [](double x, double y) {
         const double r = std::hypot(x, y);
         return std::exp(-r / 5.0) + 8.0 * std::exp(-r * r);
       }},
      {"arc", [](double x, double y) { return y > 0.3 * x && std::abs(std::hypot(x, y) - 14.0) < 1.0; }},
      {"comb",
       [](double x, double y) {
         return std::abs(x) < 12.0 && std::abs(y) < 7.0 && std::fmod(x + 24.0, 6.0) < 2.0;
       }},
      {"lobes",
       [](double x, double y) {
         return std::exp(-std::hypot(x - 9.0, y + 3.0) / 3.0) +
                0.6 * std::exp(-std::hypot(x + 8.0, y - 4.0) / 2.0);
       }},
  };
  return all;
}

// By which fits were not chosen; nor errors by chevron and spiral.
const std::map<std::string, Shape>& other_shapes() {
  static const std::map<std::string, Shape> all{
      {"half disc", [](double x, double y) { return std::hypot(x, y) < 9.0 && y > 0.4 * x - 1.0; }},
      {"chevron",
       [](double x, double y) { return std::abs(y - 0.8 * std::abs(x) + 4.0) < 2.5 && std::abs(x) < 11.0; }},
      {"spiral",
       [](double x, double y) {
         const double turn = std::atan2(y, x) + std::numbers::pi;
         return std::abs(std::hypot(x, y) - 3.0 - 1.9 * turn) < 1.1;
       }},
      {"cross",
       [](double x, double y) {
         return std::min(std::abs(x), std::abs(y)) < 1.5 && std::max(std::abs(x), std::abs(y)) < 10.0;
       }},
  };
  return all;
}

// A row of camera pixels, all but the ends of which see the shape, each elsewhere; "lobes" across an edge.
Scene scene_of(const std::string& name, int width_px = 8) {
  const Shape& shape = shapes().contains(name) ? shapes().at(name) : other_shapes().at(name);
  const double left_px = name == "lobes" ? -4.0 : 26.0, right_px = name == "lobes" ? 4.0 : 102.0;
  Scene scene = any_shape::two_rows("any", width_px);
  std::mt19937 random(5);
  const auto in = [&](double low, double high) { return low + (high - low) * gate::uniform(random); };
  for (int i = 1; i + 1 < width_px; ++i) {
    const double y_px = in(26, 70), x_px = in(left_px, right_px);
    any_shape::put(scene, i, shares_of(shape, x_px, y_px));
  }
  return scene;
}

const std::string kSweeps =
    "method: 'gaussian' solids { colour: [0, 0, 0] } solids { colour: [1, 1, 1] } square_waves { levels: 7 } "
    "sweeps { orientation_deg: 0 sigma_px: 4 } sweeps { orientation_deg: 90 sigma_px: 4 } "
    "sweeps { orientation_deg: 45 sigma_px: 4 } sweeps { orientation_deg: -45 sigma_px: 4 } exposure_ms: 4";

const std::string& designed(int images, bool any = false) {
  static std::map<std::pair<int, bool>, std::string> known;
  std::string& text = known[{images, any}];
  if (!text.empty()) return text;
  v1::Monitor monitor;
  monitor.set_name("back");
  monitor.set_width_px(kMonitor.width_px);
  monitor.set_height_px(kMonitor.height_px);
  const DesignWish wish{
      .images = images, .noise = {.read_sd = 0.005, .full_well = {}}, .any_footprints = any};
  google::protobuf::TextFormat::PrintToString(
      design_plan(wish, {.monitors = {monitor}, .camera = {}}).value().plan, &text);
  return text;
}

// A picture such as photographs are: amplitudes of waves fall with their frequency, and most of it is light
// or dark with edges between.
RadianceImage clouds(unsigned seed = 3) {
  std::mt19937 random(seed);
  RadianceImage picture(kMonitor.width_px, kMonitor.height_px);
  for (int c = 0; c < kChannels; ++c) {
    std::vector<std::array<double, 3>> waves;
    for (int i = 0; i < 60; ++i) {
      const double frequency = 0.008 * std::pow(30.0, gate::uniform(random)),
                   turn = std::numbers::pi * gate::uniform(random);
      waves.push_back({2.0 * std::numbers::pi * frequency * std::cos(turn),
                       2.0 * std::numbers::pi * frequency * std::sin(turn), 6.3 * gate::uniform(random)});
    }
    for (int y = 0; y < kMonitor.height_px; ++y) {
      for (int x = 0; x < kMonitor.width_px; ++x) {
        double sum = 0.0;
        for (const auto& [u, v, phase] : waves)
          sum += 0.0008 / std::hypot(u, v) * 2.0 * std::numbers::pi * std::sin(u * x + v * y + phase);
        picture.at(x, y, c) = static_cast<float>(0.5 + 0.5 * std::tanh(8.0 * sum));
      }
    }
  }
  return picture;
}

// How composites of three pictures keep to their stated errors, bias included; of pixels without a flag.
struct Kept {
  double count = 0.0, within = 0.0, squares = 0.0;  // samples of pyramids: all, within one, sum of z^2
  double pixels = 0.0, beyond = 0.0;                // channels of any pixel: all, visibly beyond kFar by rms
  static constexpr double kFar = 5.0, kVisible = 1e-3;

  Kept& operator+=(const Kept& other) {
    count += other.count, within += other.within, squares += other.squares;
    pixels += other.pixels, beyond += other.beyond;
    return *this;
  }
  double share() const { return within / count; }
  double rms() const { return std::sqrt(squares / count); }
};

Kept kept_by(const Scene& scene, const Matte& matte) {
  constexpr int kPictures = 3;
  Kept kept;
  std::map<std::pair<int, int>, std::array<double, 2>>
      of_pixels;  // squares of z and of light, by x and channel
  for (unsigned picture = 0; picture < kPictures; ++picture) {
    const std::vector<RadianceImage> shown{clouds(3 + picture)};
    const RadianceImage made = composite(matte, shown).value(), error = composite_error(matte, shown).value(),
                        truth = gate::photograph(scene, true, shown);
    for (int x = 0; x < matte.width_px(); ++x) {
      for (int c = 0; c < kChannels; ++c) {
        if (!scene.inside[x] || !std::isfinite(error.at(x, 0, c))) continue;
        const auto off = static_cast<double>(made.at(x, 0, c) - truth.at(x, 0, c));
        const double z = off / static_cast<double>(error.at(x, 0, c));
        of_pixels[{x, c}][0] += z * z / kPictures;
        of_pixels[{x, c}][1] += off * off / kPictures;
        if (matte.pyramids(x, 0, c).empty()) continue;
        ++kept.count;
        kept.within += std::abs(z) < 1.0;
        kept.squares += z * z;
      }
    }
  }
  for (const auto& [_, squares] : of_pixels) {
    ++kept.pixels;
    kept.beyond += squares[0] > Kept::kFar * Kept::kFar && squares[1] > Kept::kVisible * Kept::kVisible;
  }
  return kept;
}

double psnr_of(const Scene& scene, const Matte& matte) {
  const std::vector<RadianceImage> shown{clouds()};
  return gate::psnr(scene, composite(matte, shown).value(), gate::photograph(scene, true, shown));
}

const std::map<std::string, std::string> kAny{{"footprints", "any"}};

class AnyShape : public testing::TestWithParam<std::string> {};
std::string name_of(const testing::TestParamInfo<std::string>& shape) {
  return shape.param;
}

// Floors at 0.5 % noise are goals: 38 dB of a ring and 36 of others by four sweeps, 40 by 100 designed
// images, 44 by as many designed ones as the sweeps are. Gaussians are hardly better at any noise, except for
// thin light; above 60 dB no difference is visible.
TEST_P(AnyShape, IsShownAsItIs) {
  const bool is_new = GetParam() == "arc" || GetParam() == "comb" || GetParam() == "lobes";
  const double loss_db =
      GetParam() == "arc" || GetParam() == "spokes" || GetParam() == "crescent" ? 1.6 : 0.6;
  const Scene scene = scene_of(GetParam());
  Kept kept;
  for (const auto& [plan, name, floor_db] :
       {std::tuple{kSweeps, "sweeps", GetParam() == "ring" ? 38.0 : 36.0},
        {designed(100), "designed", 40.0},
        {designed(100, true), "any", 40.0},
        {designed(374, true), "any 374", 44.0}}) {
    for (const double noise_sd : {0.0, 0.005, 0.02}) {
      Matte matte = solved(scene, plan, noise_sd, kAny);
      const double any = psnr_of(scene, matte);
      const std::int64_t flagged = count_pixels(matte).flagged;
      int pyramids = 0, coefficients = 0;
      for (int x = 0; x < matte.width_px(); ++x) {
        for (const PyramidFootprint& own : matte.pyramids(x, 0, 1)) {
          ++pyramids;
          coefficients += static_cast<int>(own.coefficients.size());
        }
      }
      kept += kept_by(scene, matte);
      matte.drop_pyramids();
      const double gaussian = psnr_of(scene, matte);
      std::printf(
          "%-8s %-8s noise %.3f: %.1f dB, by Gaussians %.1f; %d pyramids of %.0f coefficients, %d flagged\n",
          GetParam().c_str(), name, noise_sd, any, gaussian, pyramids,
          static_cast<double>(coefficients) / std::max(pyramids, 1), static_cast<int>(flagged));
      if (noise_sd == 0.005) {
        EXPECT_GE(any, floor_db) << name;
        if (!is_new) {
          EXPECT_GE(any, gaussian - 1.0) << name;
        }
      }
      EXPECT_GE(any, std::min(gaussian, 60.0) - loss_db) << name;
    }
  }
  // Nothing unexplained is without a flag: whatever their distribution, no more than 1 / k^2 of errors are
  // beyond k of their standard deviation (Chebyshev).
  std::printf("%-8s %.0f of %.0f beyond %.0f stated errors; pyramids: %.2f within one, rms z %.2f\n",
              GetParam().c_str(), kept.beyond, kept.pixels, Kept::kFar, kept.share(), kept.rms());
  EXPECT_GT(kept.pixels, 0.0);
  EXPECT_LE(kept.beyond, kept.pixels / (Kept::kFar * Kept::kFar));
}

INSTANTIATE_TEST_SUITE_P(Shapes, AnyShape,
                         testing::Values("ring", "crescent", "box", "letter", "spokes", "lobe", "arc", "comb",
                                         "lobes"),
                         name_of);

// A ring that two monitors side by side show the halves of: each has an edge through it, and pyramids of both
// are one pixel's.
TEST(Any, ShapesMayCrossTheEdgeBetweenTwoMonitors) {
  Scene scene = scene_of("ring");
  scene.monitors = {kMonitor, kMonitor};
  for (size_t i = 0; i < scene.object.size(); ++i) {
    if (!scene.inside[i]) continue;
    const double x_px = -5.0 + 2.0 * static_cast<double>(i), y_px = 30.0 + 4.0 * static_cast<double>(i);
    scene.object[i].paths = {
        {.monitor = 0,
         .tint = {0.4, 0.4, 0.4},
         .shares = shares_of(shapes().at("ring"), kMonitor.width_px + x_px, y_px)},
        {.monitor = 1, .tint = {0.3, 0.3, 0.3}, .shares = shares_of(shapes().at("ring"), x_px, y_px)}};
  }
  Matte matte = solved(scene, kSweeps, 0.005, kAny);
  int both = 0;
  for (int x = 0; x < matte.width_px(); ++x) both += matte.pyramids(x, 0, 1).size() == 2;
  EXPECT_GE(both, 2);
  const std::vector<RadianceImage> shown{clouds(), clouds()};
  const RadianceImage truth = gate::photograph(scene, true, shown);
  const double any = gate::psnr(scene, composite(matte, shown).value(), truth);
  matte.drop_pyramids();
  const double gaussian = gate::psnr(scene, composite(matte, shown).value(), truth);
  std::printf("two monitors: %.1f dB, by Gaussians %.1f; %d pixels with two pyramids\n", any, gaussian, both);
  EXPECT_GE(any, 38.0);
  EXPECT_GE(any, gaussian - 0.5);
}

// What Gaussians explain, and what they say of the rest, keeps its bits.
TEST(Any, LeavesModesAlone) {
  Scene scene = scene_of("ring");
  scene.object[2].paths[0].shares = gate::shares_of(gate::gaussian({60, 40, 4, 3, 20}), kMonitor);
  Matte any = solved(scene, kSweeps, 0.005, kAny);
  const Matte gaussian = solved(scene, kSweeps, 0.005, {});
  ASSERT_TRUE(any.has_pyramids());
  for (int x = 0; x < any.width_px(); ++x) {
    EXPECT_EQ(any.foreground(x, 0), gaussian.foreground(x, 0));
    if (x == 2) {
      EXPECT_EQ(any.flags(x, 0), gaussian.flags(x, 0));
    }
    for (int c = 0; c < kChannels; ++c) {
      EXPECT_EQ(std::memcmp(any.modes(x, 0, c).data(), gaussian.modes(x, 0, c).data(),
                            any.modes(x, 0, c).size_bytes()),
                0);
      EXPECT_EQ(any.pyramids(x, 0, c).empty(), x == 2 || !scene.inside[x]) << x;
    }
  }
  any.drop_pyramids();
  for (int x = 0; x < any.width_px(); ++x) {
    if (scene.inside[x] && x != 2) {
      EXPECT_NE(any.flags(x, 0) & kFlagPoorFit, 0);
    }
  }
}

TEST(Any, FilesHoldPyramids) {
  const Scene scene = scene_of("ring");
  const Matte matte = solved(scene, kSweeps, 0.005, kAny);
  const std::string file = encode_matte(matte).value();
  const Matte read = decode_matte(file, Pyramids::kKept).value();
  int coefficients = 0;
  for (int x = 0; x < matte.width_px(); ++x) {
    for (int c = 0; c < kChannels; ++c) {
      ASSERT_EQ(read.pyramids(x, 0, c).size(), matte.pyramids(x, 0, c).size());
      for (size_t i = 0; i < matte.pyramids(x, 0, c).size(); ++i) {
        const PyramidFootprint &a = matte.pyramids(x, 0, c)[i], &b = read.pyramids(x, 0, c)[i];
        EXPECT_EQ(std::tie(a.texture, a.foreground, a.noise_sd, a.prior_sd),
                  std::tie(b.texture, b.foreground, b.noise_sd, b.prior_sd));
        EXPECT_EQ(std::memcmp(a.coefficients.data(), b.coefficients.data(),
                              a.coefficients.size() * sizeof(Coefficient)),
                  0);
        coefficients += static_cast<int>(a.coefficients.size());
      }
    }
  }
  EXPECT_GT(coefficients, 0);
  // The fast compositor shows them, too, within the 0.002 that it promises.
  const std::vector<RadianceImage> shown{clouds()};
  const RadianceImage exact = composite(matte, shown).value(),
                      fast = composite_file(file, shown, [](Matte&) {}).value();
  double squares = 0.0;
  for (size_t i = 0; i < exact.samples.size(); ++i)
    squares += std::pow(static_cast<double>(fast.samples[i] - exact.samples[i]), 2);
  EXPECT_LE(std::sqrt(squares / static_cast<double>(exact.samples.size())), 0.002);
  // Tiles join to the same bytes.
  std::string joined;
  std::optional<PackedMatteWriter> writer;
  for (int y = 0; y < 2; ++y) {
    Matte tile(0, y, matte.width_px(), 1, matte.modes_per_channel());
    tile.metadata = matte.metadata;
    for (int x = 0; x < matte.width_px(); ++x) tile.copy_pixel(matte, x, y, x, 0);
    const std::string bytes = encode_matte(tile).value();
    if (!writer) {
      writer.emplace(PackedMatteWriter::begin(outline_of(file).value(), [&](auto offset, auto part) {
                       if (joined.size() < offset + part.size()) joined.resize(offset + part.size());
                       std::memcpy(&joined[offset], part.data(), part.size());
                       return absl::OkStatus();
                     }).value());
    }
    ASSERT_OK(writer->add(bytes));
  }
  ASSERT_OK(writer->finish());
  EXPECT_EQ(joined, file);
}

// Of shapes by which errors were chosen and of others. Three channels of a pixel share their bias, so that
// some 60 pixels tell: a share of 0.68 is known to 0.06, an rms of 1 to 0.09. Goals are 0.6 to 0.75 and 1.5.
TEST(Any, CompositesKnowTheirErrors) {
  constexpr double kKnownTo = 0.06;
  std::vector<std::string> names;
  for (const auto* all : {&shapes(), &other_shapes()}) {
    for (const auto& [name, _] : *all) names.push_back(name);
  }
  for (const auto& [plan, plan_name] : {std::pair{kSweeps, "sweeps"}, {designed(100, true), "any"}}) {
    Kept kept;
    for (const std::string& name : names) {
      const Scene scene = scene_of(name, 18);
      const Kept own = kept_by(scene, solved(scene, plan, 0.005, kAny));
      std::printf("%-8s %-9s %.0f samples: %.2f within one, rms z %.2f\n", plan_name, name.c_str(), own.count,
                  own.share(), own.rms());
      kept += own;
      if (plan == kSweeps) {
        EXPECT_GT(own.count, 0.0) << name;
      }
      if (own.count == 0.0) continue;  // Gaussians explain all of its pixels
      EXPECT_LE(own.rms(), 1.5) << plan_name << " " << name;
      EXPECT_GE(own.share(), 0.5) << plan_name << " " << name;
    }
    std::printf("%-8s %.2f within one, rms z %.2f\n", plan_name, kept.share(), kept.rms());
    EXPECT_GT(kept.count, 60.0);
    EXPECT_GE(kept.share(), 0.6 - kKnownTo) << plan_name;
    EXPECT_LE(kept.share(), 0.75 + kKnownTo) << plan_name;
    EXPECT_LE(kept.rms(), 1.5) << plan_name;
  }
}

// Pixels that all see one footprint: the scatter of their composites is the stated error, whatever patterns
// they were solved from; that of pyramids is at most it, as it counts what no pattern shows, too.
TEST(Any, ErrorsAreKnownFromSinusoids) {
  const std::string mixed = kSweeps +
                            " fringes { orientation_deg: 20 period_px: 60 period_px: 25 period_px: 12 "
                            "object_only: true } fringes { orientation_deg: 110 period_px: 60 period_px: 25 "
                            "period_px: 12 object_only: true }";
  const std::vector<RadianceImage> shown{clouds()};
  for (const auto& [plan, name] : {std::pair{designed(100), "designed"}, {mixed, "mixed"}}) {
    for (const bool any : {false, true}) {
      Scene scene = scene_of("box", 40);
      const gate::Shares shares = any ? shares_of(shapes().at("box"), 61.3, 47.9)
                                      : gate::shares_of(gate::gaussian({61.3, 47.9, 5, 3, 20}), kMonitor);
      for (size_t i = 0; i < scene.object.size(); ++i) {
        if (scene.inside[i]) scene.object[i].paths[0].shares = shares;
      }
      const Matte matte = solved(scene, plan, 0.005, any ? kAny : std::map<std::string, std::string>());
      const RadianceImage made = composite(matte, shown).value(),
                          error = composite_error(matte, shown).value();
      double sum = 0.0, squares = 0.0, stated = 0.0, count = 0.0;
      for (int x = 0; x < matte.width_px(); ++x) {
        // All channels show one picture's light here.
        const double light = made.at(x, 0, 1), own = error.at(x, 0, 1);
        if (!scene.inside[x] || !std::isfinite(own)) continue;
        sum += light, squares += light * light, stated += own * own;
        ++count;
      }
      ASSERT_GT(count, 30.0) << name;
      const double scatter = std::sqrt((squares - sum * sum / count) / (count - 1.0)),
                   expected = std::sqrt(stated / count);
      std::printf("%-8s %s: scatter %.5f, stated %.5f\n", name, any ? "pyramids" : "Gaussians", scatter,
                  expected);
      // The scatter of 38 pixels is known to 12 %.
      EXPECT_LT(scatter, 1.36 * expected) << name;
      if (!any) {
        EXPECT_GT(scatter, 0.64 * expected) << name;
      }
    }
  }
}

// A coefficient of which no matte is, or a count beyond the row, is refused. Who uses modes alone sees flags.
TEST(Any, PyramidsAreCheckedAndDropped) {
  const Scene scene = scene_of("ring");
  Matte matte = solved(scene, kSweeps, 0.005, kAny);
  const Matte dropped = decode_matte(encode_matte(matte).value()).value();
  EXPECT_FALSE(dropped.has_pyramids());
  EXPECT_EQ(dropped.metadata.footprint(), "");
  EXPECT_NE(dropped.flags(2, 0) & kFlagPoorFit, 0);
  ASSERT_FALSE(dropped.metadata.warnings().empty());
  matte.pyramids(2, 0, 1)[0].coefficients[0].weight = NAN;
  EXPECT_EQ(decode_matte(encode_matte(matte).value()).status().code(), absl::StatusCode::kDataLoss);
}

// One sample may hold more coefficients than its row has room for: it is flagged then, not cut short.
TEST(Any, WhatFindsNoRoomIsFlagged) {
  Matte matte(0, 0, 1, 1, 1);
  matte.metadata.set_format_version(1);
  matte.metadata.set_width_px(1);
  matte.metadata.set_height_px(1);
  matte.metadata.set_footprint(std::string(kPyramidFootprint));
  v1::Monitor& monitor = *matte.metadata.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(kMonitor.width_px);
  monitor.set_height_px(kMonitor.height_px);
  PyramidFootprint large;
  for (int i = 0; i < 300; ++i)
    large.coefficients.push_back({.level = 0, .column = i, .row = 1, .weight = 0.01f});
  matte.add_pyramid(0, 0, 0, large);
  large.coefficients.resize(80);
  matte.add_pyramid(0, 0, 1, large);
  const Matte read = decode_matte(encode_matte(matte).value(), Pyramids::kKept).value();
  EXPECT_TRUE(read.pyramids(0, 0, 0).empty());
  EXPECT_EQ(read.pyramids(0, 0, 1).size(), 1u);
  EXPECT_EQ(read.flags(0, 0), kFlagPoorFit);
}

}  // namespace
}  // namespace glasswing
