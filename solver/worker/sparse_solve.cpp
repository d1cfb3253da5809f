#include "solver/worker/sparse_solve.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr float kMaxShift_px = 8.0f;  // of a mode, from one pixel of the picture to the next

int mode_count(std::span<const Mode> modes) {
  return static_cast<int>(std::ranges::count_if(modes, [](const Mode& mode) { return mode.weight > 0.0f; }));
}

// From one solved pixel to the next, `step` pixels on.
bool is_smooth(const Mode& from, const Mode& to, int step) {
  const float far = kMaxShift_px * static_cast<float>(step);
  return from.weight > 0.0f && to.weight > 0.0f && from.texture == to.texture &&
         std::hypot(to.x_px - from.x_px, to.y_px - from.y_px) <= far;
}

// A pixel between solved ones: the nearest, and one beside it in a direction, `share` of the way there
// (negative: away from it).
struct Beside {
  int x = 0, y = 0;
  float share = 0.0f;
};

// Of `at`, in units of solved pixels; there are `count`. None: it is a solved one, or the only one.
std::optional<float> share_of(float at, int nearest, int count, int& beside) {
  const float off = at - static_cast<float>(nearest);
  if (off == 0.0f || count < 2) return std::nullopt;
  beside = off > 0.0f ? nearest + 1 : nearest - 1;
  if (beside >= 0 && beside < count) return std::abs(off);
  beside = off > 0.0f ? nearest - 1 : nearest + 1;
  return -std::abs(off);
}

void move_modes(const Matte& solved, int x, int y, const std::vector<Beside>& beside, int step,
                std::span<Mode> modes, int channel) {
  const std::span<const Mode> own = solved.modes(x, y, channel);
  for (const Beside& other : beside) {
    const std::span<const Mode> theirs = solved.modes(other.x, other.y, channel);
    if (mode_count(theirs) != mode_count(own)) continue;
    for (size_t m = 0; m < own.size(); ++m) {
      if (!is_smooth(own[m], theirs[m], step)) continue;
      modes[m].x_px += other.share * (theirs[m].x_px - own[m].x_px);
      modes[m].y_px += other.share * (theirs[m].y_px - own[m].y_px);
      modes[m].weight = std::max(modes[m].weight + other.share * (theirs[m].weight - own[m].weight), 0.0f);
    }
  }
}

}  // namespace

std::vector<int> sparse_rows(int row_count, int step) {
  std::vector<int> rows;
  for (int y = 0; y < row_count; y += step) rows.push_back(std::min(y + step / 2, row_count - 1));
  return rows;
}

FrameStack every_column(const FrameStack& stack, int step) {
  FrameStack some = stack;
  const int count = (stack.width_px + step - 1) / step;
  some.width_px = count;
  some.column_step = stack.column_step * step;
  const size_t pixel_samples = stack.samples_per_pixel();
  const auto samples = std::make_shared<std::vector<std::uint16_t>>();
  const size_t frame_samples = static_cast<size_t>(stack.row_count) * count * pixel_samples;
  samples->reserve(stack.rows.size() * frame_samples);
  for (std::span<const std::uint16_t>& frame : some.rows) {
    if (frame.empty()) continue;
    const size_t first = samples->size();
    for (int y = 0; y < stack.row_count; ++y) {
      for (int x = 0; x < count; ++x) {
        const auto pixel = frame.subspan(
            (static_cast<size_t>(y) * stack.width_px + static_cast<size_t>(x * step)) * pixel_samples,
            pixel_samples);
        samples->insert(samples->end(), pixel.begin(), pixel.end());
      }
    }
    frame = std::span(*samples).subspan(first, frame_samples);  // stays valid: enough was reserved
  }
  some.owner = samples;
  return some;
}

Matte spread(const Matte& solved, int width_px, int row_count, int step) {
  Matte whole(0, solved.y0_px(), width_px, row_count, solved.modes_per_channel(), solved.is_colourless());
  whole.metadata = solved.metadata;
  const std::vector<int> rows = sparse_rows(row_count, step);
  for (int y = 0; y < row_count; ++y) {
    const int v = y / step;
    const float below = static_cast<float>(y - rows[v]) / static_cast<float>(step);
    for (int x = 0; x < width_px; ++x) {
      const int u = std::min((x + step / 2) / step, solved.width_px() - 1);
      std::vector<Beside> beside;
      int next = 0;
      const float across = static_cast<float>(x) / static_cast<float>(step);
      if (const auto share = share_of(across, u, solved.width_px(), next))
        beside.push_back({.x = next, .y = v, .share = *share});
      if (const auto share = share_of(static_cast<float>(v) + below, v, solved.height_px(), next))
        beside.push_back({.x = u, .y = next, .share = *share});
      whole.copy_pixel(solved, u, v, x, y);
      for (int c = 0; c < (solved.is_colourless() ? 1 : kChannels); ++c)
        move_modes(solved, u, v, beside, step, whole.modes(x, y, c), c);
    }
  }
  return whole;
}

absl::StatusOr<Matte> solve_sparsely(const PreparedSolve& prepared, const FrameStack& stack, int step,
                                     int thread_count, std::stop_token stop) {
  const std::vector<int> rows = sparse_rows(stack.row_count, step);
  const auto row_samples = static_cast<size_t>(stack.width_px) * stack.samples_per_pixel();
  std::vector<absl::StatusOr<Matte>> solved(rows.size(), absl::CancelledError("solving was stopped"));
  std::atomic<size_t> next = 0;
  const auto work = [&] {
    for (size_t i = next++; i < rows.size() && !stop.stop_requested(); i = next++) {
      FrameStack row = stack;
      row.first_row = stack.first_row + rows[i];
      row.row_count = 1;
      for (std::span<const std::uint16_t>& frame : row.rows) {
        if (!frame.empty()) frame = frame.subspan(static_cast<size_t>(rows[i]) * row_samples, row_samples);
      }
      solved[i] = prepared.solve_in_bands(every_column(row, step), 1, stop);
    }
  };
  if (thread_count <= 0) thread_count = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  {
    std::vector<std::jthread> threads;
    for (int t = 1; t < std::min(thread_count, static_cast<int>(rows.size())); ++t)
      threads.emplace_back(work);
    work();
  }
  for (const absl::StatusOr<Matte>& row : solved) GW_RETURN_IF_ERROR(row.status());
  const Matte& first = *solved.front();
  Matte sparse(0, stack.first_row, first.width_px(), static_cast<int>(rows.size()), first.modes_per_channel(),
               first.is_colourless());
  sparse.metadata = first.metadata;
  for (size_t i = 0; i < rows.size(); ++i) {
    for (int x = 0; x < first.width_px(); ++x) sparse.copy_pixel(*solved[i], x, 0, x, static_cast<int>(i));
  }
  return spread(sparse, stack.width_px, stack.row_count, step);
}

}  // namespace glasswing
