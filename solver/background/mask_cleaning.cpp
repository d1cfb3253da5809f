#include "solver/background/mask_cleaning.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "solver/background/mask_regions.h"

namespace glasswing {

MaskCleaning usual_cleaning(int width_px, int height_px, std::optional<int> dilation_px,
                            std::optional<int> erosion_px, std::optional<int> min_px) {
  constexpr double kUsualReach = 0.003;
  const int usual_px =
      std::max(1, static_cast<int>(std::lround(kUsualReach * std::hypot(width_px, height_px))));
  MaskCleaning cleaning{.dilation_px = dilation_px.value_or(usual_px)};
  cleaning.erosion_px = erosion_px.value_or(cleaning.dilation_px);
  cleaning.min_px = min_px.value_or((2 * cleaning.dilation_px + 1) * (2 * cleaning.dilation_px + 1));
  return cleaning;
}

void clean_mask(std::span<std::uint8_t> samples, int width_px, int height_px, const MaskCleaning& cleaning) {
  // A margin of background connects everything outside the object.
  const int margin = cleaning.dilation_px + 1;
  cv::Mat padded = cv::Mat::zeros(height_px + 2 * margin, width_px + 2 * margin, CV_8U);
  const cv::Mat mask(height_px, width_px, CV_8U, samples.data());
  const cv::Rect picture(margin, margin, width_px, height_px);
  mask.copyTo(padded(picture));
  const auto square = [](int reach) {
    return cv::getStructuringElement(cv::MORPH_RECT, {2 * reach + 1, 2 * reach + 1});
  };
  if (cleaning.dilation_px > 0) cv::dilate(padded, padded, square(cleaning.dilation_px));
  const BinaryView view{.samples = {padded.data, padded.total()}, .width_px = padded.cols};
  if (cleaning.fill_holes) fill_holes(view);
  if (cleaning.erosion_px > 0) cv::erode(padded, padded, square(cleaning.erosion_px));
  if (cleaning.min_px > 1) drop_specks(view, cleaning.min_px);
  padded(picture).copyTo(mask);
}

}  // namespace glasswing
