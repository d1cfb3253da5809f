// The part that all methods share: separates the object from the stage behind it and fills in the matte of
// the stage.
#pragma once

#include <span>
#include <vector>

#include "core/matte/matte.h"
#include "solver/background/empty_stage.h"
#include "solver/background/silhouette.h"
#include "solver/background/stage_layout.h"
#include "solver/background/stage_maps.h"
#include "solver/method/method.h"
#include "solver/method/sample_noise.h"

namespace glasswing {

// By pixel of a row.
struct SettledRow {
  std::vector<bool> object;
  // Background whose position the empty stage's bars do not determine: its modes are a guess and flagged.
  std::vector<bool> open;
};

class Surroundings {
 public:
  // Keeps references to both. `tolerance`: see SilhouetteTest.
  Surroundings(const FrameStack& stack, const StageLayout& layout, double tolerance);

  // Solves row y of the stack into row y of the matte: F and coverage of every pixel, the modes of those that
  // the object does not change, and a flag for those that see an id patch. `read_sd`: by pixel if the
  // camera's noise is unknown; empty: that of a typical camera. F of the object is the light of black with
  // it, or 0 if that was not recorded. Beside the object it is the background map's, from all pictures of the
  // empty stage, unless black with the object contradicts it.
  SettledRow settle_row(int y, std::span<const double> read_sd, Matte& matte);

  // The radiance of black with the object, which must have been recorded; `lane` counts the samples of a
  // row.
  float black(int y, int lane) const;

  // The pixel's view without the object, by texture. Nothing is `seen` if the empty stage was not recorded.
  // It lies on the smooth map of the stage (FrameStack::stage_maps) where there is one; on a bare stage it
  // lies near the map, where its own bars see it; both unless the bars of this pixel and of most of its
  // neighbours along the row contradict that.
  std::span<const BackgroundPoint> background(int x, int y);

  bool noise_known() const { return noise_known_; }
  // If unknown, that of a typical camera.
  const SampleNoise& noise() const { return noise_; }

 private:
  bool has_object(int x, int y, double read_sd);
  // A pixel that sees an id patch changes in every frame.
  bool sees_patch(int x, int y) const;
  const SmoothStage* map_of(size_t monitor) const;
  BackgroundPoint point_on_map(size_t monitor, int x, int y);
  // Sets on_map_ and refuted_ of row y.
  void judge_maps(int y);
  void set_foreground(int x, int y, const BackgroundPoint& point, Matte& matte);
  // False: the modes are a guess.
  bool map_background(int x, int y, Matte& matte);

  const FrameStack& stack_;
  const StageLayout& layout_;
  const bool noise_known_;
  const SampleNoise noise_;
  const SilhouetteTest silhouette_;
  std::vector<BackgroundMap> background_;
  std::vector<BackgroundPoint> points_;
  EmptyPixel empty_pixel_;
  // [monitor][x] of the last row judged; empty without a map.
  int judged_row_ = -1;
  std::vector<std::vector<BackgroundPoint>> on_map_;
  std::vector<std::vector<bool>> refuted_;
};

}  // namespace glasswing
