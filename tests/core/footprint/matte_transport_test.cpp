// The matrix of a matte against the exact compositor, and against differences of its own footprints.
#include "core/footprint/matte_transport.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/composite/compositor.h"
#include "core/footprint/footprint.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kWidth = 13, kHeight = 9;

std::mt19937 random_numbers(3);
float part() {
  return static_cast<float>(random_numbers() % 4096) / 4096.0f;
}

// Two monitors of different sizes; footprints wider than a monitor, narrower than a pixel, oblique ones, and
// some beyond an edge.
Matte some_matte(std::string_view footprint = "") {
  random_numbers.seed(3);
  Matte matte(0, 0, kWidth, kHeight, 2);
  matte.metadata.set_footprint(std::string(footprint));
  for (const auto& [name, width, height] : {std::tuple{"back", 31, 23}, std::tuple{"left", 17, 29}}) {
    v1::Monitor& monitor = *matte.metadata.add_monitors();
    monitor.set_name(name);
    monitor.set_width_px(width);
    monitor.set_height_px(height);
  }
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      matte.coverage(x, y) = 1.0f;
      for (int c = 0; c < kChannels; ++c) {
        matte.foreground(x, y)[c] = 0.2f * part();
        int texture = 0;
        for (Mode& mode : matte.modes(x, y, c)) {
          const float wide = std::pow(10.0f, 4.0f * part() - 2.5f), narrow = wide * part() * part();
          const bool upright = footprint == kBoxFootprint;
          mode = {.weight = part(),
                  .x_px = 36.0f * part() - 3.0f,
                  .y_px = 30.0f * part() - 3.0f,
                  .xx_px2 = wide,
                  .xy_px2 = upright ? 0.0f : 0.9f * std::sqrt(wide * narrow),
                  .yy_px2 = narrow,
                  .texture = texture++};
        }
      }
    }
  }
  return matte;
}

std::vector<RadianceImage> pictures_for(const Matte& matte) {
  std::vector<RadianceImage> pictures;
  for (const v1::Monitor& monitor : matte.metadata.monitors()) {
    for (float& light : pictures.emplace_back(monitor.width_px(), monitor.height_px()).samples)
      light = part();
  }
  return pictures;
}

// Largest difference of matrix x pictures + F from the exact composite.
double largest_difference(const Matte& matte) {
  const std::vector<RadianceImage> pictures = pictures_for(matte);
  const absl::StatusOr<RadianceImage> exact = composite(matte, pictures, 1);
  const absl::StatusOr<MatteTransport> transport = MatteTransport::create(matte);
  double largest = 0.0;
  for (int c = 0; c < kChannels; ++c) {
    std::vector<double> light;
    for (const RadianceImage& picture : pictures) {
      for (size_t i = c; i < picture.samples.size(); i += 3) light.push_back(picture.samples[i]);
    }
    const absl::StatusOr<TransportMatrix> matrix = transport->matrix(c, false, 2);
    EXPECT_OK(matrix);
    EXPECT_EQ(matrix->row_count, kWidth * kHeight);
    EXPECT_EQ(matrix->column_count, 31 * 23 + 17 * 29);
    for (int i = 0; i < matrix->row_count; ++i) {
      double sum = matte.foreground_of_gaussians(i % kWidth, i / kWidth, c);
      for (std::int64_t k = matrix->starts[i]; k < matrix->starts[i + 1]; ++k) {
        EXPECT_TRUE(k == matrix->starts[i] || matrix->columns[k - 1] < matrix->columns[k]);
        sum += matrix->values[k] * light[matrix->columns[k]];
      }
      largest = std::max(largest, std::abs(sum - exact->at(i % kWidth, i / kWidth, c)));
    }
  }
  return largest;
}

// Of light up to 1 and rows up to 2: what is left out, and the rounding of floats.
constexpr double kTolerance = 2.0 * MatteTransport::kLeftOut + 1e-5;

TEST(MatteTransport, TimesAPictureIsTheExactComposite) {
  EXPECT_LT(largest_difference(some_matte()), kTolerance);
}

TEST(MatteTransport, HoldsBoxes) {
  EXPECT_LT(largest_difference(some_matte(kBoxFootprint)), kTolerance);
}

TEST(MatteTransport, HoldsPyramids) {
  Matte matte = some_matte(kPyramidFootprint);
  matte.add_pyramid(4, 3, 1,
                    {.texture = 0,
                     .foreground = 0.1f,
                     .noise_sd = 0.0f,
                     .prior_sd = 0.0f,
                     .coefficients = {{.level = 0, .column = 5, .row = 4, .weight = 0.3f},
                                      {.level = 2, .column = 1, .row = 1, .weight = 0.6f}}});
  EXPECT_LT(largest_difference(matte), kTolerance);
}

// Its sum with a picture is the exact composite, less F, of all kinds of footprints.
TEST(FootprintPicture, TimesAPictureIsWhatThePixelSees) {
  for (const std::string_view kind : {std::string_view(), kBoxFootprint, kPyramidFootprint}) {
    Matte matte = some_matte(kind);
    if (kind == kPyramidFootprint) {
      matte.add_pyramid(4, 3, 1,
                        {.texture = 0,
                         .foreground = 0.1f,
                         .coefficients = {{.level = 0, .column = 5, .row = 4, .weight = 0.3f},
                                          {.level = kPyramidLevels, .weight = 0.1f},
                                          {.level = 2, .column = 1, .row = 1, .weight = 0.6f}}});
    }
    const std::vector<RadianceImage> pictures = pictures_for(matte);
    const RadianceImage seen = composite(matte, pictures, 1).value();
    for (const auto& [x, y] : {std::pair(4, 3), std::pair(0, 0), std::pair(12, 8)}) {
      for (int c = 0; c < kChannels; ++c) {
        double light = matte.foreground_of_gaussians(x, y, c);
        for (int t = 0; t < 2; ++t) {
          const RadianceImage shares = footprint_picture(matte, x, y, t);
          for (size_t i = c; i < shares.samples.size(); i += kChannels)
            light += static_cast<double>(shares.samples[i] * pictures[t].samples[i]);
        }
        EXPECT_NEAR(light, seen.at(x, y, c), kTolerance) << kind << " " << x << ", " << y;
      }
    }
  }
}

TEST(MatteTransport, TransposedIsThePictureFromTheMonitor) {
  Matte matte = some_matte();
  for (int t = 0; t < 2; ++t) {  // channels that leak into each other
    v1::Crosstalk& seen = *matte.metadata.add_crosstalk();
    for (const double share : {0.8, 0.15, 0.05, 0.1, 0.85, 0.05, 0.0, 0.2, 0.8}) seen.add_share(share);
  }
  RadianceImage shone(kWidth, kHeight);
  for (float& light : shone.samples) light = part();
  std::vector<RadianceImage> pictures = pictures_for(matte);
  Matte unlit = matte;
  for (int i = 0; i < kWidth * kHeight; ++i) unlit.foreground(i % kWidth, i / kWidth) = {};
  // <A picture, shone> = <picture, A' shone>, of each monitor alone.
  for (int t = 0; t < 2; ++t) {
    std::vector<RadianceImage> one(2);
    one[t] = pictures[t];
    const absl::StatusOr<RadianceImage> seen = composite(unlit, one, 1);
    const absl::StatusOr<RadianceImage> back = composite_from_monitor(matte, t, shone, 2);
    ASSERT_OK(back);
    double forth_sum = 0.0, back_sum = 0.0;
    for (size_t i = 0; i < seen->samples.size(); ++i) forth_sum += seen->samples[i] * shone.samples[i];
    for (size_t i = 0; i < back->samples.size(); ++i) back_sum += back->samples[i] * one[t].samples[i];
    const double scale = static_cast<double>(one[t].width_px * one[t].height_px) / (kWidth * kHeight);
    EXPECT_NEAR(back_sum, scale * forth_sum, 1e-5 * scale * forth_sum);
  }
}

TEST(MatteTransport, RefusesAPictureOfAnotherSize) {
  const auto refused = composite_from_monitor(some_matte(), 0, RadianceImage(kWidth + 1, kHeight));
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(refused.status().message(), "the picture that shines is 14x9; it must be 13x9");
}

// The light of one pixel of a monitor, from a channel's modes; numbers p as in MatteCovariance::root().
double entry(const std::vector<Mode>& modes, int x, int y) {
  RadianceImage lit(31, 23);
  lit.at(x, y, 0) = 1.0f;
  double light = 0.0;
  for (const Mode& mode : modes) light += mode.weight * integrate_footprint(mode, lit, 0);
  return light;
}

TEST(MatteTransport, ErrorsAreThoseOfTheModesByFiniteDifferences) {
  Matte matte(0, 0, 1, 1, 2);
  v1::Monitor& monitor = *matte.metadata.add_monitors();
  monitor.set_width_px(31);
  monitor.set_height_px(23);
  for (const double phi : {0.0, 45.0, 90.0, 135.0}) {
    v1::StripeSweep& sweep = *matte.metadata.add_sweeps();
    sweep.set_phi_deg(phi);
    sweep.set_sigma_px(1.5);
    sweep.set_first_r_px(-25.0);
    sweep.set_last_r_px(48.5);
    sweep.set_count(50);
  }
  matte.coverage(0, 0) = 1.0f;
  std::vector<Mode> modes{
      {.weight = 0.6f, .x_px = 12.3f, .y_px = 9.6f, .xx_px2 = 4.0f, .xy_px2 = 1.0f, .yy_px2 = 2.0f},
      {.weight = 0.3f, .x_px = 17.1f, .y_px = 12.2f, .xx_px2 = 1.5f, .xy_px2 = -0.4f, .yy_px2 = 3.0f}};
  modes[0].weight_sd = 0.004f;
  modes[0].centre_sd_px = 0.01f;
  std::ranges::copy(modes, matte.modes(0, 0, 1).begin());
  const absl::StatusOr<MatteTransport> transport = MatteTransport::create(matte);
  ASSERT_TRUE(transport.ok() && transport->has_covariance()) << transport.status();
  const absl::StatusOr<TransportMatrix> matrix = transport->matrix(1, true, 1);
  ASSERT_TRUE(matrix.ok() && matrix->errors.size() == matrix->values.size()) << matrix.status();

  const Eigen::MatrixXd root = MatteCovariance::create(matte.metadata)->root(modes);
  ASSERT_EQ(root.rows(), 13);
  constexpr std::array kNumbers{&Mode::weight, &Mode::x_px,   &Mode::y_px,
                                &Mode::xx_px2, &Mode::xy_px2, &Mode::yy_px2};
  int compared = 0;
  for (size_t k = 0; k < matrix->columns.size(); k += 7) {
    const int x = matrix->columns[k] % 31, y = matrix->columns[k] / 31;
    Eigen::VectorXd slopes = Eigen::VectorXd::Zero(root.rows());
    for (int m = 0; m < 2; ++m) {
      for (int n = 0; n < 6; ++n) {
        constexpr float kStep = 1.0f / 256.0f;
        std::vector<Mode> more = modes, less = modes;
        more[m].*kNumbers[n] += kStep;
        less[m].*kNumbers[n] -= kStep;
        slopes[1 + 6 * m + n] = (entry(more, x, y) - entry(less, x, y)) / (2.0 * kStep);
      }
    }
    const double expected = (root.transpose() * slopes).norm();
    if (expected < 1e-6) continue;
    // Differences of the quadrature of entries, and normal_rectangle.h's accuracy.
    EXPECT_NEAR(matrix->errors[k], expected, 0.02 * expected + 1e-6) << x << ", " << y;
    ++compared;
  }
  EXPECT_GT(compared, 20);
}

// Of F and the weights of a pyramid's places, by the exact compositor's light of single pixels.
TEST(MatteTransport, ErrorsOfPyramidsAreThoseOfTheirPlaces) {
  Matte matte(0, 0, 1, 1, 1);
  v1::Monitor& monitor = *matte.metadata.add_monitors();
  monitor.set_width_px(31);
  monitor.set_height_px(23);
  matte.metadata.set_footprint(std::string(kPyramidFootprint));
  for (const double phi : {0.0, 45.0, 90.0, 135.0}) {
    v1::StripeSweep& sweep = *matte.metadata.add_sweeps();
    sweep.set_phi_deg(phi);
    sweep.set_sigma_px(1.5);
    sweep.set_first_r_px(-25.0);
    sweep.set_last_r_px(48.5);
    sweep.set_count(50);
  }
  matte.coverage(0, 0) = 1.0f;
  matte.modes(0, 0, 1)[0] = {
      .weight = 0.5f, .x_px = 13.0f, .y_px = 10.0f, .xx_px2 = 9.0f, .xy_px2 = 0.0f, .yy_px2 = 9.0f};
  const PyramidFootprint pyramid{.texture = 0,
                                 .foreground = 0.0f,
                                 .noise_sd = 0.005f,
                                 .prior_sd = 0.02f,
                                 .coefficients = {{.level = 0, .column = 6, .row = 5, .weight = 0.1f},
                                                  {.level = 1, .column = 3, .row = 2, .weight = 0.2f},
                                                  {.level = kPyramidLevels, .weight = 0.2f}}};
  matte.add_pyramid(0, 0, 1, pyramid);
  const absl::StatusOr<MatteTransport> transport = MatteTransport::create(matte);
  ASSERT_OK(transport);
  const absl::StatusOr<TransportMatrix> matrix = transport->matrix(1, true, 1);
  ASSERT_OK(matrix);
  const auto [places, root] =
      MatteCovariance::create(matte.metadata)->errors_of(pyramid, matte.modes(0, 0, 1));
  ASSERT_EQ(root.rows(), std::ssize(places) + 1);
  int compared = 0;
  for (size_t k = 0; k < matrix->columns.size(); k += 5) {
    RadianceImage lit(31, 23);
    lit.at(matrix->columns[k] % 31, matrix->columns[k] / 31, 0) = 1.0f;
    Eigen::VectorXd light = Eigen::VectorXd::Zero(root.rows());
    for (size_t p = 0; p < places.size(); ++p)
      light[static_cast<Eigen::Index>(p) + 1] = integrate_footprint(mode_of(places[p], 0.0, 0.0, 0), lit, 0);
    const double expected = (root.transpose() * light).norm();
    // Entries hold floats.
    EXPECT_NEAR(matrix->errors[k], expected, 1e-5 * expected + 1e-9);
    compared += expected > 1e-5;
  }
  EXPECT_GT(compared, 10);
}

TEST(MatteTransport, ErrorsAreThoseOfWeightAndCentreIfNothingElseIsKnown) {
  Matte matte = some_matte();
  Mode& mode = matte.modes(2, 3, 0)[0];
  mode = {.weight = 0.5f, .x_px = 15.2f, .y_px = 11.4f, .xx_px2 = 3.0f, .xy_px2 = 0.0f, .yy_px2 = 5.0f};
  mode.weight_sd = 0.01f;
  mode.centre_sd_px = 0.02f;
  matte.modes(2, 3, 0)[1].weight = 0.0f;
  const absl::StatusOr<MatteTransport> transport = MatteTransport::create(matte);
  ASSERT_OK(transport);
  EXPECT_FALSE(transport->has_covariance());
  const absl::StatusOr<TransportMatrix> matrix = transport->matrix(0, true, 1);
  // A pixel's share of a Gaussian with independent axes, in closed form.
  const auto along = [](double at, double centre, double variance) {
    const double scale = std::sqrt(2.0 * variance);
    return std::array{0.5 * (std::erf((at + 1.0 - centre) / scale) - std::erf((at - centre) / scale)),
                      (std::exp(-std::pow((at - centre) / scale, 2)) -
                       std::exp(-std::pow((at + 1.0 - centre) / scale, 2))) /
                          std::sqrt(2.0 * M_PI * variance)};
  };
  const std::int64_t row = 3 * kWidth + 2;
  ASSERT_GT(matrix->starts[row + 1] - matrix->starts[row], 50);
  for (std::int64_t k = matrix->starts[row]; k < matrix->starts[row + 1]; ++k) {
    const auto x = along(matrix->columns[k] % 31, 15.2, 3.0), y = along(matrix->columns[k] / 31, 11.4, 5.0);
    const double expected =
        std::hypot(0.01 * x[0] * y[0], 0.5 * 0.02 * x[1] * y[0], 0.5 * 0.02 * x[0] * y[1]);
    EXPECT_NEAR(matrix->errors[k], expected, 1e-5 * expected + 1e-8);
  }
  // Others have no errors.
  EXPECT_EQ(matrix->errors[matrix->starts[row + 1]], 0.0f);
}

TEST(MatteTransport, BoxesHaveNoErrors) {
  const Matte matte = some_matte(kBoxFootprint);
  const absl::StatusOr<MatteTransport> transport = MatteTransport::create(matte);
  ASSERT_OK(transport);
  EXPECT_TRUE(transport->matrix(0, true, 1)->errors.empty());
}

}  // namespace
}  // namespace glasswing
