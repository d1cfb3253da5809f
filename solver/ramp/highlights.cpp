#include "solver/ramp/highlights.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "solver/ramp/byte_runs.h"

namespace glasswing {
namespace {

cv::Mat plane_of(const std::vector<float>& plane, const RampFrame& frame, const cv::Rect& box) {
  return cv::Mat(frame.height_px, frame.width_px, CV_32F, const_cast<float*>(plane.data()))(box);
}

// The bounding box of the 255s, enlarged by a margin within the picture.
cv::Rect box_round(std::span<const std::uint8_t> mask, const RampFrame& frame, int margin_px) {
  int left = frame.width_px, right = -1, top = frame.height_px, bottom = -1;
  for (int y = 0; y < frame.height_px; ++y) {
    const std::uint8_t* const row = mask.data() + static_cast<size_t>(y) * frame.width_px;
    const std::uint8_t *const end = row + frame.width_px, *const first = next_set(row, end);
    if (first == end) continue;
    const std::uint8_t* last = end - 1;
    while (*last == 0) --last;
    left = std::min(left, static_cast<int>(first - row));
    right = std::max(right, static_cast<int>(last - row));
    top = std::min(top, y);
    bottom = y;
  }
  if (right < 0) return {};
  const cv::Rect box(left - margin_px, top - margin_px, right - left + 1 + 2 * margin_px,
                     bottom - top + 1 + 2 * margin_px);
  return box & cv::Rect(0, 0, frame.width_px, frame.height_px);
}

// rho without peaks narrower than the disc.
cv::Mat without_peaks(const cv::Mat& rho, const cv::Mat& alpha, int reach_px) {
  const int block = std::max(1, reach_px / 6), reach = std::max(1, reach_px / block);
  const cv::Mat covered = alpha > kHighlightCover;
  const cv::Size coarse((rho.cols + block - 1) / block, (rho.rows + block - 1) / block);
  cv::Mat padded_rho = cv::Mat::zeros(coarse * block, CV_32F), padded_share = padded_rho.clone();
  rho.copyTo(padded_rho(cv::Rect(0, 0, rho.cols, rho.rows)), covered);
  padded_share(cv::Rect(0, 0, rho.cols, rho.rows)).setTo(1.0f, covered);
  cv::Mat sum, share;
  cv::resize(padded_rho, sum, coarse, 0, 0, cv::INTER_AREA);
  cv::resize(padded_share, share, coarse, 0, 0, cv::INTER_AREA);
  const cv::Mat none = share <= 0.0f;
  cv::Mat mean = sum / share;
  mean.setTo(1e9f, none);
  const cv::Mat disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * reach + 1, 2 * reach + 1});
  cv::erode(mean, mean, disc);
  mean.setTo(-1e9f, none);
  cv::dilate(mean, mean, disc);
  cv::Mat fine;
  cv::resize(mean, fine, coarse * block, 0, 0, cv::INTER_LINEAR);
  return fine(cv::Rect(0, 0, rho.cols, rho.rows));
}

// Pixels hold three values and 1 if known, otherwise 0. Fills the unknown ones from means over increasingly
// large squares.
cv::Mat filled(const cv::Mat& known) {
  cv::Mat out(known.size(), CV_32FC4);
  const bool last = known.cols == 1 && known.rows == 1;
  cv::Mat under;
  if (!last) {
    const cv::Size half((known.cols + 1) / 2, (known.rows + 1) / 2);
    cv::Mat even = cv::Mat::zeros(half * 2, CV_32FC4), coarse;
    known.copyTo(even(cv::Rect(0, 0, known.cols, known.rows)));
    cv::resize(even, coarse, half, 0, 0, cv::INTER_AREA);
    for (cv::Vec4f& value : cv::Mat_<cv::Vec4f>(coarse)) {
      if (value[3] > 0.0f) value *= 1.0f / value[3];
    }
    cv::resize(filled(coarse), under, half * 2, 0, 0, cv::INTER_LINEAR);
  }
  for (int y = 0; y < known.rows; ++y) {
    for (int x = 0; x < known.cols; ++x) {
      const cv::Vec4f& here = known.at<cv::Vec4f>(y, x);
      out.at<cv::Vec4f>(y, x) = here[3] > 0.0f || last ? here : under.at<cv::Vec4f>(y, x);
    }
  }
  return out;
}

}  // namespace

std::vector<std::uint8_t> find_highlights(const RampFrame& frame, std::span<const std::uint8_t> sure,
                                          const HighlightRule& rule) {
  const cv::Rect box = box_round(sure, frame, 2 * rule.reach_px);
  if (box.empty()) return {};
  const cv::Mat rho = plane_of(frame.rho, frame, box), alpha = plane_of(frame.alpha, frame, box);
  const cv::Mat base = without_peaks(rho, alpha, rule.reach_px);
  const auto rise = static_cast<float>(rule.rise + 3.0 * rule.rho_sd);
  // Grow from the sure pixels to all connected ones that rise.
  std::vector<std::uint8_t> found(frame.alpha.size());
  std::vector<cv::Point> open;
  const auto place = [&](int x, int y) {
    return static_cast<size_t>(box.y + y) * frame.width_px + static_cast<size_t>(box.x + x);
  };
  const auto take = [&](int x, int y) {
    found[place(x, y)] = 255;
    open.emplace_back(x, y);
  };
  for (int y = 0; y < box.height; ++y) {
    for (int x = 0; x < box.width; ++x) {
      if (sure[place(x, y)] != 0) take(x, y);
    }
  }
  while (!open.empty()) {
    const cv::Point at = open.back();
    open.pop_back();
    for (int y = std::max(at.y - 1, 0); y <= std::min(at.y + 1, box.height - 1); ++y) {
      for (int x = std::max(at.x - 1, 0); x <= std::min(at.x + 1, box.width - 1); ++x) {
        if (found[place(x, y)] != 0 || !(alpha.at<float>(y, x) > kHighlightCover)) continue;
        if (rho.at<float>(y, x) - base.at<float>(y, x) > rise) take(x, y);
      }
    }
  }
  return found;
}

void bridge_highlights(std::span<const std::uint8_t> highlights, double blur_px, RampFrame& frame) {
  const int reach_px = std::max(1, static_cast<int>(std::ceil(3.0 * blur_px)));
  const cv::Rect core = box_round(highlights, frame, 0);
  if (core.empty()) return;
  // Include as much of the surroundings as the highlights are wide.
  const int margin = std::max({core.width, core.height, reach_px});
  const cv::Rect box =
      cv::Rect(core.x - margin, core.y - margin, core.width + 2 * margin, core.height + 2 * margin) &
      cv::Rect(0, 0, frame.width_px, frame.height_px);
  const auto place = [&](int x, int y) {
    return static_cast<size_t>(box.y + y) * frame.width_px + static_cast<size_t>(box.x + x);
  };
  cv::Mat known = cv::Mat::zeros(box.size(), CV_32FC4);
  for (int y = 0; y < box.height; ++y) {
    for (int x = 0; x < box.width; ++x) {
      const size_t at = place(x, y);
      if (highlights[at] != 0 || frame.alpha[at] < 1.0f || !(frame.info_xx[at] > 0.0f)) continue;
      known.at<cv::Vec4f>(y, x) = {frame.x_px[at], frame.y_px[at], frame.rho[at], 1.0f};
    }
  }
  cv::Mat bridged = filled(known);
  // Blur within the object only.
  for (int y = 0; y < box.height; ++y) {
    for (int x = 0; x < box.width; ++x) {
      const size_t at = place(x, y);
      if (highlights[at] == 0 && known.at<cv::Vec4f>(y, x)[3] == 0.0f) bridged.at<cv::Vec4f>(y, x) = {};
    }
  }
  if (blur_px > 0.0) {
    const int side = 2 * reach_px + 1;
    cv::GaussianBlur(bridged, bridged, {side, side}, blur_px, blur_px, cv::BORDER_REPLICATE);
  }
  for (int y = 0; y < box.height; ++y) {
    for (int x = 0; x < box.width; ++x) {
      const size_t at = place(x, y);
      if (highlights[at] == 0) continue;
      frame.highlight[at] = 1.0f;
      frame.info_xx[at] = frame.info_xy[at] = frame.info_yy[at] = 0.0f;
      const cv::Vec4f& value = bridged.at<cv::Vec4f>(y, x);
      if (!(value[3] > 0.0f)) continue;  // no known surroundings: leave it as measured
      frame.x_px[at] = value[0] / value[3];
      frame.y_px[at] = value[1] / value[3];
      frame.rho[at] = value[2] / value[3];
    }
  }
}

}  // namespace glasswing
