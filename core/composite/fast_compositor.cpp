#include "core/composite/fast_compositor.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <span>

#include "core/base/for_rows.h"
#include "core/base/status.h"
#include "core/composite/compositor.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

constexpr size_t kMaxBytes = size_t{4} << 30;
constexpr int kMinTiles = 4;
constexpr int kBlockRows = 16;

bool has_boxes(const v1::MatteMetadata& metadata) {
  return metadata.footprint() == kBoxFootprint;
}

std::span<float> row_of(RadianceImage& picture, int y) {
  const size_t length = 3 * static_cast<size_t>(picture.width_px);
  return std::span(picture.samples).subspan(static_cast<size_t>(y) * length, length);
}

}  // namespace

absl::StatusOr<FastCompositor> FastCompositor::create(const v1::MatteMetadata& metadata, int width_px,
                                                      int height_px, ForBlocks for_blocks) {
  GW_ASSIGN_OR_RETURN(PrimaryMix mix, PrimaryMix::create(metadata));
  FastCompositor made(metadata, std::move(mix), width_px);
  for (int max_tiles = kMaxTiles;; max_tiles /= 4) {
    const bool must_fit = max_tiles > kMinTiles;
    made.rows_.assign(height_px, {});  // frees what did not fit
    std::atomic<size_t> bytes = 0;
    std::mutex mutex;
    const absl::Status converted = for_blocks([&](const Matte& matte, int first, int end, int to) {
      FootprintRows rows(made.textures_, has_boxes(metadata), max_tiles);
      FootprintRow row;
      for (int y = first; y < end; ++y, ++to) {
        rows.prepare(matte, y, row);
        bytes += row.size_bytes();
        if (must_fit && bytes > kMaxBytes) return absl::ResourceExhaustedError("the weights are too large");
        made.rows_[to] = row;  // a copy takes no more memory than it needs
      }
      const std::lock_guard lock(mutex);
      rows.report(made.textures_);
      return absl::OkStatus();
    });
    if (!must_fit || bytes <= kMaxBytes) {
      GW_RETURN_IF_ERROR(converted);
      return made;
    }
  }
}

absl::StatusOr<FastCompositor> FastCompositor::create(const Matte& matte, int thread_count) {
  return create(matte.metadata, matte.width_px(), matte.height_px(), [&](Convert convert) {
    std::atomic<int> next = 0;
    for_rows(matte.height_px(), thread_count, [&](int, int) {
      for (int first = next.fetch_add(kBlockRows); first < matte.height_px();
           first = next.fetch_add(kBlockRows)) {
        const int end = std::min(first + kBlockRows, matte.height_px());
        if (!convert(matte, first, end, first).ok()) return;
      }
    });
    return absl::OkStatus();
  });
}

absl::StatusOr<FastCompositor> FastCompositor::create(std::string_view file,
                                                      absl::FunctionRef<void(Matte&)> edit,
                                                      int thread_count) {
  GW_ASSIGN_OR_RETURN(const MatteOutline outline, outline_of(file));
  return create(outline.metadata, outline.width_px, outline.height_px, [&](Convert convert) {
    return for_blocks_of_matte(
        file, thread_count,
        [&](Matte& rows) {
          edit(rows);
          return convert(rows, 0, rows.height_px(), rows.y0_px() - outline.y0_px);
        },
        Pyramids::kKept);
  });
}

absl::StatusOr<RadianceImage> FastCompositor::composite(const std::vector<RadianceImage>& backgrounds,
                                                        int thread_count) const {
  GW_RETURN_IF_ERROR(check_backgrounds(metadata_, backgrounds));
  const BackgroundSamples samples(textures_, mix_, backgrounds, thread_count);
  RadianceImage out(width_px_, static_cast<int>(rows_.size()));
  std::atomic<int> next_row = 0;
  for_rows(std::max(1, out.height_px), thread_count, [&](int, int) {
    for (int y = next_row++; y < out.height_px; y = next_row++) samples.composite(rows_[y], row_of(out, y));
  });
  return out;
}

size_t FastCompositor::size_bytes() const {
  size_t bytes = 0;
  for (const FootprintRow& row : rows_) bytes += row.size_bytes();
  return bytes;
}

absl::StatusOr<RadianceImage> composite_file(std::string_view file,
                                             const std::vector<RadianceImage>& backgrounds,
                                             absl::FunctionRef<void(Matte&)> edit, int thread_count,
                                             const std::function<void(double)>& progress) {
  GW_ASSIGN_OR_RETURN(const MatteOutline outline, outline_of(file));
  GW_ASSIGN_OR_RETURN(const PrimaryMix mix, PrimaryMix::create(outline.metadata));
  GW_RETURN_IF_ERROR(check_backgrounds(outline.metadata, backgrounds));
  const bool boxes = has_boxes(outline.metadata),
             pyramids = outline.metadata.footprint() == kPyramidFootprint;
  std::vector<FootprintTexture> textures = footprint_textures(outline.metadata);
  for (FootprintTexture& texture : textures) {
    // The rows' needs are not known yet.
    texture.level_count = static_cast<int>(texture.shape.levels().size());
    texture.mesh_count = pyramids ? static_cast<int>(texture.shape.meshes().size()) : 0;
    texture.has_wide_boxes = boxes;
  }
  const BackgroundSamples samples(textures, mix, backgrounds, thread_count);
  RadianceImage out(outline.width_px, outline.height_px);
  std::mutex mutex;
  int done = 0;
  GW_RETURN_IF_ERROR(for_blocks_of_matte(
      file, thread_count,
      [&](Matte& matte) {
        edit(matte);
        FootprintRows rows(textures, boxes, kMaxTiles);
        FootprintRow row;
        for (int y = 0; y < matte.height_px(); ++y) {
          rows.prepare(matte, y, row);
          samples.composite(row, row_of(out, matte.y0_px() - outline.y0_px + y));
        }
        const std::lock_guard lock(mutex);
        done += matte.height_px();
        if (progress) progress(static_cast<double>(done) / outline.height_px);
        return absl::OkStatus();
      },
      Pyramids::kKept));
  return out;
}

}  // namespace glasswing
