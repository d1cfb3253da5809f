#include "compositing/edit/reshape.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>
#include <vector>

#include "core/base/for_rows.h"
#include "core/base/status.h"
#include "core/footprint/mode_reduction.h"
#include "core/frame/archive.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

// Modes collected before they are reduced to half: the time for that grows with their square.
constexpr size_t kMaxCollected = 64;

// "RGGB" of a picture that begins (dx, dy) sites later.
void shift_mosaic(v1::MatteMetadata& metadata, int dx, int dy) {
  const std::string before = metadata.mosaic();
  if (before.size() != 4) return;
  std::string& now = *metadata.mutable_mosaic();
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 2; ++x) now[2 * y + x] = before[2 * ((y + dy) & 1) + ((x + dx) & 1)];
  }
}

// The shares of a line's pixels that fall into each pixel of a line of different length; shares sum to 1.
struct Share {
  int from = 0;
  float share = 0.0f;
};
std::vector<std::vector<Share>> shares_of(int from_px, int to_px) {
  std::vector<std::vector<Share>> shares(to_px);
  const double scale = static_cast<double>(from_px) / to_px;
  for (int to = 0; to < to_px; ++to) {
    const double begin = to * scale, end = (to + 1) * scale;
    for (int from = static_cast<int>(begin); from < std::min<double>(end, from_px); ++from) {
      const double overlap = std::min<double>(end, from + 1) - std::max<double>(begin, from);
      if (overlap > 1e-9 * scale) shares[to].push_back({from, static_cast<float>(overlap / scale)});
    }
  }
  return shares;
}

// The mean of several pixels.
class Mean {
 public:
  Mean(const Matte& matte, int max_modes)
      : matte_(matte), boxes_(matte.metadata.footprint() == kBoxFootprint), max_modes_(max_modes) {}

  // Sets a pixel of `out`; returns the maximum number of modes of a channel.
  int put(const std::vector<Share>& columns, const std::vector<Share>& rows, Matte& out, int x, int y) {
    for (const Share& row : rows) {
      for (const Share& column : columns) {
        const float share = row.share * column.share;
        out.coverage(x, y) += share * matte_.coverage(column.from, row.from);
        out.flags(x, y) |= matte_.flags(column.from, row.from);
        for (size_t c = 0; c < kChannels; ++c)
          out.foreground(x, y)[c] += share * matte_.foreground(column.from, row.from)[c];
      }
    }
    int count = 1;
    for (int c = 0; c < (matte_.is_colourless() ? 1 : kChannels); ++c) {
      collect(columns, rows, c);
      std::ranges::copy(modes_, out.modes(x, y, c).begin());
      count = std::max(count, static_cast<int>(modes_.size()));
    }
    return count;
  }

 private:
  void collect(const std::vector<Share>& columns, const std::vector<Share>& rows, int channel) {
    modes_.clear();
    for (const Share& row : rows) {
      for (const Share& column : columns) {
        for (const Mode& mode : matte_.modes(column.from, row.from, channel)) {
          if (mode.weight > 0.0f) modes_.push_back(scaled(mode, row.share * column.share));
        }
        if (modes_.size() > kMaxCollected) reduce_modes(modes_, kMaxCollected / 2, boxes_);
      }
    }
    reduce_modes(modes_, max_modes_, boxes_);
  }

  const Matte& matte_;
  const bool boxes_;
  const int max_modes_;
  std::vector<Mode> modes_;
};

}  // namespace

absl::StatusOr<Matte> crop_matte(std::string_view file, const MatteRegion& region) {
  GW_ASSIGN_OR_RETURN(const MatteOutline outline, outline_of(file));
  GW_RETURN_IF_ERROR(check_region(region, outline.width_px, outline.height_px));
  Matte part(0, 0, region.width_px, region.height_px, outline.modes_per_channel, outline.colourless);
  GW_RETURN_IF_ERROR(for_blocks_of_matte(
      file, 1,
      [&](const Matte& rows) {
        for (int row = 0; row < rows.height_px(); ++row) {
          const int y = rows.y0_px() - outline.y0_px + row - region.y_px;
          if (y < 0 || y >= region.height_px) continue;
          for (int x = 0; x < region.width_px; ++x) part.copy_pixel(rows, region.x_px + x, row, x, y);
        }
        return absl::OkStatus();
      },
      Pyramids::kKept));
  part.metadata = outline.metadata;
  part.metadata.set_width_px(region.width_px);
  part.metadata.set_height_px(region.height_px);
  shift_mosaic(part.metadata, region.x_px, region.y_px);
  return part;
}

Matte flipped(const Matte& matte, bool upside_down) {
  Matte out(0, 0, matte.width_px(), matte.height_px(), matte.modes_per_channel(), matte.is_colourless());
  out.metadata = matte.metadata;
  shift_mosaic(out.metadata, upside_down ? 0 : matte.width_px() - 1, upside_down ? matte.height_px() - 1 : 0);
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      out.copy_pixel(matte, x, y, upside_down ? x : matte.width_px() - 1 - x,
                     upside_down ? matte.height_px() - 1 - y : y);
    }
  }
  return out;
}

absl::StatusOr<Matte> resized(const Matte& matte, int width_px, int height_px, int max_modes,
                              int thread_count) {
  for (const auto& [name, side] : {std::pair{"width", width_px}, std::pair{"height", height_px}}) {
    if (side < 1 || side > kMaxSide_px)
      return absl::InvalidArgumentError(
          fmt::format("the {} is {} px; it must be 1 to {}", name, side, kMaxSide_px));
  }
  const int monitors = matte.metadata.monitors_size();
  if (max_modes < monitors || max_modes < 1 || max_modes > kMaxModes) {
    return absl::InvalidArgumentError(
        fmt::format("{} modes are requested; a matte with {} monitors has {} to {}", max_modes, monitors,
                    std::max(1, monitors), kMaxModes));
  }
  const auto columns = shares_of(matte.width_px(), width_px), rows = shares_of(matte.height_px(), height_px);
  Matte wide(0, 0, width_px, height_px, max_modes, matte.is_colourless());
  std::atomic<int> most = 1;
  for_rows(height_px, thread_count, [&](int first, int end) {
    Mean mean(matte, max_modes);
    int own = 1;
    for (int y = first; y < end; ++y) {
      for (int x = 0; x < width_px; ++x) {
        own = std::max(own, mean.put(columns[x], rows[y], wide, x, y));
      }
    }
    for (int before = most; before < own && !most.compare_exchange_weak(before, own);) {
    }
  });
  wide.metadata = matte.metadata;
  Matte out = with_places(wide, most, wide.is_colourless());
  out.metadata.set_width_px(width_px);
  out.metadata.set_height_px(height_px);
  out.metadata.clear_sweeps();
  out.metadata.clear_lit_pictures();
  out.metadata.clear_mixture();
  out.metadata.clear_mosaic();
  return out;
}

}  // namespace glasswing
