#include "solver/worker/tile_solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <future>
#include <thread>

#include "core/base/status.h"
#include "core/matte/matte_file.h"
#include "core/service/message_limits.h"
#include "solver/method/brightness_drift.h"
#include "solver/methods.h"
#include "solver/mosaic/mosaic_matte.h"
#include "solver/worker/solver_metrics.h"
#include "solver/worker/sparse_solve.h"
#include "solver/worker/video_solve.h"

namespace glasswing {
namespace {

MethodOptions options_of(const v1::ClaimTileResponse& tile) {
  return {tile.options().begin(), tile.options().end()};
}

std::vector<std::string> addresses_of(const v1::ClaimTileResponse& tile) {
  std::vector<std::string> addresses = {tile.archive_address()};
  addresses.insert(addresses.end(), tile.copy_addresses().begin(), tile.copy_addresses().end());
  return addresses;
}

absl::StatusOr<SolvedTile> solve_frames(const v1::ClaimTileResponse& tile, const SolveSource& source,
                                        int thread_count, std::stop_token stop) {
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<VideoMethod> method,
                      make_video_method(tile.method(), options_of(tile)));
  if (method == nullptr)
    return absl::InvalidArgumentError(fmt::format("method \"{}\" does not solve videos", tile.method()));
  const v1::CaptureManifest& manifest = source.manifest();
  const auto read = [&](int frame) {
    return source.archive().samples(manifest, {frame}, 0, manifest.camera().height_px());
  };
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<VideoSource> video,
                      read_ahead(manifest, tile.first_frame(), tile.frame_count(), read));
  SolvedTile solved;
  // A matte is encoded while the next one is solved: one at a time, so that only one more is in memory.
  std::future<absl::StatusOr<std::string>> encoded;
  int encoding = 0;  // its frame
  const auto take_encoded = [&]() -> absl::Status {
    if (!encoded.valid()) return absl::OkStatus();
    absl::StatusOr<std::string> bytes = encoded.get();
    if (!bytes.ok()) return in_frame(encoding, bytes.status());
    solved.files.push_back({.frame = encoding, .bytes = *std::move(bytes)});
    return absl::OkStatus();
  };
  const auto refuse = [&](int frame, const absl::Status& why) {
    v1::RefusedFrame& refused = solved.refused.emplace_back();
    refused.set_frame(frame);
    refused.set_error(fitted(std::string(why.message())));
    return absl::OkStatus();
  };
  GW_RETURN_IF_ERROR(solve_video(*method, *video, tile.first_frame(), tile.frame_count(), thread_count, stop,
                                 [&](int frame, absl::StatusOr<Matte> matte) {
                                   if (!matte.ok()) return refuse(frame, matte.status());
                                   solved.pixels += count_pixels(*matte);
                                   const absl::Status taken = take_encoded();
                                   encoding = frame;
                                   encoded = std::async(std::launch::async, [of = *std::move(matte)] {
                                     return encode_matte(of);
                                   });
                                   return taken;
                                 }));
  GW_RETURN_IF_ERROR(take_encoded());
  return solved;
}

// A survey solves one column in so many: methods solve each pixel by itself, so the time scales with columns.
// Odd, so that the columns have all colours of a mosaic.
constexpr int kSurveyColumnStep = 5, kMinSurveyColumns = 64;

FrameStack some_columns(const FrameStack& row) {
  return row.width_px < kSurveyColumnStep * kMinSurveyColumns ? row : every_column(row, kSurveyColumnStep);
}

}  // namespace

absl::Status keep_steps(const google::protobuf::RepeatedField<std::int32_t>& rising,
                        v1::CaptureManifest& manifest) {
  auto& frames = *manifest.mutable_frames();
  frames.erase(std::remove_if(frames.begin(), frames.end(),
                              [&](const v1::Frame& frame) {
                                return !std::binary_search(rising.begin(), rising.end(), frame.step());
                              }),
               frames.end());
  if (frames.size() == rising.size()) return absl::OkStatus();
  return absl::FailedPreconditionError(
      fmt::format("the archive has frames of {} of the {} steps of the draft", frames.size(), rising.size()));
}

SolveSource::SolveSource(const v1::ClaimTileResponse& tile, std::stop_token stop)
    : archive_(addresses_of(tile), tile.lease().session(), std::move(stop)) {}

absl::StatusOr<std::shared_ptr<const SolveSource>> SolveSource::open(const v1::ClaimTileResponse& tile,
                                                                     std::stop_token stop) {
  std::shared_ptr<SolveSource> source(new SolveSource(tile, std::move(stop)));
  GW_ASSIGN_OR_RETURN(source->manifest_, source->archive_.manifest());
  if (tile.has_draft()) GW_RETURN_IF_ERROR(keep_steps(tile.draft_steps(), source->manifest_));
  const auto read = [&](int row, const std::vector<int>& frames) {
    return source->archive_.samples(source->manifest_, frames, row, 1);
  };
  if (tile.frame_count() > 0) return source;
  GW_ASSIGN_OR_RETURN(source->brightness_, measure_brightness_drift(source->manifest_, read));
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<Method> method, make_method(tile.method(), options_of(tile)));
  GW_ASSIGN_OR_RETURN(source->prepared_, PreparedSolve::create(*method, source->manifest_));
  GW_RETURN_IF_ERROR(source->prepared_->map_stage(read, source->brightness_));
  return source;
}

absl::StatusOr<ReadStack> SolveSource::stack(int first_row, int row_count) const {
  ReadStack read;
  FrameStack& stack = read.stack;
  stack = {.width_px = manifest_.camera().width_px(),
           .first_row = first_row,
           .row_count = row_count,
           .rows = {},
           .owner = nullptr,
           .brightness = brightness_,
           .mosaic = mosaic_of(manifest_.camera())};
  const std::vector<int>& needed = prepared_->frames_needed();
  GW_ASSIGN_OR_RETURN(read.rows, archive_.rows(manifest_, needed, first_row, row_count));
  stack.owner = read.rows.owner;
  stack.rows.resize(manifest_.frames_size());
  for (size_t i = 0; i < needed.size(); ++i) stack.rows[needed[i]] = read.rows.rows[i];
  return read;
}

absl::StatusOr<TileInHand> TileInHand::read(const v1::ClaimTileResponse& tile,
                                            std::shared_ptr<const SolveSource> source) {
  TileInHand in_hand;
  in_hand.tile_ = tile;
  in_hand.source_ = std::move(source);
  if (in_hand.source_->prepared() == nullptr) return in_hand;
  const int margin = in_hand.source_->prepared()->margin_rows();
  const int first = std::max(tile.first_row() - margin, 0);
  const int end = std::min(tile.first_row() + tile.row_count() + margin,
                           in_hand.source_->manifest().camera().height_px());
  GW_ASSIGN_OR_RETURN(in_hand.read_, in_hand.source_->stack(first, end - first));
  return in_hand;
}

absl::StatusOr<SolvedTile> TileInHand::solve(int thread_count, std::stop_token stop) const {
  const BusyTime busy;
  const PreparedSolve* prepared = source_->prepared();
  if (prepared == nullptr) return solve_frames(tile_, *source_, thread_count, std::move(stop));
  const int step = tile_.draft_pixel_step();
  GW_ASSIGN_OR_RETURN(Matte matte,
                      step > 1 ? solve_sparsely(*prepared, read_.stack, step, thread_count, std::move(stop))
                               : prepared->solve_in_bands(read_.stack, thread_count, std::move(stop)));
  if (matte.height_px() != tile_.row_count())
    matte = rows_of(matte, tile_.first_row() - read_.stack.first_row, tile_.row_count());
  GW_RETURN_IF_ERROR(read_.rows.intact());
  GW_RETURN_IF_ERROR(check_matte(matte));
  if (tile_.has_draft()) *matte.metadata.mutable_draft() = tile_.draft();
  if (step > 1) {
    matte.metadata.add_warnings(fmt::format(
        "a draft: one pixel in {} is solved, and the others are interpolated between those", step * step));
  }
  SolvedTile solved;
  solved.pixels += count_pixels(matte);
  GW_ASSIGN_OR_RETURN(std::string bytes, encode_matte(matte));
  solved.files.push_back({.frame = std::nullopt, .bytes = std::move(bytes)});
  return solved;
}

absl::StatusOr<std::vector<double>> survey(const v1::ClaimTileResponse& tile, const SolveSource& source,
                                           int thread_count, std::stop_token stop) {
  const BusyTime busy;
  const PreparedSolve* prepared = source.prepared();
  if (prepared == nullptr) return absl::InvalidArgumentError("a survey needs rows; this tile has frames");
  std::vector<double> seconds(tile.survey_rows_size());
  std::vector<absl::Status> failed(seconds.size());
  if (thread_count <= 0) thread_count = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  std::atomic<size_t> next = 0;
  const auto work = [&] {
    for (size_t i = next++; i < seconds.size() && !stop.stop_requested(); i = next++) {
      failed[i] = [&]() -> absl::Status {
        GW_ASSIGN_OR_RETURN(const ReadStack row, source.stack(tile.survey_rows(static_cast<int>(i)), 1));
        const FrameStack sampled = some_columns(row.stack);
        const auto start = std::chrono::steady_clock::now();
        GW_RETURN_IF_ERROR(prepared->solve_in_bands(sampled, 1, stop).status());
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
        seconds[i] = took.count() * row.stack.width_px / sampled.width_px / thread_count;
        return absl::OkStatus();
      }();
    }
  };
  {
    std::vector<std::jthread> threads;
    for (int t = 1; t < thread_count; ++t) threads.emplace_back(work);
    work();
  }
  if (stop.stop_requested()) return absl::CancelledError("solving was stopped");
  for (const absl::Status& status : failed) GW_RETURN_IF_ERROR(status);
  return seconds;
}

}  // namespace glasswing
