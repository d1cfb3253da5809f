// Which pixels of a picture show the object: those that differ from the empty stage by more than noise,
// cleaned by dilation, hole filling and erosion (Chuang et al. 2000, section 4.2). For photographs and frames
// of a video, in whatever codes: what SilhouetteTest learns from a session's many stimuli, neighbours must
// tell here.
//
//   different where  sum_c (frame_c - empty_c)^2 / variance_c > chi-square quantile of three degrees
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "core/frame/image.h"
#include "solver/background/image_registration.h"
#include "solver/background/mask_cleaning.h"

namespace glasswing {

struct Mask {
  int width_px = 0, height_px = 0;
  std::vector<std::uint8_t> samples;  // by rows: 255 the object, 0 what is behind it

  bool inside(int x, int y) const {
    return samples[static_cast<size_t>(y) * static_cast<size_t>(width_px) + static_cast<size_t>(x)] != 0;
  }
  double coverage() const;  // the share that is inside
};

struct MaskOptions {
  int bits = 16;                      // of a code in the pictures, before it was scaled to 16
  double false_positive_rate = 1e-6;  // of the difference test at a pixel of normal noise, in (0, 1)
  // Half sides of the squares that dilate and erode; 0: neither. Left out: 0.3 % of the picture's diagonal,
  // which closes gaps where the object happens to show what is behind it; eroded as dilated.
  std::optional<int> dilation_px = std::nullopt;
  std::optional<int> erosion_px = std::nullopt;
  bool fill_holes = true;
  // What hangs together in fewer pixels is noise. Left out: the area of the square that dilates.
  std::optional<int> min_px = std::nullopt;
  bool follow_drift = true;  // of the pair (ImageRegistration)
};

// The empty stage, prepared once.
class ObjectMask {
 public:
  // From a picture of the stage without the object, moved onto that with it, to which it is to be applied;
  // the noise is what most pixels differ by. Errors: those of find_drift.
  static absl::StatusOr<ObjectMask> of_pair(const Image16& with, const Image16& without,
                                            const MaskOptions& options);

  // Safe on any number of threads. `frame` is of the empty stage's size.
  Mask mask(const Image16& frame) const;

  const Image16& empty() const { return empty_; }  // moved
  const ImageRegistration& drift() const { return drift_; }
  double usual_noise() const;  // standard deviation of a difference, share of the highest code: the median

 private:
  friend class EmptyAverage;
  ObjectMask(Image16 empty, const MaskOptions& options);
  // `square`: of a sample's difference from the empty stage, by its place; `factor`: what its variance is
  // times that.
  template <typename Square>
  void learn_noise(const Square& square, bool several, double factor);

  Image16 empty_;
  double rounding_;  // the variance that a code's bits make of a difference
  ImageRegistration drift_;
  std::vector<float> inverse_sd_;  // of codes of 16 bits; 0 where the empty stage was not seen
  float threshold_;
  MaskCleaning cleaning_;
};

// The mean of many frames of the empty stage, as of the seconds before an object comes, and their noise; one
// frame at a time.
class EmptyAverage {
 public:
  // INVALID_ARGUMENT: it is of another size than those before.
  absl::Status add(const Image16& frame);
  // FAILED_PRECONDITION: fewer than two frames.
  absl::StatusOr<ObjectMask> finish(const MaskOptions& options) const;

 private:
  int count_ = 0;
  RadianceImage mean_, squares_;  // of the differences from the mean
};

}  // namespace glasswing
