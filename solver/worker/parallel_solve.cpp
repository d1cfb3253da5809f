#include "solver/worker/parallel_solve.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <optional>
#include <thread>

#include "core/base/status.h"
#include "core/matte/matte_rounding.h"
#include "solver/background/stage_maps.h"
#include "solver/corrections/code_response.h"
#include "solver/method/filled_rows.h"
#include "solver/method/frame_registration.h"
#include "solver/mosaic/interpolated_stack.h"
#include "solver/mosaic/mosaic_matte.h"

namespace glasswing {
namespace {

constexpr int kDisturbedReach = 1;  // rows

FrameStack rows_of(const FrameStack& stack, const std::vector<int>& needed, int first, int count) {
  FrameStack band = stack;
  band.first_row = stack.first_row + first;
  band.row_count = count;
  const size_t row = static_cast<size_t>(stack.width_px) * stack.samples_per_pixel();
  band.rows.assign(stack.rows.size(), {});
  for (const int frame : needed) {
    const size_t at = frame;
    band.rows[at] =
        stack.rows[at].subspan(static_cast<size_t>(first) * row, static_cast<size_t>(count) * row);
  }
  return band;
}

RowReader rows_of(const MappedArchive& archive) {
  return [&archive](int row, const std::vector<int>& frames) -> absl::StatusOr<std::vector<std::uint16_t>> {
    std::vector<std::uint16_t> samples;
    for (const int frame : frames) {
      GW_ASSIGN_OR_RETURN(const FrameSamples own, archive.read(frame, row, 1));
      samples.insert(samples.end(), own.samples.begin(), own.samples.end());
    }
    return samples;
  };
}

// Applied to the finished matte: correcting samples would change their noise.
void remove_fall_off(const Shading& shading, int column_step, Matte& matte) {
  if (shading.is_uniform()) return;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      const double camera = shading.camera(matte.x0_px() + x * column_step, matte.y0_px() + y);
      for (float& light : matte.foreground(x, y)) light /= static_cast<float>(camera);
      for (int c = 0; c < (matte.is_colourless() ? 1 : kChannels); ++c) {
        for (Mode& mode : matte.modes(x, y, c)) {
          const double monitor =
              shading.monitor(mode.texture, static_cast<double>(mode.x_px), static_cast<double>(mode.y_px));
          const auto light = static_cast<float>(camera * monitor);
          mode.weight /= light;
          mode.weight_sd /= light;
        }
        for (PyramidFootprint& pyramid : matte.pyramids(x, y, c)) {
          for (float* const light : {&pyramid.foreground, &pyramid.noise_sd, &pyramid.prior_sd})
            *light /= static_cast<float>(camera);
          for (Coefficient& own : pyramid.coefficients) {
            const Mode mode = own.level < kPyramidLevels
                                  ? mode_of(own, pyramid.texture)
                                  : matte.modes(x, y, c)[static_cast<size_t>(own.level - kPyramidLevels)];
            own.weight /=
                static_cast<float>(camera * shading.monitor(pyramid.texture, static_cast<double>(mode.x_px),
                                                            static_cast<double>(mode.y_px)));
          }
        }
      }
    }
  }
}

}  // namespace

absl::StatusOr<PreparedSolve> PreparedSolve::create(const Method& method,
                                                    const v1::CaptureManifest& manifest) {
  GW_ASSIGN_OR_RETURN(LinearStack linear, LinearStack::create(manifest));
  GW_ASSIGN_OR_RETURN(Shading shading, Shading::create(manifest));
  const std::optional<Mosaic> mosaic = mosaic_of(manifest.camera());
  const bool interpolates = mosaic && !method.solves_mosaics();
  v1::CaptureManifest of_light = linear.manifest_of_light(manifest);
  if (interpolates) of_light.mutable_camera()->clear_mosaic();
  GW_ASSIGN_OR_RETURN(std::unique_ptr<PreparedMethod> prepared, method.prepare(of_light));
  PreparedSolve solve(std::move(of_light), std::move(linear), std::move(shading), std::move(prepared));
  if (interpolates) solve.interpolated_ = mosaic;
  return solve;
}

absl::StatusOr<FrameStack> PreparedSolve::light_row(
    const RowReader& read, int row, const std::vector<int>& wanted,
    const std::vector<std::array<float, 3>>& brightness,
    const std::shared_ptr<const FrameCorrections>& corrections) const {
  const std::vector<int> frames = with_needed(wanted, corrections.get(), frames_needed());
  const int moved = registration_reach(corrections.get(), manifest_.camera().width_px());
  const int reach = interpolated_ ? kInterpolationReach : moved;
  const int first = std::max(row - reach, 0), end = std::min(row + reach + 1, manifest_.camera().height_px());
  FrameStack stack{.width_px = manifest_.camera().width_px(),
                   .first_row = first,
                   .row_count = end - first,
                   .rows = {},
                   .owner = nullptr,
                   .brightness = brightness,
                   .corrections = corrections,
                   .mosaic = interpolated_ ? interpolated_ : mosaic_of(manifest_.camera())};
  stack.rows.resize(manifest_.frames_size());
  const auto count = static_cast<size_t>(stack.width_px) * stack.samples_per_pixel();
  const size_t frame_samples = count * static_cast<size_t>(stack.row_count);
  const auto owner = std::make_shared<std::vector<std::uint16_t>>(frames.size() * frame_samples);
  for (int y = 0; y < stack.row_count; ++y) {
    GW_ASSIGN_OR_RETURN(const std::vector<std::uint16_t> samples, read(first + y, frames));
    for (size_t i = 0; i < frames.size(); ++i) {
      std::copy_n(samples.begin() + i * count, count,
                  owner->begin() + i * frame_samples + static_cast<size_t>(y) * count);
    }
  }
  for (size_t i = 0; i < frames.size(); ++i) {
    stack.rows[frames[i]] = std::span<const std::uint16_t>(*owner).subspan(i * frame_samples, frame_samples);
  }
  stack.owner = owner;
  if (interpolated_) stack = interpolated_rows(stack, frames, row - first, 1);
  stack = linear_.of(std::move(stack));
  return moved > 0 ? registered_rows(stack, *corrections, row - first, 1) : stack;
}

absl::Status PreparedSolve::map_stage(const RowReader& read,
                                      const std::vector<std::array<float, 3>>& brightness, bool correct) {
  const auto reader = [&](std::shared_ptr<const FrameCorrections> corrections) -> LightReader {
    return [&, corrections](int row, const std::vector<int>& frames) {
      return light_row(read, row, frames, brightness, corrections);
    };
  };
  if (correct) {
    GW_ASSIGN_OR_RETURN(const CodeResponse codes,
                        find_code_response(manifest_, frames_needed(), reader(nullptr)));
    if (!codes.response.empty()) GW_RETURN_IF_ERROR(linear_.decode(codes.response));
    GW_ASSIGN_OR_RETURN(faults_, find_faults(manifest_, frames_needed(), reader));
    if (!codes.warning.empty()) faults_.warnings.push_back(codes.warning);
  }
  stage_maps_ = faults_.maps;
  if (stage_maps_ != nullptr) return absl::OkStatus();
  GW_ASSIGN_OR_RETURN(StageMaps maps,
                      measure_stage_maps(manifest_, frames_needed(), reader(faults_.corrections)));
  stage_maps_ = std::make_shared<const StageMaps>(std::move(maps));
  return absl::OkStatus();
}

int PreparedSolve::margin_rows() const {
  const bool mosaic = !manifest_.camera().mosaic().empty();
  const int bad = faults_.bad_pixels.empty() ? 0 : filled_reach(mosaic);
  const int reach =
      std::max(bad + registration_reach(faults_.corrections.get(), manifest_.camera().width_px()),
               faults_.disturbance.moved_px > 0.0 ? kDisturbedReach : 0);
  return reach + (interpolated_ ? kInterpolationReach : mosaic ? kMosaicReach : 0);
}

void PreparedSolve::flag_bad_pixels(Matte& matte) const {
  const int width = manifest_.camera().width_px();
  for (const int pixel : faults_.bad_pixels) {
    const int x = pixel % width - matte.x0_px(), y = pixel / width - matte.y0_px();
    if (x < 0 || x >= matte.width_px() || y < 0 || y >= matte.height_px()) continue;
    matte.flags(x, y) |= kFlagFilled;
    for (int c = 0; c < (matte.is_colourless() ? 1 : kChannels); ++c) {
      for (Mode& mode : matte.modes(x, y, c)) mode.weight_sd = mode.centre_sd_px = 0.0f;
    }
  }
}

absl::StatusOr<Matte> PreparedSolve::solve_in_bands(const FrameStack& stack, int thread_count,
                                                    std::stop_token stop,
                                                    const std::function<void(double)>& progress) const {
  const std::vector<int>& needed = frames_needed();
  GW_RETURN_IF_ERROR(check_rows(stack, manifest_, needed));
  if (stack.row_count == 0) {
    FrameStack none = stack;
    if (interpolated_) none.mosaic.reset();
    return method_->solve(linear_.of(std::move(none)));
  }
  const auto read = [&](int first, int count) -> absl::StatusOr<FrameStack> {
    return interpolated_ ? interpolated_rows(stack, needed, first, count)
                         : rows_of(stack, needed, first, count);
  };
  return solve_bands(stack.row_count, stack.column_step, read, thread_count, std::move(stop), progress);
}

absl::StatusOr<Matte> PreparedSolve::solve_in_bands(const ReadStack& read, const RowRange& rows,
                                                    int thread_count,
                                                    const std::function<void(double)>& progress) const {
  const int height = manifest_.camera().height_px(), margin = margin_rows();
  const int top = std::max(rows.first - margin, 0),
            bottom = std::min(rows.first + rows.count + margin, height);
  const auto read_band = [&](int first, int count) -> absl::StatusOr<FrameStack> {
    const int reach = interpolated_ ? kInterpolationReach : 0;
    const int begin = std::max(top + first - reach, 0), end = std::min(top + first + count + reach, height);
    GW_ASSIGN_OR_RETURN(FrameStack stack, read(begin, end - begin));
    GW_RETURN_IF_ERROR(check_rows(stack, manifest_, frames_needed()));
    if (!interpolated_) return stack;
    return interpolated_rows(stack, frames_needed(), top + first - begin, count);
  };
  GW_ASSIGN_OR_RETURN(Matte matte, solve_bands(bottom - top, 1, read_band, thread_count, {}, progress));
  return matte.height_px() == rows.count ? std::move(matte) : rows_of(matte, rows.first - top, rows.count);
}

absl::StatusOr<Matte> PreparedSolve::solve_bands(int row_count, int column_step, const ReadStack& read,
                                                 int thread_count, std::stop_token stop,
                                                 const std::function<void(double)>& progress) const {
  if (thread_count <= 0) thread_count = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  // Small enough that the last bands keep all threads busy, large enough to amortise a solver's set-up.
  const int band_rows = thread_count == 1 ? 16 : std::clamp(row_count / (8 * thread_count), 2, 16);
  const int band_count = (row_count + band_rows - 1) / band_rows;
  // Every so-manyth column alone cannot be filled or moved: drafts are not.
  const bool fills = column_step == 1 && !faults_.bad_pixels.empty();
  const int moved =
      column_step == 1 ? registration_reach(faults_.corrections.get(), manifest_.camera().width_px()) : 0;
  const int reach = moved + (fills ? filled_reach(!manifest_.camera().mosaic().empty()) : 0);
  std::vector<std::optional<absl::StatusOr<Matte>>> bands(band_count);
  std::atomic<int> next = 0, done = 0;
  std::atomic<bool> failed = false;
  const auto work = [&] {
    for (int band = next++; band < band_count && !failed && !stop.stop_requested(); band = next++) {
      const int first = band * band_rows;
      auto& solved = bands[band];
      solved = [&]() -> absl::StatusOr<Matte> {
        const int count = std::min(band_rows, row_count - first);
        const int begin = std::max(first - reach, 0), end = std::min(first + count + reach, row_count);
        GW_ASSIGN_OR_RETURN(FrameStack rows, read(begin, end - begin));
        rows.corrections = faults_.corrections;
        rows.stage_maps = stage_maps_;
        rows = linear_.of(std::move(rows));
        if (fills) rows = filled_rows(rows, faults_.bad_pixels);
        return method_->solve(moved > 0 ? registered_rows(rows, *faults_.corrections, first - begin, count)
                                        : rows_of(rows, frames_needed(), first - begin, count));
      }();
      if (!solved->ok()) failed = true;
      ++done;
      if (progress) progress(static_cast<double>(done) / band_count);
    }
  };
  {
    std::vector<std::jthread> threads;
    for (int t = 1; t < std::min(thread_count, band_count); ++t) threads.emplace_back(work);
    work();
  }
  for (const auto& band : bands) {
    if (band && !band->ok()) return band->status();
  }
  if (stop.stop_requested()) return absl::CancelledError("solving was stopped");
  const Matte& first = **bands.front();
  Matte whole(first.x0_px(), first.y0_px(), first.width_px(), row_count, first.modes_per_channel());
  whole.metadata = first.metadata;
  linear_.describe(whole.metadata);
  for (const std::string& warning : faults_.warnings) whole.metadata.add_warnings(warning);
  if (stage_maps_ != nullptr) {
    for (const std::string& warning : stage_maps_->warnings) whole.metadata.add_warnings(warning);
  }
  for (const auto& band : bands) whole.put(**band);
  remove_fall_off(shading_, column_step, whole);
  if (interpolated_) {
    whole.metadata.add_warnings(
        "the sensor measures one colour at each pixel, and the others were interpolated before solving, "
        "which mixes neighbours' light; method gaussian solves what was measured");
  } else if (const std::optional<Mosaic> mosaic = mosaic_of(manifest_.camera())) {
    whole.metadata.set_mosaic(manifest_.camera().mosaic());
    fill_channels(whole, *mosaic, thread_count);
  }
  if (column_step == 1) {
    flag_bad_pixels(whole);
    flag_disturbed(faults_.disturbance, whole);
  }
  round_to_errors(whole);
  return whole;
}

absl::StatusOr<Matte> solve_in_bands(const Method& method, const v1::CaptureManifest& manifest,
                                     const FrameStack& stack, int thread_count, std::stop_token stop,
                                     const std::function<void(double)>& progress) {
  GW_ASSIGN_OR_RETURN(PreparedSolve prepared, PreparedSolve::create(method, manifest));
  if (stack.row_count == manifest.camera().height_px()) {
    const auto read = [&](int row, const std::vector<int>& frames) {
      const size_t count = shape_of(manifest.camera()).row_samples();
      std::vector<std::uint16_t> samples;
      for (const int frame : frames) {
        const auto own = stack.rows[frame].subspan(static_cast<size_t>(row) * count, count);
        samples.insert(samples.end(), own.begin(), own.end());
      }
      return absl::StatusOr<std::vector<std::uint16_t>>(std::move(samples));
    };
    GW_RETURN_IF_ERROR(prepared.map_stage(read, stack.brightness));
  }
  return prepared.solve_in_bands(stack, thread_count, std::move(stop), progress);
}

absl::StatusOr<Matte> solve_archive(const Method& method, const MappedArchive& archive, int thread_count,
                                    const std::function<void(double)>& progress, bool correct,
                                    const std::optional<RowRange>& rows) {
  const v1::CaptureManifest& manifest = archive.manifest();
  const RowReader read_row = rows_of(archive);
  GW_ASSIGN_OR_RETURN(const auto brightness, measure_brightness_drift(manifest, read_row));
  GW_ASSIGN_OR_RETURN(PreparedSolve prepared, PreparedSolve::create(method, manifest));
  GW_RETURN_IF_ERROR(prepared.map_stage(read_row, brightness, correct));
  const auto read = [&](int first_row, int row_count) -> absl::StatusOr<FrameStack> {
    FrameStack stack{.width_px = manifest.camera().width_px(),
                     .first_row = first_row,
                     .row_count = row_count,
                     .rows = {},
                     .owner = nullptr,
                     .brightness = brightness,
                     .mosaic = mosaic_of(manifest.camera())};
    stack.rows.resize(manifest.frames_size());
    const auto owner = std::make_shared<std::vector<FrameSamples>>();
    for (const int frame : prepared.frames_needed()) {
      GW_ASSIGN_OR_RETURN(FrameSamples own, archive.read(frame, first_row, row_count));
      stack.rows[frame] = own.samples;
      owner->push_back(std::move(own));
    }
    stack.owner = owner;
    return stack;
  };
  const RowRange all{.first = 0, .count = manifest.camera().height_px()};
  return prepared.solve_in_bands(read, rows.value_or(all), thread_count, progress);
}

absl::StatusOr<FrameFaults> faults_of_archive(const Method& method, const MappedArchive& archive) {
  const RowReader read_row = rows_of(archive);
  GW_ASSIGN_OR_RETURN(const auto brightness, measure_brightness_drift(archive.manifest(), read_row));
  GW_ASSIGN_OR_RETURN(PreparedSolve prepared, PreparedSolve::create(method, archive.manifest()));
  GW_RETURN_IF_ERROR(prepared.map_stage(read_row, brightness));
  return prepared.faults();
}

}  // namespace glasswing
