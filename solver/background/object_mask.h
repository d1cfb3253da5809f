// The mask of pixels that differ from the empty stage by more than noise, cleaned by dilation, hole filling
// and erosion (Chuang et al. 2000, section 4.2). For photographs and video frames in any codes: it relies on
// neighbouring pixels, whereas SilhouetteTest uses the many stimuli of a session.
//
//   different where  sum_c (frame_c - empty_c)^2 / variance_c > chi-square quantile of three degrees
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "core/image/image.h"
#include "solver/background/image_registration.h"
#include "solver/background/mask_cleaning.h"

namespace glasswing {

struct Mask {
  int width_px = 0, height_px = 0;
  std::vector<std::uint8_t> samples;  // by rows: 255 object, 0 background

  bool inside(int x, int y) const { return samples[static_cast<size_t>(y) * width_px + x] != 0; }
  double coverage() const;  // the object's share of the picture
};

struct MaskOptions {
  int bits = 16;                      // of a picture's codes before scaling to 16
  double false_positive_rate = 1e-6;  // of the difference test at a pixel of normal noise, in (0, 1)
  // Half sides of the squares for dilation and erosion; 0: none. Default: dilation by 0.3 % of the picture's
  // diagonal, which closes gaps where the object happens to look like its background; erosion equal to
  // dilation.
  std::optional<int> dilation_px = std::nullopt;
  std::optional<int> erosion_px = std::nullopt;
  bool fill_holes = true;
  // Smaller connected regions are noise. Default: the area of the dilating square.
  std::optional<int> min_px = std::nullopt;
  bool follow_drift = true;  // register the pair first (ImageRegistration)
};

// The empty stage, prepared once.
class ObjectMask {
 public:
  // Registers `without`, a picture of the empty stage, to `with`, to which the mask will be applied. The
  // noise is measured from their typical difference. Errors: those of find_registration.
  static absl::StatusOr<ObjectMask> of_pair(const Image16& with, const Image16& without,
                                            const MaskOptions& options);

  // Thread-safe. `frame` has the size of the empty stage.
  Mask mask(const Image16& frame) const;

  const Image16& empty() const { return empty_; }  // moved
  const ImageRegistration& registration() const { return registration_; }
  double usual_noise() const;  // median standard deviation of a difference, as a share of the highest code

 private:
  friend class EmptyAverage;
  ObjectMask(Image16 empty, const MaskOptions& options);
  // `square`: of a sample's difference from the empty stage, by its place; `factor`: what its variance is
  // times that.
  template <typename Square>
  void learn_noise(const Square& square, bool several, double factor);

  Image16 empty_;
  double rounding_;  // the variance of a difference due to rounding
  ImageRegistration registration_;
  std::vector<float> inverse_sd_;  // per 16-bit code; 0 where the empty stage was not seen
  float threshold_;
  MaskCleaning cleaning_;
};

// Accumulates mean and noise of many frames of the empty stage, one at a time.
class EmptyAverage {
 public:
  // INVALID_ARGUMENT: its size differs from that of the earlier frames.
  absl::Status add(const Image16& frame);
  // FAILED_PRECONDITION: fewer than two frames.
  absl::StatusOr<ObjectMask> finish(const MaskOptions& options) const;

 private:
  int count_ = 0;
  RadianceImage mean_, squares_;  // of the differences from the mean
};

}  // namespace glasswing
