#include "core/matte/fast_compositor.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <mutex>

#include "core/base/for_rows.h"
#include "core/base/status.h"
#include "core/matte/compositor.h"
#include "core/matte/footprint_tiles.h"
#include "core/matte/summed_area_table.h"

namespace glasswing {
namespace {

constexpr size_t kMaxBytes = size_t{2} << 30;
constexpr int kMaxTiles = 1024, kMinTiles = 4;

bool is_same(const Mode& a, const Mode& b) {
  return a.weight == b.weight && a.x_px == b.x_px && a.y_px == b.y_px && a.xx_px2 == b.xx_px2 &&
         a.xy_px2 == b.xy_px2 && a.yy_px2 == b.yy_px2 && a.texture == b.texture;
}

}  // namespace

// Prepares rows of one matte; one per thread.
class FastCompositor::Preparation {
 public:
  Preparation(const Matte& matte, const std::vector<Texture>& textures, int max_tiles)
      : matte_(matte), boxes_(matte.metadata.footprint() == kBoxFootprint) {
    for (const Texture& texture : textures) tiles_.emplace_back(texture.shape, max_tiles);
    wide_.resize(textures.size());
  }

  Row prepare(int y) {
    Row row;
    row.tiles.resize(static_cast<size_t>(matte_.width_px()));
    for (int x = 0; x < matte_.width_px(); ++x) {
      const auto& foreground = matte_.foreground(x, y);
      row.foreground.insert(row.foreground.end(), foreground.begin(), foreground.end());
      PixelTiles& pixel = row.tiles[static_cast<size_t>(x)];
      const auto modes = [&](int c, size_t m) -> const Mode& { return matte_.modes(x, y, c)[m]; };
      const auto count = static_cast<size_t>(matte_.modes_per_channel());
      const auto is_shared = [&](size_t m) {
        return is_same(modes(0, m), modes(1, m)) && is_same(modes(0, m), modes(2, m));
      };
      for (size_t m = 0; m < count; ++m) {
        if (is_shared(m)) pixel.shared += add(modes(0, m), 0, true, x, row);
      }
      for (int c = 0; c < kChannels; ++c) {
        for (size_t m = 0; m < count; ++m) {
          if (!is_shared(m)) pixel.own[c] += add(modes(c, m), c, false, x, row);
        }
      }
    }
    row.words.resize(row.words.size() + kTileWidth);  // padding that evaluate_tiles() may read
    row.words.shrink_to_fit();
    return row;
  }

  void report(std::vector<Texture>& textures) const {
    for (size_t t = 0; t < textures.size(); ++t) {
      textures[t].level_count = std::max(textures[t].level_count, tiles_[t].highest_level() + 1);
      textures[t].has_wide_boxes = textures[t].has_wide_boxes || wide_[t];
    }
  }

 private:
  std::uint16_t add(const Mode& mode, int channel, bool shared, int x, Row& row) {
    const auto texture = static_cast<size_t>(mode.texture);
    if (!(mode.weight > 0.0f) || texture >= tiles_.size()) return 0;
    FootprintTiles& tiles = tiles_[texture];
    if (!boxes_) return static_cast<std::uint16_t>(tiles.add(mode, channel, row.words));
    if (FootprintTiles::is_small_box(mode))
      return static_cast<std::uint16_t>(tiles.add_box(mode, channel, row.words));
    const auto side = [](float variance) { return std::sqrt(12.0f * std::max(variance, 0.0f)); };
    WideBox box{.pixel = x,
                .texture = mode.texture,
                .x_px = mode.x_px,
                .y_px = mode.y_px,
                .width_px = side(mode.xx_px2),
                .height_px = side(mode.yy_px2)};
    if (shared) {
      box.weight.fill(mode.weight);
    } else {
      box.weight[static_cast<size_t>(channel)] = mode.weight;
    }
    row.boxes.push_back(box);
    wide_[texture] = true;
    return 0;
  }

  const Matte& matte_;
  const bool boxes_;
  std::vector<FootprintTiles> tiles_;  // by texture
  std::vector<bool> wide_;
};

absl::StatusOr<FastCompositor> FastCompositor::create(const Matte& matte, int thread_count,
                                                      const std::function<void(double)>& progress) {
  GW_ASSIGN_OR_RETURN(PrimaryMix mix, PrimaryMix::create(matte.metadata));
  FastCompositor made(matte.metadata, std::move(mix));
  made.width_px_ = matte.width_px();
  size_t end = 0;
  for (const v1::Monitor& monitor : matte.metadata.monitors()) {
    made.textures_.push_back({.shape = PyramidShape(monitor.width_px(), monitor.height_px(), end)});
    end = made.textures_.back().shape.end();
  }
  for (int max_tiles = kMaxTiles;; max_tiles /= 4) {
    made.rows_.clear();
    made.rows_.resize(static_cast<size_t>(matte.height_px()));
    std::atomic<int> next_row = 0;
    std::atomic<size_t> bytes = 0;
    std::mutex mutex;
    const bool must_fit = max_tiles > kMinTiles;
    for_rows(std::max(1, matte.height_px()), thread_count, [&](int first, int) {
      Preparation preparation(matte, made.textures_, max_tiles);
      for (int y = next_row++; y < matte.height_px(); y = next_row++) {
        Row& row = made.rows_[static_cast<size_t>(y)] = preparation.prepare(y);
        bytes += 2 * row.words.size();
        if (must_fit && bytes > kMaxBytes) return;
        if (first == 0 && progress) progress(static_cast<double>(y + 1) / matte.height_px());
      }
      const std::lock_guard lock(mutex);
      preparation.report(made.textures_);
    });
    if (!must_fit || bytes <= kMaxBytes) return made;
  }
}

absl::StatusOr<RadianceImage> FastCompositor::composite(const std::vector<RadianceImage>& backgrounds,
                                                        int thread_count) const {
  GW_RETURN_IF_ERROR(check_backgrounds(metadata_, backgrounds));
  const size_t sample_count = textures_.empty() ? 0 : textures_.back().shape.end();
  const auto samples = std::make_unique_for_overwrite<float[]>(sample_count + kTileWidth);
  std::vector<FastSummedAreaTable> tables;
  for (size_t t = 0; t < textures_.size(); ++t) {
    const Texture& texture = textures_[t];
    const RadianceImage* const picture =
        t < backgrounds.size() && !backgrounds[t].empty() ? &backgrounds[t] : nullptr;
    if (picture != nullptr) {
      fill_pyramid(*picture, mix_, static_cast<int>(t), texture.shape, texture.level_count, thread_count,
                   samples.get());
    } else {
      std::fill(samples.get() + texture.shape.levels().front().offset, samples.get() + texture.shape.end(),
                0.0f);
    }
    tables.emplace_back(texture.has_wide_boxes && picture != nullptr ? *picture : RadianceImage(),
                        thread_count);
  }
  RadianceImage out(width_px_, static_cast<int>(rows_.size()));
  std::atomic<int> next_row = 0;
  for_rows(std::max(1, out.height_px), thread_count, [&](int, int) {
    for (int y = next_row++; y < out.height_px; y = next_row++) {
      const Row& row = rows_[static_cast<size_t>(y)];
      float* const light = out.samples.data() + out.index(0, y, 0);
      std::ranges::copy(row.foreground, light);
      evaluate_tiles(row.tiles, row.words.data(), samples.get(), light);
      for (const WideBox& box : row.boxes) {
        const FastSummedAreaTable::Light seen =
            tables[static_cast<size_t>(box.texture)].mean(box.x_px, box.y_px, box.width_px, box.height_px);
        for (size_t c = 0; c < kChannels; ++c)
          light[3 * static_cast<size_t>(box.pixel) + c] += box.weight[c] * seen[c];
      }
      if (mix_.is_unit()) continue;
      for (size_t i = 0; i < row.foreground.size(); i += 3)
        std::ranges::copy(mix_.primaries({light[i], light[i + 1], light[i + 2]}), light + i);
    }
  });
  return out;
}

size_t FastCompositor::size_bytes() const {
  size_t bytes = 0;
  for (const Row& row : rows_) {
    bytes += row.foreground.size() * sizeof(float) + row.tiles.size() * sizeof(PixelTiles) +
             row.words.size() * sizeof(std::uint16_t) + row.boxes.size() * sizeof(WideBox);
  }
  return bytes;
}

}  // namespace glasswing
