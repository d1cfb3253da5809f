// Solves stacks of one archive in bands of rows on several threads. Samples become light first, and
// afterwards the fall-off of camera and monitors that the archive's calibrations give is removed from the
// matte.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <vector>

#include "core/import/mapped_archive.h"
#include "core/radiometry/shading.h"
#include "solver/corrections/frame_corrections.h"
#include "solver/method/brightness_drift.h"
#include "solver/method/linear_stack.h"
#include "solver/method/method.h"

namespace glasswing {

// Rows of the picture.
struct RowRange {
  int first = 0, count = 0;
};

// A method, the light and the shading of one archive: everything that its tiles share. Thread-safe.
class PreparedSolve {
 public:
  // FAILED_PRECONDITION says what the archive lacks; INVALID_ARGUMENT: an invalid calibration.
  static absl::StatusOr<PreparedSolve> create(const Method& method, const v1::CaptureManifest& manifest);

  const std::vector<int>& frames_needed() const { return method_->frames_needed(); }

  // Measures the smooth maps of the empty stage, on which pixels outside the object will be solved. `read`
  // reads rows as they are stored; `brightness` is FrameStack's. Errors are those of `read`. `correct`: what
  // the rig did to the frames is measured first, warned of, and corrected from then on (solver/frames).
  absl::Status map_stage(const RowReader& read, const std::vector<std::array<float, 3>>& brightness,
                         bool correct = true);

  // What map_stage() found.
  const FrameFaults& faults() const { return faults_; }

  // How many rows of the stack on either side of those that are wanted a matte needs, where the picture has
  // them: of a mosaic, whose missing channels come from pixels around (solver/mosaic), and beside bad pixels.
  int margin_rows() const;

  // The matte of all rows of the stack, of which margin_rows() at either end are right at the picture's edge
  // only. `thread_count` 0: one for each core. `stop` is checked between bands and gives CANCELLED. If bands
  // fail, the error of the first one. `progress` receives the share of rows that are solved, after each band
  // and from any thread.
  absl::StatusOr<Matte> solve_in_bands(const FrameStack& stack, int thread_count = 0,
                                       std::stop_token stop = {},
                                       const std::function<void(double)>& progress = nullptr) const;
  // The matte of these rows of the picture, all of them right; the frames needed are read band by band.
  // `read` is called from several threads at a time.
  using ReadStack = std::function<absl::StatusOr<FrameStack>(int first_row, int row_count)>;
  absl::StatusOr<Matte> solve_in_bands(const ReadStack& read, const RowRange& rows, int thread_count,
                                       const std::function<void(double)>& progress) const;

 private:
  // `read` gives a band's rows as the method wants them, from the stack's row `first` on.
  absl::StatusOr<Matte> solve_bands(int row_count, int column_step, const ReadStack& read, int thread_count,
                                    std::stop_token stop, const std::function<void(double)>& progress) const;

  // Pixels that the camera does not see are made of what those around saw (filled_rows.h).
  void flag_bad_pixels(Matte& matte) const;

  PreparedSolve(v1::CaptureManifest manifest, LinearStack linear, Shading shading,
                std::unique_ptr<PreparedMethod> method)
      : manifest_(std::move(manifest)),
        linear_(std::move(linear)),
        shading_(std::move(shading)),
        method_(std::move(method)) {}

  // A row of frames as light, by `read`, with these corrections.
  absl::StatusOr<FrameStack> light_row(const RowReader& read, int row, const std::vector<int>& frames,
                                       const std::vector<std::array<float, 3>>& brightness,
                                       const std::shared_ptr<const FrameCorrections>& corrections) const;

  v1::CaptureManifest manifest_;  // of light
  LinearStack linear_;
  Shading shading_;
  std::unique_ptr<PreparedMethod> method_;
  FrameFaults faults_;
  std::shared_ptr<const StageMaps> stage_maps_;
  std::optional<Mosaic> interpolated_;  // of frames whose colours the method wants at every pixel
};

// Prepares and solves one stack, on smooth maps of its empty stage if it has all rows of the picture.
absl::StatusOr<Matte> solve_in_bands(const Method& method, const v1::CaptureManifest& manifest,
                                     const FrameStack& stack, int thread_count = 0, std::stop_token stop = {},
                                     const std::function<void(double)>& progress = nullptr);

// Solves an archive, or these rows of it, which have the same bits then. No more of its compressed frames
// than the bands that are being solved is in memory. `correct`: map_stage()'s.
absl::StatusOr<Matte> solve_archive(const Method& method, const MappedArchive& archive, int thread_count = 0,
                                    const std::function<void(double)>& progress = nullptr,
                                    bool correct = true, const std::optional<RowRange>& rows = std::nullopt);

// What solve_archive() finds wrong with the frames.
absl::StatusOr<FrameFaults> faults_of_archive(const Method& method, const MappedArchive& archive);

}  // namespace glasswing
