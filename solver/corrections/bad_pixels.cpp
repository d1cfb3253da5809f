#include "solver/corrections/bad_pixels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <map>

#include "core/base/median.h"
#include "core/base/status.h"
#include "core/pattern/stimulus_kind.h"
#include "solver/background/stage_layout.h"
#include "solver/method/exposure_merge.h"

namespace glasswing {
namespace {

constexpr size_t kMaxFrames = 5;
constexpr double kBeyond = 8.0, kFarBeyond = 20.0;  // standard deviations: in two frames, in one
constexpr double kMinStep = 0.01;                   // of full scale
constexpr double kMaxShare = 0.03;

std::vector<int> solids_of_empty_stage(const v1::CaptureManifest& manifest, const std::vector<int>& frames) {
  std::vector<int> solids;
  for (const int f : frames) {
    const v1::Frame& frame = manifest.frames(f);
    if (!frame.object() && is_pattern(frame) && kind_of(frame.stimulus()) == StimulusKind::kSolid)
      solids.push_back(f);
  }
  if (solids.size() > kMaxFrames) solids.resize(kMaxFrames);
  return solids;
}

// By how much the middle of nine samples exceeds all but one of the others; at the picture's edges there are
// only five others. Null: rows that it does not have. `count`: samples of a row.
float beyond(const std::array<const float*, 3>& rows, size_t x, size_t step, size_t count) {
  // The two least and the two greatest of the others.
  float lowest = INFINITY, low = INFINITY, highest = -INFINITY, high = -INFINITY;
  int found = 0;
  for (size_t r = 0; r < 3; ++r) {
    if (rows[r] == nullptr) continue;
    for (const size_t at : {x - step, x, x + step}) {  // left of the picture is beyond `count`
      if (at >= count || (r == 1 && at == x)) continue;
      const float light = rows[r][at];
      low = std::min(low, std::max(lowest, light));
      lowest = std::min(lowest, light);
      high = std::max(high, std::min(highest, light));
      highest = std::max(highest, light);
      ++found;
    }
  }
  if (found < 5) return 0.0f;  // a corner
  const float own = rows[1][x];
  return std::max({low - own, own - high, 0.0f});
}

// Whole pictures of these frames, as light.
absl::StatusOr<std::vector<std::vector<float>>> pictures(const std::vector<int>& frames, int height,
                                                         const LightReader& read) {
  std::vector<std::vector<float>> light(frames.size());
  for (int y = 0; y < height; ++y) {
    GW_ASSIGN_OR_RETURN(const FrameStack row, read(y, frames));
    for (size_t i = 0; i < frames.size(); ++i) {
      for (const std::uint16_t code : row.rows[frames[i]]) light[i].push_back(row.radiance(code));
    }
  }
  return light;
}

// By pixel of a row, whether the id patch that it sees changes its light by more than `step`.
absl::StatusOr<std::vector<bool>> sees_patch(const std::vector<std::vector<int>>& patches, int y,
                                             size_t width, size_t lanes, float step,
                                             const LightReader& read) {
  std::vector<bool> sees(width);
  for (const std::vector<int>& frames : patches) {
    GW_ASSIGN_OR_RETURN(const FrameStack row, read(y, frames));
    for (size_t lane = 0; lane < width * lanes; ++lane) {
      float low = INFINITY, high = -INFINITY;
      for (const int frame : frames) {
        const float light = row.radiance(row.rows[frame][lane]);
        low = std::min(low, light);
        high = std::max(high, light);
      }
      if (high - low > step) sees[lane / lanes] = true;
    }
  }
  return sees;
}

// Drops pixels with a neighbour, `reach` away, that sees an id patch, which is not a smooth picture.
absl::Status drop_near_patch(const v1::CaptureManifest& manifest, size_t lanes, size_t reach, float step,
                             const LightReader& read, std::vector<int>& pixels) {
  if (pixels.empty()) return absl::OkStatus();
  GW_ASSIGN_OR_RETURN(const Exposures exposures, Exposures::of(manifest));
  const std::vector<std::vector<int>> patches = lay_out_stage(manifest, exposures).patches;
  if (patches.empty()) return absl::OkStatus();
  const int width = manifest.camera().width_px(), away = static_cast<int>(reach);
  std::map<int, std::vector<bool>> sees;  // by row
  const auto is_inside = [](int at, int size) { return at >= 0 && at < size; };
  const int height = manifest.camera().height_px();
  for (const int pixel : pixels) {
    for (const int y : {pixel / width - away, pixel / width, pixel / width + away}) {
      if (!is_inside(y, height) || sees.contains(y)) continue;
      GW_ASSIGN_OR_RETURN(sees[y], sees_patch(patches, y, static_cast<size_t>(width), lanes, step, read));
    }
  }
  std::erase_if(pixels, [&](int pixel) {
    for (const int y : {pixel / width - away, pixel / width, pixel / width + away}) {
      for (const int x : {pixel % width - away, pixel % width, pixel % width + away}) {
        if (is_inside(y, height) && is_inside(x, width) && sees[y][x]) return true;
      }
    }
    return false;
  });
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<int>> find_bad_pixels(const v1::CaptureManifest& manifest,
                                                 const std::vector<int>& frames, const LightReader& read) {
  const std::vector<int> solids = solids_of_empty_stage(manifest, frames);
  const auto width = static_cast<size_t>(manifest.camera().width_px()),
             height = static_cast<size_t>(manifest.camera().height_px());
  const bool mosaic = !manifest.camera().mosaic().empty();
  const size_t lanes = mosaic ? 1 : kChannels, reach = mosaic ? 2 : 1;  // to the next photosite of its colour
  if (solids.empty() || width < 4 * reach || height < 4 * reach) return std::vector<int>();
  GW_ASSIGN_OR_RETURN(const std::vector<std::vector<float>> light,
                      pictures(solids, manifest.camera().height_px(), read));
  std::vector<float> worst(width * height);
  std::vector<int> count(width * height);
  double noisiest = kMinStep / kBeyond;
  for (const std::vector<float>& own : light) {
    std::vector<float> steps;
    for (size_t i = lanes; i < own.size(); i += 7) steps.push_back(std::abs(own[i] - own[i - lanes]));
    const double sd = std::max(1.4826 / std::sqrt(2.0) * median(steps), kMinStep / kBeyond);
    noisiest = std::max(noisiest, sd);
    for (size_t y = 0; y < height; ++y) {
      const auto row = [&](size_t at) { return at < height ? own.data() + at * width * lanes : nullptr; };
      const std::array<const float*, 3> rows{row(y - reach), row(y), row(y + reach)};
      for (size_t x = 0; x < width * lanes; ++x) {
        const auto size = static_cast<float>(beyond(rows, x, reach * lanes, width * lanes) / sd);
        const size_t pixel = y * width + x / lanes;
        worst[pixel] = std::max(worst[pixel], size);
        count[pixel] += size > static_cast<float>(kBeyond);
      }
    }
  }
  std::vector<int> bad;
  for (size_t p = 0; p < worst.size(); ++p) {
    if (count[p] >= 2 || worst[p] > static_cast<float>(kFarBeyond)) bad.push_back(static_cast<int>(p));
  }
  GW_RETURN_IF_ERROR(
      drop_near_patch(manifest, lanes, reach, static_cast<float>(kBeyond * noisiest), read, bad));
  if (static_cast<double>(bad.size()) > kMaxShare * static_cast<double>(worst.size())) bad.clear();
  return bad;
}

}  // namespace glasswing
