// Sessions whose truth is known: every pixel of the camera sees the monitor's pixel of the same place, or a
// far monitor with a black border, and an object in the middle shows another at half the light. What a rig
// does to the frames is applied by its own equation, and must be found again.
#include "solver/corrections/frame_corrections.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace glasswing {
namespace {

constexpr int kWidth = 64, kHeight = 48;
constexpr double kWhite = 0.85, kNoise = 0.003;

using Picture = std::vector<double>;  // kHeight rows of kWidth

// How the camera sees the monitor.
struct View {
  double scale = 1.0;                    // monitor px per camera px, about the middle
  int border_px = 0;                     // of the camera's picture, black
  int reach_x_px = 12, reach_y_px = 12;  // of the object, from its middle,
  int object_x_px = 32;                  // which lies there
  double turn_rad = 0.0;                 // of the camera's picture, clockwise
};
// A pixel and a bit: what flat pixels show beats with the camera's, as no smooth footprint does.
constexpr View kFar{.scale = 1.03, .border_px = 4, .reach_x_px = 20, .reach_y_px = 14};

struct Session {
  v1::CaptureManifest manifest;
  std::vector<Picture> frames;
  View view;
};

// The light of the flat pixel at a place on the monitor.
double shown(const v1::Stimulus& stimulus, double x_px, double y_px) {
  const double x = std::floor(x_px), y = std::floor(y_px);
  if (stimulus.kind() == "solid") return stimulus.colour(0);
  if (stimulus.kind() == "square") {
    const double t = stimulus.orient() == "vertical_bars" ? x : y;
    const bool lit = static_cast<int>(t / stimulus.bar_width_px()) % 2 == 0;
    return lit != stimulus.inverse() ? 1.0 : 0.0;
  }
  const double phi = stimulus.phi_deg() * std::numbers::pi / 180.0;
  const double away = (x + 0.5) * std::cos(phi) + (y + 0.5) * std::sin(phi) - stimulus.r_px();
  return std::exp(-0.5 * away * away / (stimulus.sigma_px() * stimulus.sigma_px()));
}

// The mean of four by four places in a pixel of the camera.
double seen(const View& view, const v1::Stimulus& stimulus, int x, int y) {
  if (std::min({x, y, kWidth - 1 - x, kHeight - 1 - y}) < view.border_px) return 0.0;
  double sum = 0.0;
  for (int i = 0; i < 16; ++i) {
    const double right = x + (i % 4 + 0.5) / 4.0 - kWidth / 2, down = y + (i / 4 + 0.5) / 4.0 - kHeight / 2;
    const double x_px = kWidth / 2 + view.scale * (right + view.turn_rad * down),
                 y_px = kHeight / 2 + view.scale * (down - view.turn_rad * right);
    sum += shown(stimulus, x_px, y_px) / 16.0;
  }
  return sum;
}

void add(Session& session, bool object, const v1::Stimulus& stimulus) {
  v1::Frame& frame = *session.manifest.add_frames();
  frame.set_file("frame");
  frame.set_object(object);
  *frame.mutable_stimulus() = stimulus;
  Picture picture;
  const View& view = session.view;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool covered =
          object && std::abs(x - view.object_x_px) < view.reach_x_px && std::abs(y - 24) < view.reach_y_px;
      picture.push_back(
          kWhite * (covered ? 0.5 * seen(view, stimulus, kWidth - 1 - x, y) : seen(view, stimulus, x, y)));
    }
  }
  session.frames.push_back(std::move(picture));
}

v1::Stimulus stimulus_of(const std::string& kind) {
  v1::Stimulus stimulus;
  stimulus.set_kind(kind);
  stimulus.set_panel("back");
  return stimulus;
}

void add_areas(Session& session, bool object) {
  for (const double level : {0.0, 0.5, 1.0}) {
    v1::Stimulus solid = stimulus_of("solid");
    for (int c = 0; c < 3; ++c) solid.add_colour(level);
    add(session, object, solid);
  }
  for (const char* const orient : {"vertical_bars", "horizontal_bars"}) {
    for (const double width_px : {32.0, 16.0, 8.0, 4.0, 2.0, 1.0}) {
      for (const bool inverse : {false, true}) {
        v1::Stimulus bars = stimulus_of("square");
        bars.set_orient(orient);
        bars.set_bar_width_px(width_px);
        bars.set_inverse(inverse);
        add(session, object, bars);
      }
    }
  }
}

// `moved_px`: by which the object lies further right in the last sweep; `turn_rad`: by which the picture is
// turned from its stripe at 10 px on.
Session clean_session(const View& view = {}, int moved_px = 0, double turn_rad = 0.0) {
  Session session{.manifest = {}, .frames = {}, .view = view};
  v1::Monitor& monitor = *session.manifest.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(kWidth);
  monitor.set_height_px(kHeight);
  session.manifest.mutable_camera()->set_width_px(kWidth);
  session.manifest.mutable_camera()->set_height_px(kHeight);
  session.manifest.mutable_camera()->set_response("linear");
  add_areas(session, true);
  add_areas(session, false);
  for (const double phi_deg : {0.0, 90.0}) {
    if (phi_deg == 90.0) session.view.object_x_px += moved_px;
    for (double r_px = -4.0; r_px <= (phi_deg == 0.0 ? kWidth : kHeight) + 4.0; r_px += 2.0) {
      v1::Stimulus stripe = stimulus_of("gauss_stripe");
      stripe.set_phi_deg(phi_deg);
      stripe.set_sigma_px(4.0);
      stripe.set_peak(1.0);
      stripe.set_r_px(r_px);
      if (phi_deg == 90.0 && r_px == 10.0) session.view.turn_rad = turn_rad;
      add(session, true, stripe);
    }
  }
  return session;
}

void scale(Session& session, const std::function<double(int frame)>& gain) {
  for (size_t f = 0; f < session.frames.size(); ++f) {
    for (double& light : session.frames[f]) light *= gain(static_cast<int>(f));
  }
}

// The faults of these frames, with noise and sixteen bits. The camera's black level keeps noise below black;
// it cuts off noise further below. `needed`: frames that the solver reads; empty: all.
FrameFaults faults_of(Session session, double noise_sd = kNoise, double black_level = 0.02,
                      std::vector<int> needed = {}) {
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0.0, 1.0);
  std::vector<std::vector<std::uint16_t>> codes;
  for (const Picture& picture : session.frames) {
    std::vector<std::uint16_t>& own = codes.emplace_back();
    for (const double light : picture) {
      for (int c = 0; c < 3; ++c)
        own.push_back(static_cast<std::uint16_t>(
            std::lround(65535.0 * std::clamp(light + noise_sd * noise(random) + black_level, 0.0, 1.0))));
    }
  }
  const auto read = [&](std::shared_ptr<const FrameCorrections> corrections) -> LightReader {
    return [&, corrections](int row, const std::vector<int>& frames) -> absl::StatusOr<FrameStack> {
      FrameStack stack{.width_px = kWidth, .first_row = row, .row_count = 1, .rows = {}, .owner = nullptr};
      stack.zero = 65535.0f * static_cast<float>(black_level);
      stack.rows.resize(codes.size());
      const auto owner = std::make_shared<std::vector<std::vector<std::uint16_t>>>();
      const size_t count = 3 * kWidth, first = static_cast<size_t>(row) * count;
      for (const int frame : frames) {
        const size_t f = frame;
        std::vector<std::uint16_t> own(codes[f].begin() + first, codes[f].begin() + first + count);
        if (corrections != nullptr) {
          const FrameCorrection& correction = corrections->of_frame[f];
          for (size_t at = 0; at < count; ++at) {
            float light = stack.radiance(own[at]);
            for (size_t k = 0; k < 3; ++k) {
              const int before = correction.before[k];
              if (before >= 0) light -= corrections->ghost[k] * stack.radiance(codes[before][first + at]);
            }
            light = (light - correction.offset[at % 3]) / correction.gain[at % 3];
            own[at] = static_cast<std::uint16_t>(std::clamp(light / stack.unit + stack.zero, 0.0f, 65500.0f));
          }
        }
        owner->push_back(std::move(own));
      }
      for (size_t i = 0; i < frames.size(); ++i) stack.rows[frames[i]] = (*owner)[i];
      stack.owner = owner;
      return stack;
    };
  };
  if (needed.empty()) {
    for (int f = 0; f < session.manifest.frames_size(); ++f) needed.push_back(f);
  }
  return find_faults(session.manifest, needed, read).value();
}

double gain_of(const FrameFaults& faults, int frame) {
  return static_cast<double>(faults.corrections->of_frame[frame].gain[1]);
}

TEST(FrameFaults, ACleanSessionHasNone) {
  for (const double noise_sd : {0.0, 0.003, 0.005, 0.02}) {  // the archive states none
    const FrameFaults faults = faults_of(clean_session(), noise_sd);
    EXPECT_EQ(faults.corrections, nullptr) << noise_sd;
    EXPECT_TRUE(faults.bad_pixels.empty()) << noise_sd;
    EXPECT_EQ(faults.warnings, std::vector<std::string>()) << noise_sd;
  }
}

// Without noise all of a white that is the last code is saturated, and nothing is lost.
TEST(FrameFaults, WhiteAtFullScaleIsNotOverExposed) {
  Session session = clean_session();
  scale(session, [](int) { return 1.0 / kWhite; });
  for (const double noise_sd : {0.0, 0.003}) {
    const FrameFaults faults = faults_of(session, noise_sd, 0.0);
    EXPECT_EQ(faults.corrections, nullptr) << noise_sd;
    EXPECT_EQ(faults.warnings, std::vector<std::string>()) << noise_sd;
  }
}

// Noise that the camera cuts off at black makes what is dark brighter in the mean, as flare does.
TEST(FrameFaults, NoiseThatIsCutOffIsNoFault) {
  const View large{.border_px = 6, .reach_x_px = 20, .reach_y_px = 14};
  for (const View& view : {View(), large}) {
    for (const double noise_sd : {0.005, 0.02}) {
      const FrameFaults faults = faults_of(clean_session(view), noise_sd, 0.0);
      EXPECT_EQ(faults.corrections, nullptr) << noise_sd;
      EXPECT_EQ(faults.warnings, std::vector<std::string>()) << noise_sd;
    }
  }
}

// Where the model of what pixels see lacks something, gains follow the pictures, not time.
TEST(FrameFaults, FlatPixelsThatBeatWithTheCamerasAreNoFault) {
  for (const double noise_sd : {0.0, 0.003}) {
    const FrameFaults faults = faults_of(clean_session(kFar), noise_sd);
    EXPECT_EQ(faults.corrections, nullptr) << noise_sd;
    EXPECT_EQ(faults.warnings, std::vector<std::string>()) << noise_sd;
  }
}

// Solvers that choose images (option images) do not read all bars.
TEST(FrameFaults, FramesThatTheSolverDoesNotReadMayTellOfTheStage) {
  const Session session = clean_session();
  std::vector<int> some;
  for (int f = 0; f < session.manifest.frames_size(); ++f) {
    const v1::Frame& frame = session.manifest.frames(f);
    if (frame.object() || frame.stimulus().bar_width_px() > 4.0) some.push_back(f);
  }
  EXPECT_EQ(faults_of(session, kNoise, 0.02, some).corrections, nullptr);
}

// The scale comes from the first quarter of the frames: bars, whose edges leave their gains uncertain by 0.5
// %.
TEST(FrameFaults, LightThatFallsIsBroughtBackToTheFirst) {
  Session session = clean_session();
  const double count = static_cast<double>(session.frames.size());
  const auto gain = [&](int frame) { return 1.0 - 0.1 * frame / count; };
  scale(session, gain);
  const FrameFaults faults = faults_of(session);
  ASSERT_NE(faults.corrections, nullptr);
  for (const int frame : {10, 40, 80, 100}) EXPECT_NEAR(gain_of(faults, frame), gain(frame), 0.01) << frame;
  ASSERT_EQ(faults.warnings.size(), 1u);
  EXPECT_NE(faults.warnings[0].find("falls by"), std::string::npos) << faults.warnings[0];
}

TEST(FrameFaults, FlickerIsBroughtToTheUsual) {
  Session session = clean_session();
  std::mt19937 random(3);
  std::normal_distribution<double> noise(1.0, 0.005);
  std::vector<double> gains;
  for (size_t f = 0; f < session.frames.size(); ++f) gains.push_back(noise(random));
  scale(session, [&](int frame) { return gains[frame]; });
  const FrameFaults faults = faults_of(session);
  ASSERT_NE(faults.corrections, nullptr);
  // To an error of the usual one of a hundred frames, and of a frame's own gain.
  for (const int frame : {75, 80, 85, 90}) EXPECT_NEAR(gain_of(faults, frame), gains[frame], 0.003);
  ASSERT_EQ(faults.warnings.size(), 1u);
  EXPECT_NE(faults.warnings[0].find("flickers"), std::string::npos) << faults.warnings[0];
}

TEST(FrameFaults, PicturesWithTheObjectAreBroughtToThoseWithout) {
  Session session = clean_session();
  scale(session, [&](int frame) { return session.manifest.frames(frame).object() ? 1.1 : 1.0; });
  const FrameFaults faults = faults_of(session);
  ASSERT_NE(faults.corrections, nullptr);
  EXPECT_NEAR(gain_of(faults, 10), 1.1, 0.005);
  EXPECT_NEAR(gain_of(faults, 35), 1.0, 0.005);
  EXPECT_NEAR(gain_of(faults, 80), 1.1, 0.005);
}

TEST(FrameFaults, GhostsAreFound) {
  Session session = clean_session();
  const double share = 0.08;
  const std::vector<Picture> clean = session.frames;
  for (size_t f = 1; f < clean.size(); ++f) {
    for (size_t at = 0; at < clean[f].size(); ++at)
      session.frames[f][at] = (1.0 - share) * clean[f][at] + share * clean[f - 1][at];
  }
  const FrameFaults faults = faults_of(session);
  ASSERT_NE(faults.corrections, nullptr);
  // y_f = (1 - s) P_f + s P_(f-1) is P_f (1 - s) = y_f - a y_(f-1) + a^2 y_(f-2) - ..., a = s / (1 - s).
  const double a = share / (1.0 - share);
  EXPECT_NEAR(faults.corrections->ghost[0], a, 0.004);
  EXPECT_NEAR(faults.corrections->ghost[1], -a * a, 0.004);
}

TEST(FrameFaults, FlareIsFound) {
  Session session = clean_session();
  const double share = 0.03;
  for (Picture& picture : session.frames) {
    double mean = 0.0;
    for (const double light : picture) mean += light / static_cast<double>(picture.size());
    for (double& light : picture) light = (1.0 - share) * light + share * mean;
  }
  const FrameFaults faults = faults_of(session);
  ASSERT_NE(faults.corrections, nullptr);
  EXPECT_NEAR(gain_of(faults, 80), 1.0 - share, 0.002);
  ASSERT_EQ(faults.warnings.size(), 1u);
  EXPECT_NE(faults.warnings[0].find("flare"), std::string::npos) << faults.warnings[0];
}

TEST(FrameFaults, ALampIsSubtracted) {
  Session session = clean_session();
  for (size_t f = 70; f < 80; ++f) {
    for (double& light : session.frames[f]) light += 0.05;
  }
  const FrameFaults faults = faults_of(session);
  ASSERT_NE(faults.corrections, nullptr);
  EXPECT_NEAR(faults.corrections->of_frame[75].offset[1], 0.05, 0.001);
  EXPECT_EQ(faults.corrections->of_frame[90].offset[1], 0.0f);
  ASSERT_EQ(faults.warnings.size(), 1u);
  EXPECT_EQ(faults.warnings[0].find("frames 70 to 79 are up to 0.05"), 0u) << faults.warnings[0];
}

TEST(FrameFaults, APictureThatTurnedIsSaid) {
  for (const double turn_rad : {0.01, -0.02}) {  // 0.4 and 0.8 px at the corners
    const FrameFaults faults = faults_of(clean_session({}, 0, turn_rad));
    ASSERT_EQ(faults.warnings.size(), 1u);
    EXPECT_EQ(faults.warnings[0].find("from frame 98 on everything is turned by "), 0u) << faults.warnings[0];
    EXPECT_NE(faults.warnings[0].find(turn_rad > 0.0 ? "° clockwise" : "° counter-clockwise"),
              std::string::npos)
        << faults.warnings[0];
    EXPECT_GT(faults.disturbance.moved_px, 0.1);  // it is not moved back here
  }
}

// A rolling shutter exposes its rows one after the other: the last while the next picture is there, or the
// first while the last one still is.
TEST(FrameFaults, RowsThatShowTwoPicturesAreSaid) {
  constexpr double kShare = 0.12;
  for (const int way : {1, -1}) {
    Session session = clean_session();
    const std::vector<Picture> clean = session.frames;
    for (size_t f = 1; f + 1 < clean.size(); ++f) {
      const Picture& other = clean[way > 0 ? f + 1 : f - 1];
      for (size_t at = 0; at < clean[f].size(); ++at) {
        const double row = (static_cast<double>(at / kWidth) + 0.5) / kHeight,
                     late = way > 0 ? row : 1.0 - row;
        const double share = kShare * std::max(0.0, 2.0 * late - 1.0);
        session.frames[f][at] = (1.0 - share) * clean[f][at] + share * other[at];
      }
    }
    const FrameFaults faults = faults_of(session);
    // Of the last sixth 10 %, in the mean.
    const std::string said =
        way > 0 ? "the last 24 of 48 rows of frames show the next picture, too, 10 % of it"
                : "the first 24 of 48 rows of frames show the previous picture, too, 10 % of it";
    EXPECT_TRUE(std::ranges::any_of(faults.warnings, [&](const std::string& warning) {
      return warning.starts_with(said);
    })) << (faults.warnings.empty() ? "nothing" : faults.warnings[0]);
  }
}

TEST(FrameFaults, AnObjectThatMovedIsSaid) {
  const View large{.reach_x_px = 29, .reach_y_px = 14};
  for (const View& view : {View(), large}) {
    for (const double noise_sd : {0.0, 0.01}) {
      const FrameFaults faults = faults_of(clean_session(view, 1), noise_sd);
      ASSERT_EQ(faults.warnings.size(), 1u) << noise_sd;
      EXPECT_EQ(faults.warnings[0].find("the object or the camera moved before frame 119"), 0u)
          << faults.warnings[0];
      EXPECT_TRUE(faults.disturbance.object_only);
    }
  }
}

TEST(FrameFaults, WhereTheObjectFillsThePictureBarsAndTheirInverseTell) {
  Session session = clean_session({.reach_x_px = kWidth, .reach_y_px = kHeight});
  EXPECT_EQ(faults_of(session).warnings, std::vector<std::string>());
  scale(session, [](int frame) { return frame >= 20 ? 1.1 : 1.0; });  // black, gray and white come before
  const FrameFaults faults = faults_of(session);
  EXPECT_EQ(faults.compared, 0u);
  ASSERT_EQ(faults.warnings.size(), 1u);
  EXPECT_EQ(faults.warnings[0].find("frames 19 to 26: bars plus their inverse are up to 1.100"), 0u)
      << faults.warnings[0];
}

// What the rig does to a frame it does everywhere.
TEST(FrameFaults, LightOnOneSideOfTheObjectIsNoFault) {
  Session session = clean_session();
  for (size_t f = 70; f < 80; ++f) {
    for (size_t at = 0; at < session.frames[f].size(); ++at)
      session.frames[f][at] += at % kWidth > 44 ? 0.05 : 0.0;
  }
  const FrameFaults faults = faults_of(session);
  EXPECT_EQ(faults.corrections, nullptr);
  EXPECT_EQ(faults.warnings, std::vector<std::string>());
}

TEST(FrameFaults, GraysTellWhatOverExposedWhiteShouldBe) {
  Session session = clean_session();
  scale(session, [](int) { return 1.3; });
  const FrameFaults faults = faults_of(session);
  ASSERT_NE(faults.corrections, nullptr);
  const auto& of_frame = faults.corrections->of_frame;
  for (const int first : {0, 27}) {  // black, gray, white with and without the object
    const GrayFrames& grays = of_frame[static_cast<size_t>(first) + 2].grays;
    EXPECT_EQ(grays.black, first);
    EXPECT_EQ(grays.gray, first + 1);
    EXPECT_EQ(grays.level, 0.5f);
    EXPECT_EQ(of_frame[static_cast<size_t>(first) + 1].grays.gray, -1);
  }
  EXPECT_TRUE(std::ranges::any_of(faults.warnings, [](const std::string& warning) {
    return warning.find("white is over-exposed") != std::string::npos;
  }));
}

// Its cells are no bad pixels.
TEST(FrameFaults, AnIdPatchIsNoFault) {
  Session session = clean_session();
  for (const bool object : {true, false}) {
    for (int id = 0; id < 3; ++id) {
      v1::Stimulus patch = stimulus_of("patch");
      patch.set_patch_id(static_cast<std::uint32_t>(id));
      add(session, object, patch);
      session.frames.back().assign(session.frames.back().size(), 0.0);
    }
  }
  const auto cell = [](size_t at) {
    return at / kWidth > 40 && at / kWidth < 45 && at % kWidth > 20 && at % kWidth < 40;
  };
  for (size_t f = 0; f < session.frames.size(); ++f) {
    for (size_t at = 0; at < session.frames[f].size(); ++at) {
      if (cell(at)) session.frames[f][at] = (at / 3 + f) % 3 == 0 ? kWhite : 0.0;
    }
  }
  EXPECT_TRUE(faults_of(session).bad_pixels.empty());
}

TEST(FrameFaults, BadPixelsAreFound) {
  Session session = clean_session();
  const std::vector<int> bad{10 * kWidth + 5, 20 * kWidth + 30, 40 * kWidth + 50};
  for (Picture& picture : session.frames) {
    picture[bad[0]] = 0.0;
    picture[bad[1]] = 0.4;
    picture[bad[2]] *= 0.5;
  }
  EXPECT_EQ(faults_of(session).bad_pixels, bad);
}

}  // namespace
}  // namespace glasswing
