#include "solver/background/object_mask.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <iterator>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/status.h"
#include "solver/background/difference_noise.h"
#include "solver/background/mask_cleaning.h"
#include "solver/background/silhouette.h"

namespace glasswing {
namespace {

constexpr size_t kMaxSamples = 300'000;  // that the noise model is fitted to

// The range of the 3x3 codes around each sample.
Image16 range_of(const Image16& image) {
  Image16 range(image.width_px, image.height_px);
  const auto matrix = [](const Image16& each) {
    return cv::Mat(each.height_px, each.width_px, CV_16UC3, const_cast<std::uint16_t*>(each.samples.data()));
  };
  const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, {3, 3});
  cv::Mat high, low, result = matrix(range);
  cv::dilate(matrix(image), high, square);
  cv::erode(matrix(image), low, square);
  cv::subtract(high, low, result);
  return range;
}

// Every n-th sample for the fit. `square` returns a sample's squared difference, NaN where there is none.
template <typename Square>
std::vector<DifferenceSample> samples_of(const Image16& empty, const Image16& range, const Square& square) {
  const size_t count = empty.samples.size();
  const size_t step = count / kMaxSamples / 3 * 3 + 1;  // cycles through the channels
  std::vector<DifferenceSample> samples;
  for (size_t i = 0; i < count; i += step) {
    const double each = square(i);
    if (std::isnan(each)) continue;
    samples.push_back(
        {.square = each, .level = radiance_of(empty.samples[i]), .range = radiance_of(range.samples[i])});
  }
  return samples;
}

Image16 codes_of(const RadianceImage& shares) {
  Image16 image(shares.width_px, shares.height_px);
  std::transform(shares.samples.begin(), shares.samples.end(), image.samples.begin(), code16_of);
  return image;
}

}  // namespace

double Mask::coverage() const {
  const auto inside = std::count(samples.begin(), samples.end(), 255);
  return static_cast<double>(inside) / static_cast<double>(std::max<size_t>(1, samples.size()));
}

ObjectMask::ObjectMask(Image16 empty, const MaskOptions& options)
    : empty_(std::move(empty)),
      rounding_(2.0 / 12.0 / std::pow(std::exp2(options.bits) - 1.0, 2)),
      inverse_sd_(empty_.samples.size()),
      threshold_(static_cast<float>(chi_square_quantile(3.0, options.false_positive_rate))),
      cleaning_(usual_cleaning(empty_.width_px, empty_.height_px, options.dilation_px, options.erosion_px,
                               options.min_px)) {
  cleaning_.fill_holes = options.fill_holes;
}

template <typename Square>
void ObjectMask::learn_noise(const Square& square, bool several, double factor) {
  const Image16 range = range_of(empty_);
  const DifferenceNoise noise = fit_difference_noise(samples_of(empty_, range, square), several, rounding_);
  for (size_t i = 0; i < inverse_sd_.size(); ++i) {
    const double variance = noise.variance(static_cast<double>(radiance_of(empty_.samples[i])),
                                           static_cast<double>(radiance_of(range.samples[i])));
    inverse_sd_[i] = static_cast<float>(1.0 / (65535.0 * std::sqrt(factor * variance)));
  }
}

absl::StatusOr<ObjectMask> ObjectMask::of_pair(const Image16& with, const Image16& without,
                                               const MaskOptions& options) {
  GW_RETURN_IF_ERROR(check_same_size(with, without));
  ImageRegistration registration;
  if (options.follow_drift) {
    GW_ASSIGN_OR_RETURN(registration, find_registration(with, without));
  }
  const RadianceImage empty = moved(without, registration);
  ObjectMask mask(codes_of(empty), options);
  mask.registration_ = registration;
  mask.learn_noise(
      [&](size_t i) {
        const double difference = radiance_of(with.samples[i]) - empty.samples[i];
        return difference * difference;
      },
      false, 1.0);
  for (size_t i = 0; i < empty.samples.size(); ++i) {
    if (std::isnan(empty.samples[i])) mask.inverse_sd_[i] = 0.0f;
  }
  return mask;
}

double ObjectMask::usual_noise() const {
  std::vector<float> inverse;
  std::copy_if(inverse_sd_.begin(), inverse_sd_.end(), std::back_inserter(inverse),
               [](float each) { return each > 0.0f; });
  if (inverse.empty()) return 0.0;
  const auto middle = inverse.begin() + inverse.size() / 2;
  std::nth_element(inverse.begin(), middle, inverse.end());
  return 1.0 / (65535.0 * static_cast<double>(*middle));
}

Mask ObjectMask::mask(const Image16& frame) const {
  assert(frame.width_px == empty_.width_px && frame.height_px == empty_.height_px);
  Mask mask{.width_px = frame.width_px, .height_px = frame.height_px, .samples = {}};
  mask.samples.resize(static_cast<size_t>(frame.width_px) * frame.height_px);
  const size_t row_samples = 3 * static_cast<size_t>(frame.width_px);
  std::vector<float> squares(row_samples);
  for (int y = 0; y < frame.height_px; ++y) {
    const size_t first = frame.index(0, y, 0);
    for (size_t i = 0; i < row_samples; ++i) {
      const int difference = frame.samples[first + i] - empty_.samples[first + i];
      const float z = static_cast<float>(difference) * inverse_sd_[first + i];
      squares[i] = z * z;
    }
    std::uint8_t* const row = mask.samples.data() + first / 3;
    for (size_t x = 0; x < static_cast<size_t>(frame.width_px); ++x)
      row[x] = squares[3 * x] + squares[3 * x + 1] + squares[3 * x + 2] > threshold_ ? 255 : 0;
  }
  clean_mask(mask.samples, mask.width_px, mask.height_px, cleaning_);
  return mask;
}

absl::Status EmptyAverage::add(const Image16& frame) {
  if (count_ > 0 && (frame.width_px != mean_.width_px || frame.height_px != mean_.height_px)) {
    return absl::InvalidArgumentError(
        fmt::format("frame {} of the empty stage is {}x{}; those before are {}x{}", count_, frame.width_px,
                    frame.height_px, mean_.width_px, mean_.height_px));
  }
  if (count_ == 0) mean_ = squares_ = RadianceImage(frame.width_px, frame.height_px);
  ++count_;
  const float part = 1.0f / static_cast<float>(count_);
  for (size_t i = 0; i < frame.samples.size(); ++i) {  // Welford
    const float code = radiance_of(frame.samples[i]), before = code - mean_.samples[i];
    mean_.samples[i] += before * part;
    squares_.samples[i] += before * (code - mean_.samples[i]);
  }
  return absl::OkStatus();
}

absl::StatusOr<ObjectMask> EmptyAverage::finish(const MaskOptions& options) const {
  if (count_ < 2) {
    return absl::FailedPreconditionError(
        fmt::format("{} frames of the empty stage; there must be two, to tell the noise", count_));
  }
  ObjectMask mask(codes_of(mean_), options);
  // A frame differs from the mean by its own noise and the mean's.
  mask.learn_noise([&](size_t i) { return squares_.samples[i] / (count_ - 1.0); }, true, 1.0 + 1.0 / count_);
  return mask;
}

}  // namespace glasswing
