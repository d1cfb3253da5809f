#include "solver/ramp/ramp_extractor.h"

#include <gtest/gtest.h>

#include "tests/solver/ramp/ramp_scene.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using testing::Test;

size_t place(const RampScene& scene, int x, int y) {
  return static_cast<size_t>(y) * scene.width_px + x;
}

template <typename Visit>
void for_pixels(const RampScene& scene, const Visit& visit) {
  for (int y = 0; y < scene.height_px; ++y) {
    for (int x = 0; x < scene.width_px; ++x) visit(x, y, place(scene, x, y));
  }
}

// Whether all pixels within `distance` along the sides are object too.
bool is_inside(const RampScene::Truth& truth, int x, int y, int distance = 2) {
  return truth(x, y).object && truth(x - distance, y).object && truth(x + distance, y).object &&
         truth(x, y - distance).object && truth(x, y + distance).object;
}

std::string message_of(const absl::Status& status) {
  return std::string(status.message());
}

TEST(RampExtractor, FindsMaskPlaceAndShareOfALens) {
  RampScene scene;
  scene.gain = {0.9, 0.7, 1.0};
  const RampScene::Truth truth = [&](int x, int y) { return scene.lens(x, y); };
  const auto samples = scene.frame(truth);
  const auto extractor = scene.extractor();
  ASSERT_OK(extractor);
  const auto frame = extractor->extract(scene.view(samples), 1);
  ASSERT_OK(frame);
  for_pixels(scene, [&](int x, int y, size_t at) {
    const RampTruth here = truth(x, y);
    EXPECT_EQ(frame->alpha[at] > 0.0f, here.object) << x << " " << y;
    if (!is_inside(truth, x, y)) return;
    // Codes of 16 bits: half a code of 0.0056 a px of red and green, and of the line's other channels.
    EXPECT_NEAR(static_cast<double>(frame->x_px[at]), here.x_px, 0.01);
    EXPECT_NEAR(static_cast<double>(frame->y_px[at]), here.y_px, 0.01);
    EXPECT_NEAR(static_cast<double>(frame->rho[at]), here.rho, 1e-4);
  });
}

TEST(RampExtractor, ErrorsAreAsItsInformationSays) {
  RampScene scene;
  scene.read_sd = 0.004;
  RampOptions options;
  options.edge_px = 0;
  const RampScene::Truth truth = [&](int x, int y) { return scene.lens(x, y); };
  const auto samples = scene.frame(truth);
  const auto extractor = scene.extractor(options, 30);
  ASSERT_OK(extractor);
  const auto frame = extractor->extract(scene.view(samples), 1);
  ASSERT_OK(frame);
  double chi_square = 0.0, count = 0.0;
  for_pixels(scene, [&](int x, int y, size_t at) {
    const RampTruth here = truth(x, y);
    if (!is_inside(truth, x, y)) return;
    const double dx = static_cast<double>(frame->x_px[at]) - here.x_px,
                 dy = static_cast<double>(frame->y_px[at]) - here.y_px;
    chi_square += static_cast<double>(frame->info_xx[at]) * dx * dx +
                  2.0 * static_cast<double>(frame->info_xy[at]) * dx * dy +
                  static_cast<double>(frame->info_yy[at]) * dy * dy;
    count += 1.0;
  });
  // Chi-square of two degrees: standard deviation 2; five standard errors, and 2 % for the map and manifold,
  // which come from 30 noisy frames.
  ASSERT_GT(count, 3000.0);
  EXPECT_NEAR(chi_square / count, 2.0, 10.0 / std::sqrt(count) + 0.04);
}

TEST(RampExtractor, LightThatIsThereWithoutTheRampIsTakenOff) {
  constexpr int kLit = 3'277;  // codes
  const RampScene scene;
  const auto truth = [&](int x, int y) { return scene.lens(x, y); };
  const auto lit = [&](const RampScene::Truth& of) {
    return scene.frame([&](int x, int y) {
      RampTruth here = of(x, y);
      here.f = kLit / 65535.0;
      return here;
    });
  };
  const std::vector<std::uint16_t> empty = lit([](int, int) { return RampTruth{}; }),
                                   black(empty.size(), kLit);
  const std::array<FrameView, 1> empties{scene.view(empty)}, blacks{scene.view(black)};
  const auto extractor = RampExtractor::create(scene.manifest(), {}, empties, {}, blacks);
  ASSERT_OK(extractor);
  const auto frame = extractor->extract(scene.view(lit(truth)), 1);
  ASSERT_OK(frame);
  const auto unlit = scene.extractor()->extract(scene.view(scene.frame(truth)), 1);
  ASSERT_OK(unlit);
  EXPECT_EQ(frame->alpha, unlit->alpha);
  for_pixels(scene, [&](int x, int y, size_t at) {
    if (!is_inside(truth, x, y)) return;
    // One code is 0.003 px.
    EXPECT_NEAR(frame->x_px[at], unlit->x_px[at], 0.01) << x << " " << y;
    EXPECT_NEAR(frame->y_px[at], unlit->y_px[at], 0.01) << x << " " << y;
    EXPECT_NEAR(frame->rho[at], unlit->rho[at], 1e-4) << x << " " << y;
  });
}

TEST(RampExtractor, AFrameTakesTheMemoryOfAnotherAndNothingElseOfIt) {
  RampScene scene;
  scene.read_sd = 0.004;
  const auto extractor = scene.extractor();
  ASSERT_OK(extractor);
  const auto samples = scene.frame([&](int x, int y) { return scene.lens(x, y); });
  const auto fresh = extractor->extract(scene.view(samples), 1);
  ASSERT_OK(fresh);
  RampFrame spent(scene.width_px, scene.height_px);
  std::vector<float> RampFrame::*const planes[] = {
      &RampFrame::alpha,     &RampFrame::rho,     &RampFrame::x_px,    &RampFrame::y_px,
      &RampFrame::highlight, &RampFrame::info_xx, &RampFrame::info_xy, &RampFrame::info_yy};
  for (const auto plane : planes) std::ranges::fill(spent.*plane, 7.0f);
  std::ranges::fill(spent.flags, std::uint8_t{7});
  const auto other = extractor->extract(scene.view(samples), 3, std::move(spent));
  ASSERT_OK(other);
  for (const auto plane : planes) EXPECT_EQ((*fresh).*plane, (*other).*plane);
  EXPECT_EQ(fresh->flags, other->flags);
}

TEST(RampExtractor, LearnsTheNoiseFromTheEmptyFrames) {
  RampScene scene;
  scene.read_sd = 0.01;
  const auto samples = scene.frame([&](int x, int y) { return scene.lens(x, y); });
  std::vector<std::vector<std::uint16_t>> frames;
  std::vector<FrameView> views;
  for (unsigned i = 0; i < 8; ++i) frames.push_back(scene.empty(i));
  for (const auto& each : frames) views.push_back(scene.view(each));
  v1::CaptureManifest manifest = scene.manifest();
  const auto told = RampExtractor::create(manifest, {}, views, {})->extract(scene.view(samples), 1);
  ASSERT_OK(told);
  manifest.mutable_camera()->set_read_sd(0.0);
  for (const size_t known : {size_t{1}, size_t{8}}) {
    const auto extractor = RampExtractor::create(manifest, {}, std::span(views).first(known), {});
    ASSERT_OK(extractor);
    // The roughness of one frame is a median over 19 000 pixels, a fifth of which show the object.
    const auto frame = extractor->extract(scene.view(samples), 1);
    ASSERT_OK(frame);
    EXPECT_NEAR(frame->rho_sd, told->rho_sd, 0.05 * static_cast<double>(told->rho_sd)) << known;
    size_t wrong = 0;
    for_pixels(scene, [&](int x, int y, size_t at) {
      if ((frame->alpha[at] > 0.0f) != scene.lens(x, y).object) ++wrong;
    });
    EXPECT_LT(wrong, 100u) << known;  // of the circle's 226 edge pixels, the hardly covered ones
  }
}

TEST(RampExtractor, WhereTheCameraLooksIsToldByTheColours) {
  RampScene scene;
  // From farther off than the whole monitor, and turned.
  scene.behind = [](double x, double y) {
    const double w = 1.0 + 0.0004 * x - 0.0003 * y;
    return std::array<double, 2>{(1.2 * x - 0.05 * y - 12.0) / w, (0.04 * x + 1.25 * y - 14.0) / w};
  };
  const auto samples = scene.empty();
  const auto extractor = scene.extractor();
  ASSERT_OK(extractor);
  const auto frame = extractor->extract(scene.view(samples), 1);
  ASSERT_OK(frame);
  const Matte matte = extractor->matte(*frame);
  int beyond = 0;
  for_pixels(scene, [&](int x, int y, size_t at) {
    const auto [bx, by] = scene.behind(x + 0.5, y + 0.5);
    EXPECT_EQ(frame->alpha[at], 0.0f);
    EXPECT_NEAR(static_cast<double>(frame->x_px[at]), bx, 0.02);
    EXPECT_NEAR(static_cast<double>(frame->y_px[at]), by, 0.02);
    if (bx > -1.0 && bx < scene.width_px + 1.0 && by > -1.0 && by < scene.height_px + 1.0) return;
    ++beyond;
    EXPECT_EQ(matte.modes(x, y, 0)[0].weight, 0.0f) << x << " " << y;
  });
  EXPECT_GT(beyond, 1000);
}

TEST(RampExtractor, AHighlightKeepsTheLensBehindIt) {
  RampScene scene;
  const RampScene::Truth truth = [&](int x, int y) {
    RampTruth here = scene.lens(x, y);
    const double dx = x - 68.0, dy = y - 60.0;
    if (here.object) here.f = 0.5 * std::exp(-(dx * dx + dy * dy) / 8.0);
    return here;
  };
  const auto samples = scene.frame(truth);
  const auto extractor = scene.extractor();
  ASSERT_OK(extractor);
  auto frame = extractor->extract(scene.view(samples), 1);
  ASSERT_OK(frame);
  extractor->finish(scene.view(samples), *frame, 1);
  for_pixels(scene, [&](int x, int y, size_t at) {
    const RampTruth here = truth(x, y);
    if (!is_inside(truth, x, y)) return;
    // Less than the rise of 0.02 is not looked for; of the ramp's light, which is 1 at most. c is
    // interpolated over 10 px, and bends nowhere.
    EXPECT_NEAR(static_cast<double>(frame->highlight[at]), here.f, 0.03) << x << " " << y;
    if (here.f > 0.1) {
      EXPECT_EQ(frame->info_xx[at], 0.0f);
      EXPECT_NEAR(static_cast<double>(frame->x_px[at]), here.x_px, 1.5);
      EXPECT_NEAR(static_cast<double>(frame->y_px[at]), here.y_px, 1.5);
    }
  });
  RampOptions options;
  options.highlights = false;
  const auto dark = scene.extractor(options);
  frame = dark->extract(scene.view(samples), 1);
  dark->finish(scene.view(samples), *frame, 1);
  for_pixels(scene, [&](int, int, size_t at) {
    EXPECT_EQ(frame->highlight[at], 0.0f);
    EXPECT_LE(frame->rho[at], 1.0f);
  });
}

TEST(RampExtractor, AClippedHighlightIsWhite) {
  RampScene scene;
  const RampScene::Truth truth = [&](int x, int y) {
    RampTruth here = scene.lens(x, y);
    if (std::hypot(x - 70, y - 66) < 3.0) here.f = 3.0;
    return here;
  };
  const auto samples = scene.frame(truth);
  for (const double least : {0.0, 1.0}) {
    RampOptions options;
    options.clipped_highlight = least;
    const auto extractor = scene.extractor(options);
    auto frame = extractor->extract(scene.view(samples), 1);
    ASSERT_OK(frame);
    extractor->finish(scene.view(samples), *frame, 1);
    const size_t at = place(scene, 70, 66);
    EXPECT_EQ(frame->flags[at] & kFlagSaturated, kFlagSaturated);
    if (least > 0.0) {
      EXPECT_EQ(frame->highlight[at], 1.0f);
    }
    if (least == 0.0) {
      EXPECT_LT(frame->highlight[at], 1.0f);
    }
  }
}

TEST(RampExtractor, ResultsDoNotDependOnThreads) {
  RampScene scene;
  scene.read_sd = 0.005;
  const auto samples = scene.frame([&](int x, int y) {
    RampTruth here = scene.lens(x, y);
    if (std::hypot(x - 70, y - 66) < 3.0) here.f = 0.6;
    return here;
  });
  const auto extractor = scene.extractor();
  auto one = extractor->extract(scene.view(samples), 1), many = extractor->extract(scene.view(samples), 5);
  ASSERT_TRUE(one.ok() && many.ok());
  extractor->finish(scene.view(samples), *one, 1);
  extractor->finish(scene.view(samples), *many, 5);
  EXPECT_EQ(one->alpha, many->alpha);
  EXPECT_EQ(one->rho, many->rho);
  EXPECT_EQ(one->x_px, many->x_px);
  EXPECT_EQ(one->info_xy, many->info_xy);
  EXPECT_EQ(one->highlight, many->highlight);
  EXPECT_EQ(one->flags, many->flags);
}

TEST(RampExtractor, ThePatchBelowThePictureIsNoObject) {
  RampScene scene;
  scene.behind = [](double x, double y) { return std::array<double, 2>{x, 1.1 * y}; };
  v1::CaptureManifest manifest = scene.manifest();
  manifest.mutable_monitors(0)->set_patch_rows(8);
  const auto empty = scene.empty();
  auto samples = empty;
  const auto in_patch = [&](int y) {
    return 1.1 * (y + 0.5) > scene.height_px + 1 && 1.1 * (y + 0.5) < scene.height_px + 7;
  };
  for_pixels(scene, [&](int, int y, size_t at) {
    if (in_patch(y)) samples[3 * at + 1] = 50'000;
  });
  const FrameView view = scene.view(empty);
  const auto extractor = RampExtractor::create(manifest, {}, {&view, 1}, {});
  ASSERT_OK(extractor);
  const auto frame = extractor->extract(scene.view(samples), 1);
  ASSERT_OK(frame);
  for_pixels(scene, [&](int, int y, size_t at) {
    EXPECT_EQ(frame->alpha[at], 0.0f);
    if (in_patch(y)) {
      EXPECT_EQ(frame->flags[at], kFlagNoData);
    }
  });
}

TEST(RampExtractor, SaysWhatIsWrongWithTheEmptyStage) {
  RampScene scene;
  const auto status_of = [&](const std::vector<std::uint16_t>& samples) {
    const FrameView view = scene.view(samples);
    return RampExtractor::create(scene.manifest(), {}, {&view, 1}, {}).status();
  };
  const std::vector<std::uint16_t> black(scene.empty().size());
  EXPECT_NE(message_of(status_of(black)).find("does not show the ramp: it is black"), std::string::npos);
  const std::vector<std::uint16_t> gray(black.size(), 30'000);
  EXPECT_NE(message_of(status_of(gray)).find("does not show the ramp"), std::string::npos);
  scene.gain = {1.6, 1.6, 1.6};
  EXPECT_NE(message_of(status_of(scene.empty())).find("saturated"), std::string::npos);
  EXPECT_EQ(RampExtractor::create(scene.manifest(), {}, {}, {}).status().code(),
            absl::StatusCode::kFailedPrecondition);
  RampScene smaller;
  smaller.width_px = 100;
  const auto empty = smaller.empty();
  const FrameView view = smaller.view(empty);
  const auto other = RampExtractor::create(scene.manifest(), {}, {&view, 1}, {}).status();
  EXPECT_EQ(other.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(message_of(other).find("100x120"), std::string::npos);
}

TEST(RampExtractor, SaysWhatIsWrongWithAFrame) {
  RampScene scene;
  const auto extractor = scene.extractor();
  const std::vector<std::uint16_t> black(scene.empty().size());
  EXPECT_NE(message_of(extractor->extract(scene.view(black), 1).status()).find("does not show the ramp"),
            std::string::npos);
  FrameView view = scene.view(black);
  view.width_px -= 1;
  EXPECT_EQ(extractor->extract(view, 1).status().code(), absl::StatusCode::kInvalidArgument);

  RampScene moved = scene;
  moved.behind = [](double x, double y) { return std::array<double, 2>{x + 3.0, y - 2.0}; };
  const auto status = extractor->extract(moved.view(moved.empty()), 1).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_NE(message_of(status).find("+3.0 -2.0 px"), std::string::npos) << status;

  RampScene brighter = scene;
  brighter.gain = {0.8, 0.8, 0.8};
  EXPECT_NE(message_of(extractor->extract(brighter.view(brighter.empty()), 1).status()).find("0.80 times"),
            std::string::npos);
}

// Each pixel is within its noise, but not all together.
TEST(RampExtractor, ABackgroundThatMovedALittleIsSeenThroughNoise) {
  RampScene scene;
  scene.read_sd = 0.01;
  const auto extractor = scene.extractor({}, 8);
  ASSERT_OK(extractor);
  for (const double shift_px : {0.0, 2.0}) {
    RampScene moved = scene;
    moved.behind = [&](double x, double y) { return std::array<double, 2>{x - shift_px, y}; };
    const auto lens = [&](int x, int y) { return scene.lens(x, y); };
    const auto frame = extractor->extract(moved.view(moved.frame(lens)), 1);
    EXPECT_EQ(frame.ok(), shift_px == 0.0) << frame.status();
    if (!frame.ok()) {
      EXPECT_NE(message_of(frame.status()).find("the background moved by +"), std::string::npos)
          << frame.status();
    }
  }
}

TEST(RampExtractor, AnObjectOverEverythingIsSolvedWithAWarning) {
  RampScene scene;
  const auto samples = scene.frame([&](int x, int y) {
    return RampTruth{.object = true,
                     .x_px = 0.5 * scene.width_px - 0.9 * (x + 0.5 - 0.5 * scene.width_px),
                     .y_px = 0.5 * scene.height_px - 0.9 * (y + 0.5 - 0.5 * scene.height_px),
                     .rho = 0.9};
  });
  const auto extractor = scene.extractor();
  const auto frame = extractor->extract(scene.view(samples), 1);
  ASSERT_OK(frame);
  const Matte matte = extractor->matte(*frame);
  ASSERT_EQ(matte.metadata.warnings_size(), 1);
  EXPECT_NE(matte.metadata.warnings(0).find("covers the whole background"), std::string::npos);
}

TEST(RampExtractor, FootprintsAreAsWideAsTheStepsOfTheWarp) {
  RampScene scene;
  const auto truth = [&](int x, int y) {
    RampTruth here = scene.lens(x, y);
    if (here.object) here.x_px = 80.0 + 1.7 * (x + 0.5 - 72.0), here.y_px = 60.0 + 1.3 * (y + 0.5 - 66.0);
    return here;
  };
  const auto samples = scene.frame(truth);
  const auto extractor = scene.extractor();
  const auto frame = extractor->extract(scene.view(samples), 1);
  ASSERT_OK(frame);
  const Matte matte = extractor->matte(*frame);
  EXPECT_EQ(matte.metadata.footprint(), kBoxFootprint);
  EXPECT_TRUE(matte.is_colourless());
  for_pixels(scene, [&](int x, int y, size_t at) {
    const std::span<const Mode> modes = matte.modes(x, y, 0);
    if (frame->alpha[at] == 0.0f) {
      EXPECT_EQ(modes[0].weight, 1.0f);
      EXPECT_NEAR(std::sqrt(12.0f * modes[0].xx_px2), 1.0f, 1e-3f);
    } else if (is_inside(truth, x, y)) {
      EXPECT_NEAR(std::sqrt(12.0f * modes[0].xx_px2), 1.7f, 0.02f);
      EXPECT_NEAR(std::sqrt(12.0f * modes[0].yy_px2), 1.3f, 0.02f);
    }
  });
}

}  // namespace
}  // namespace glasswing
