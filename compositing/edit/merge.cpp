#include "compositing/edit/merge.h"

#include <fmt/format.h>
#include <google/protobuf/util/message_differencer.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/base/status.h"
#include "core/footprint/mode_reduction.h"

namespace glasswing {
namespace {

constexpr float kNear_px = 4.0f;  // of centres, as for light paths

template <class Messages>
bool are_equal(const Messages& a, const Messages& b) {
  return std::ranges::equal(a, b, [](const auto& one, const auto& other) {
    return google::protobuf::util::MessageDifferencer::Equals(one, other);
  });
}

std::string footprint_of(const Matte& matte) {
  return matte.metadata.footprint().empty() ? "gaussian" : matte.metadata.footprint();
}

absl::Status check_alike(const Matte& front, const Matte& back) {
  const auto refuse = [](std::string_view what) {
    return absl::InvalidArgumentError(fmt::format(
        "the mattes differ in {}; both must be from one camera in front of the same monitors", what));
  };
  if (front.width_px() != back.width_px() || front.height_px() != back.height_px()) {
    return refuse(fmt::format("size, {}x{} and {}x{}", front.width_px(), front.height_px(), back.width_px(),
                              back.height_px()));
  }
  const v1::MatteMetadata &a = front.metadata, &b = back.metadata;
  if (!std::ranges::equal(a.monitors(), b.monitors(), [](const v1::Monitor& one, const v1::Monitor& other) {
        return one.name() == other.name() && one.width_px() == other.width_px() &&
               one.height_px() == other.height_px();
      }))
    return refuse("their monitors' names or sizes");
  if (footprint_of(front) != footprint_of(back))
    return refuse(fmt::format("footprint, {} and {}", footprint_of(front), footprint_of(back)));
  if (!are_equal(a.crosstalk(), b.crosstalk())) return refuse("crosstalk of camera and monitors");
  if (a.linearised() != b.linearised()) return refuse("calibration: one contains light, the other codes");
  return absl::OkStatus();
}

class Merge {
 public:
  Merge(const Matte& front, const Matte& back)
      : front_(front), back_(back), boxes_(front.metadata.footprint() == kBoxFootprint) {
    find_free();
  }

  // The modes of a pixel that both cover, or back and the light that passes beside front.
  void collect(int x, int y, int channel, std::vector<Mode>& modes) const {
    const float beside = 1.0f - front_.coverage(x, y);
    modes.clear();
    for (const Mode& mode : front_.modes(x, y, channel)) {
      if (mode.weight > 0.0f) modes.push_back(mode);
    }
    remove_what_passes_beside(x, y, channel, beside, modes);
    for (const Mode& mode : back_.modes(x, y, channel)) {
      if (mode.weight > 0.0f) modes.push_back(scaled(mode, beside));
    }
    reduce_modes(modes, kMaxModes, boxes_);
  }
  // Whether the light that passes beside it is known.
  bool is_known(int x, int y) const { return free_[index(x, y)] != kNone; }

 private:
  static constexpr size_t kNone = std::numeric_limits<size_t>::max();

  size_t index(int x, int y) const { return static_cast<size_t>(y) * front_.width_px() + x; }

  // For each pixel, the nearest one that front leaves free, counted in steps to the four neighbours.
  void find_free() {
    const int width = front_.width_px(), height = front_.height_px();
    free_.assign(static_cast<size_t>(width) * height, kNone);
    std::vector<size_t> rim, next;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        if (front_.coverage(x, y) > 0.0f || (front_.flags(x, y) & kFlagNoData) != 0) continue;
        free_[index(x, y)] = index(x, y);
        rim.push_back(index(x, y));
      }
    }
    for (; !rim.empty(); rim.swap(next)) {
      next.clear();
      for (const size_t at : rim) {
        const auto i = static_cast<int>(at);
        const int x = i % width, y = i / width;
        for (const auto& [u, v] : {std::pair{x - 1, y}, {x + 1, y}, {x, y - 1}, {x, y + 1}}) {
          if (u < 0 || u >= width || v < 0 || v >= height || free_[index(u, v)] != kNone) continue;
          free_[index(u, v)] = free_[at];
          next.push_back(index(u, v));
        }
      }
    }
  }

  void remove_what_passes_beside(int x, int y, int channel, float beside, std::vector<Mode>& modes) const {
    const auto free = static_cast<int>(free_[index(x, y)]);
    const int width = front_.width_px();
    for (const Mode& bare : front_.modes(free % width, free / width, channel)) {
      if (!(bare.weight > 0.0f)) continue;
      const auto unlike = [&](const Mode& mode) {
        if (mode.texture != bare.texture) return std::numeric_limits<float>::infinity();
        const float wide = kNear_px + std::sqrt(std::max(0.5f * (bare.xx_px2 + bare.yy_px2), 0.0f));
        return std::hypot(mode.x_px - bare.x_px, mode.y_px - bare.y_px) / wide +
               std::abs(mode.weight / (beside * bare.weight) - 1.0f);
      };
      const auto found = std::ranges::min_element(modes, {}, unlike);
      if (found != modes.end() && std::isfinite(unlike(*found))) modes.erase(found);
    }
  }

  const Matte &front_, &back_;
  const bool boxes_;
  std::vector<size_t> free_;
};

// The metadata of both; data that only one was fitted to is left out.
v1::MatteMetadata both(const v1::MatteMetadata& front, const v1::MatteMetadata& back) {
  v1::MatteMetadata metadata = front;
  if (!are_equal(front.sweeps(), back.sweeps()) || !are_equal(front.lit_pictures(), back.lit_pictures()) ||
      !google::protobuf::util::MessageDifferencer::Equals(front.mixture(), back.mixture())) {
    metadata.clear_sweeps();
    metadata.clear_lit_pictures();
    metadata.clear_mixture();
  }
  if (front.mosaic() != back.mosaic()) metadata.clear_mosaic();
  for (const std::string& warning : back.warnings()) {
    if (std::ranges::find(metadata.warnings(), warning) == metadata.warnings().end())
      metadata.add_warnings(warning);
  }
  return metadata;
}

}  // namespace

absl::StatusOr<Matte> merged(const Matte& front, const Matte& back) {
  GW_RETURN_IF_ERROR(check_alike(front, back));
  const bool colourless = front.is_colourless() && back.is_colourless();
  Matte out(0, 0, front.width_px(), front.height_px(), kMaxModes, colourless);
  out.metadata = both(front.metadata, back.metadata);
  const Merge merge(front, back);
  std::vector<Mode> modes;
  int count = 1;
  for (int y = 0; y < out.height_px(); ++y) {
    for (int x = 0; x < out.width_px(); ++x) {
      const float alpha = front.coverage(x, y), behind = back.coverage(x, y);
      const bool mixes = alpha > 0.0f && alpha < 1.0f && behind > 0.0f && merge.is_known(x, y);
      const Matte& one = alpha > 0.0f ? front : back;
      out.coverage(x, y) = alpha + (1.0f - alpha) * behind;
      out.flags(x, y) = one.flags(x, y);
      out.foreground(x, y) = one.foreground(x, y);
      if (mixes) {
        out.flags(x, y) |= back.flags(x, y);
        for (size_t c = 0; c < kChannels; ++c)
          out.foreground(x, y)[c] += (1.0f - alpha) * back.foreground(x, y)[c];
      }
      for (int c = 0; c < (colourless ? 1 : kChannels); ++c) {
        if (mixes) {
          merge.collect(x, y, c, modes);
        } else {
          modes.assign(one.modes(x, y, c).begin(), one.modes(x, y, c).end());
          std::erase_if(modes, [](const Mode& mode) { return !(mode.weight > 0.0f); });
        }
        std::ranges::copy(modes, out.modes(x, y, c).begin());
        count = std::max(count, static_cast<int>(modes.size()));
      }
    }
  }
  return with_places(out, count, colourless);
}

}  // namespace glasswing
