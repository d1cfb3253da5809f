// A real display measured by a real camera: OpenCSP's 27 pairs of display and camera codes.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "core/radiometry/tone_curve.h"

namespace glasswing {
namespace {

// The goal is 1 % of full scale. Leave-one-out predictions of similar accuracy show that the curve does not
// merely interpolate the points.
TEST(ToneFit, OpenCspsDisplay) {
  const auto path = std::filesystem::path(std::getenv("GLASSWING_DATA")) /
                    "real/opencsp_sofast/png/display_to_camera_response.csv";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no data at " << path << "; set GLASSWING_DATA";
  std::ifstream file(path);
  std::string header;
  std::getline(file, header);
  std::vector<TonePoint> points;
  double code = 0.0, light = 0.0;
  char comma = 0;
  while (file >> code >> comma >> light) points.push_back({.code = static_cast<int>(code), .light = light});
  ASSERT_EQ(points.size(), 27u);

  const ToneFit fit = fit_tone_curve(points, 8, "gray").value();
  double square = 0.0, worst = 0.0;
  for (size_t left = 1; left + 1 < points.size(); ++left) {
    std::vector<TonePoint> others = points;
    others.erase(others.begin() + left);
    const ToneFit without = fit_tone_curve(others, 8, "gray").value();
    const double error = (without.curve.radiance(points[left].code) * without.full_scale -
                          (points[left].light - points[0].light)) /
                         without.full_scale;
    square += error * error;
    worst = std::max(worst, std::abs(error));
  }
  const double predicted = std::sqrt(square / 25.0);
  double largest = 0.0;
  for (const double error : fit.error) largest = std::max(largest, error);
  std::printf(
      "rms residual %.3f %% of full scale, gamma %.3f, standard error at most %.3f %%; each pair from "
      "the others: rms %.3f %%, worst %.3f %%\n",
      100.0 * fit.residual_rms, fit.gamma, 100.0 * largest, 100.0 * predicted, 100.0 * worst);
  EXPECT_LE(fit.residual_rms, 0.01);
  EXPECT_LE(predicted, 0.01);
}

}  // namespace
}  // namespace glasswing
