// The response from photographs of a room (JPEG, seven exposures), compared with OpenCV's.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/photo.hpp>

#include "core/radiometry/camera_response.h"

namespace glasswing {
namespace {

// From the pictures' EXIF.
const std::vector<double> kDeclared_s = {2.0, 1.0 / 2, 1.0 / 8, 1.0 / 30, 1.0 / 125, 1.0 / 1000, 1.0 / 4000};

using Inverse = std::function<double(int code, int channel)>;

// Median of |predicted / seen - 1| over all pixels whose codes lie between 5 % and 95 % in both of two
// neighbouring pictures.
double prediction_error(const std::vector<cv::Mat>& pictures, const Inverse& exposure_of,
                        const std::vector<double>& times) {
  std::vector<double> errors;
  for (size_t j = 0; j + 1 < pictures.size(); ++j) {
    for (int y = 0; y < pictures[j].rows; ++y) {
      for (int x = 0; x < pictures[j].cols; ++x) {
        for (int c = 0; c < 3; ++c) {
          const int seen = pictures[j].at<cv::Vec3b>(y, x)[2 - c];
          const int darker = pictures[j + 1].at<cv::Vec3b>(y, x)[2 - c];
          if (std::min(seen, darker) < 13 || std::max(seen, darker) > 242) continue;
          errors.push_back(
              std::abs(exposure_of(darker, c) * times[j] / times[j + 1] / exposure_of(seen, c) - 1.0));
        }
      }
    }
  }
  const auto middle = errors.begin() + errors.size() / 2;
  std::nth_element(errors.begin(), middle, errors.end());
  return *middle;
}

TEST(Room, PredictsAnExposureFromItsNeighbourBetterThanOpenCv) {
  const char* data = std::getenv("GLASSWING_DATA");
  const std::filesystem::path directory = std::filesystem::path(data ? data : "") / "real/hdr_room_gpl3";
  if (!std::filesystem::exists(directory))
    GTEST_SKIP() << "no data at " << directory << "; set GLASSWING_DATA";
  std::vector<Exposure> exposures;
  std::vector<cv::Mat> pictures;
  for (size_t j = 0; j < kDeclared_s.size(); ++j) {
    const cv::Mat picture =
        cv::imread((directory / ("stack_room_exp_" + std::to_string(j) + ".jpg")).string());
    ASSERT_FALSE(picture.empty());
    Image16 codes(picture.cols, picture.rows);
    for (int y = 0; y < picture.rows; ++y) {
      for (int x = 0; x < picture.cols; ++x) {
        for (int c = 0; c < 3; ++c) {
          codes.at(x, y, c) = static_cast<std::uint16_t>(picture.at<cv::Vec3b>(y, x)[2 - c] * 257);
        }
      }
    }
    pictures.push_back(picture);
    exposures.push_back({kDeclared_s[j], std::move(codes)});
  }
  const CameraResponse response = CameraResponse::fit(exposures).value();
  EXPECT_FALSE(response.is_linear());
  for (int c = 0; c < 3; ++c) {
    for (int code = 1; code < 256; ++code) {
      EXPECT_GT(response.exposure_of(code / 255.0, c), response.exposure_of((code - 1) / 255.0, c));
    }
  }

  cv::Mat theirs;
  cv::createCalibrateDebevec()->process(pictures, theirs,
                                        std::vector<float>(kDeclared_s.begin(), kDeclared_s.end()));
  const auto our_curve = [&](int code, int c) { return response.exposure_of(code / 255.0, c); };
  const auto their_curve = [&](int code, int c) {
    return static_cast<double>(theirs.at<cv::Vec3f>(code)[2 - c]);
  };
  const double ours = prediction_error(pictures, our_curve, response.exposures_s());
  const double opencv = prediction_error(pictures, their_curve, kDeclared_s);
  std::printf(
      "median relative error %.2f %%; declared times %.2f %%; OpenCV %.2f %%, with our times %.2f %%\n",
      100.0 * ours, 100.0 * prediction_error(pictures, our_curve, kDeclared_s), 100.0 * opencv,
      100.0 * prediction_error(pictures, their_curve, response.exposures_s()));
  EXPECT_LT(ours, 0.05);
  EXPECT_LT(ours, 0.9 * opencv);
}

}  // namespace
}  // namespace glasswing
