#include "server/mattes/sampled_quality.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/median.h"
#include "core/base/status.h"
#include "core/matte/packed_matte.h"

namespace glasswing {
namespace {

constexpr int kRows = 64;
constexpr int kGreen = 1;

}  // namespace

absl::StatusOr<MatteQuality> sampled_quality(const PositionedFile& matte) {
  GW_ASSIGN_OR_RETURN(const PackedMatteReader reader, PackedMatteReader::open(matte));
  const int height_px = reader.outline().height_px, step = std::max(1, height_px / kRows);
  std::vector<float> errors_px, widths_px;
  size_t object = 0, poor = 0;
  const auto sample = [&](const Matte& rows) {
    for (int y = 0; y < rows.height_px(); ++y) {
      for (int x = 0; x < rows.width_px(); ++x) {
        if (rows.coverage(x, y) <= 0.0F || (rows.flags(x, y) & kFlagNoData) != 0) continue;
        ++object;
        if ((rows.flags(x, y) & kFlagPoorFit) != 0) ++poor;
        const Mode& mode = *std::ranges::max_element(rows.modes(x, y, kGreen), {}, &Mode::weight);
        if (mode.weight <= 0.0F) continue;
        widths_px.push_back(std::sqrt(0.5F * (mode.xx_px2 + mode.yy_px2)));
        if (mode.centre_sd_px > 0.0F) errors_px.push_back(mode.centre_sd_px);
      }
    }
    return absl::OkStatus();
  };
  GW_RETURN_IF_ERROR(reader.for_rows(0, (height_px + step - 1) / step, sample, step));
  return MatteQuality{.poor_fit = object == 0 ? 0.0 : static_cast<double>(poor) / static_cast<double>(object),
                      .error_px = median_in_place(std::span(errors_px)),
                      .width_px = median_in_place(std::span(widths_px))};
}

}  // namespace glasswing
