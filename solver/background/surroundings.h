// What every method does alike: tells the object from the stage behind it, and makes the matte of the rest.
#pragma once

#include <span>
#include <vector>

#include "core/matte/matte.h"
#include "solver/background/empty_stage.h"
#include "solver/background/silhouette.h"
#include "solver/background/stage_layout.h"
#include "solver/method/method.h"
#include "solver/method/sample_noise.h"

namespace glasswing {

// By pixel of a row.
struct SettledRow {
  std::vector<bool> object;
  // Background, but the empty stage's bars leave open which part of a monitor it is: its modes are a guess,
  // and flagged.
  std::vector<bool> open;
};

class Surroundings {
 public:
  // Both must outlive it. `tolerance`: of SilhouetteTest.
  Surroundings(const FrameStack& stack, const StageLayout& layout, double tolerance);

  // Row y of the stack into row y of the matte: F and coverage of every pixel, the modes of those that the
  // object does not change, a flag for those that see an id patch.
  // `read_sd`: by pixel, where the camera's noise is not known; empty: that of an ordinary camera.
  // F is the light before black with the object; where that was not taken, it is the background map's, and 0
  // where the object is.
  SettledRow settle_row(int y, std::span<const double> read_sd, Matte& matte);

  // Radiance before black with the object, which must have been taken; `lane` counts channels of a row.
  float black(int y, int lane) const;

  // What the pixel sees without the object, by texture; none of it is seen where that was not taken.
  std::span<const BackgroundPoint> background(int x, int y);

  bool noise_known() const { return noise_known_; }
  // Where it is not known: as of an ordinary camera.
  const SampleNoise& noise() const { return noise_; }

 private:
  bool has_object(int x, int y, double read_sd);
  // A pixel that sees an id patch sees other things in every frame.
  bool sees_patch(int x, int y) const;
  // False: it is a guess.
  bool map_background(int x, int y, Matte& matte);

  const FrameStack& stack_;
  const StageLayout& layout_;
  const bool noise_known_;
  const SampleNoise noise_;
  const SilhouetteTest silhouette_;
  std::vector<EmptyMonitor> empty_;
  std::vector<BackgroundMap> background_;
  std::vector<BackgroundPoint> points_;
  EmptyPixel empty_pixel_;
  std::vector<SilhouetteTest::Pair> pairs_;
};

}  // namespace glasswing
