#include "core/geometry/monitor_sightings.h"

#include <fmt/format.h>

#include <cmath>

#include "core/base/status.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

constexpr double kMaxPixels = 20000.0;  // of a picture: enough for a thousandth of a pixel
constexpr float kMinShare = 0.6f;       // of the pixel's light, from the place it is taken to look at
constexpr float kMinWeight = 0.02f;
constexpr float kMargin_px = 1.0f;      // from the monitor's edge, where footprints are cut
constexpr float kSamePlace_px = 1e-3f;  // of straight through
constexpr int kGreen = 1;               // lies in the middle of what a lens disperses
constexpr std::uint8_t kUnusable = kFlagNotConverged | kFlagPoorFit | kFlagNoData;

// The mode that has most of a pixel's light.
const Mode* place_of(const Matte& matte, int x, int y) {
  if ((matte.flags(x, y) & kUnusable) != 0) return nullptr;
  const Mode* strongest = nullptr;
  float all = 0.0f;
  for (const Mode& mode : matte.modes(x, y, kGreen)) {
    all += mode.weight;
    if (strongest == nullptr || mode.weight > strongest->weight) strongest = &mode;
  }
  return strongest != nullptr && strongest->weight > std::max(kMinWeight, kMinShare * all) ? strongest
                                                                                           : nullptr;
}

class Sightings {
 public:
  explicit Sightings(const MatteOutline& outline)
      : metadata_(outline.metadata),
        step_(std::max(1, static_cast<int>(std::ceil(std::sqrt(static_cast<double>(outline.width_px) *
                                                               outline.height_px / kMaxPixels))))) {
    for (std::vector<std::vector<Sighting>>* own : {&bare_, &all_}) own->resize(metadata_.monitors_size());
  }

  void see(const Matte& rows) {
    for (int y = 0; y < rows.height_px(); ++y) {
      if ((rows.y0_px() + y) % step_ != step_ / 2) continue;
      for (int x = step_ / 2; x < rows.width_px(); x += step_) see(rows, x, y);
    }
  }

  absl::StatusOr<std::vector<MonitorView>> views() {
    const std::string& session = metadata_.session();
    if (bare_count_ > 0 && straight_count_ == bare_count_) {
      return absl::FailedPreconditionError(fmt::format(
          "session \"{}\" did not measure where its pixels look: it has no bars or stripes of the empty "
          "stage, and its background is only taken to lie straight behind; capture a plan that shows square "
          "waves",
          session));
    }
    std::vector<MonitorView> views;
    for (int m = 0; m < metadata_.monitors_size(); ++m) {
      std::vector<Sighting>& own = (shows_stage_ ? bare_ : all_)[m];
      if (std::ssize(own) < kMinSightings) continue;
      const v1::Monitor& monitor = metadata_.monitors(m);
      views.push_back({.session = session,
                       .monitor = monitor.name(),
                       .width_px = monitor.width_px(),
                       .height_px = monitor.height_px(),
                       .sightings = std::move(own)});
      if (monitor.has_rail_mm()) views.back().rail_mm = monitor.rail_mm();
    }
    if (views.empty()) {
      return absl::FailedPreconditionError(fmt::format(
          "in session \"{}\" fewer than {} pixels look at a monitor past the object and tell where; capture "
          "square waves, without an object, and with a monitor in view",
          session, kMinSightings));
    }
    return views;
  }

 private:
  void see(const Matte& rows, int x, int y) {
    shows_stage_ = shows_stage_ || rows.coverage(x, y) <= 0.0f;
    const Mode* const mode = place_of(rows, x, y);
    if (mode == nullptr || mode->texture >= metadata_.monitors_size()) return;
    const v1::Monitor& monitor = metadata_.monitors(mode->texture);
    const auto width = static_cast<float>(monitor.width_px()),
               height = static_cast<float>(monitor.height_px());
    if (!(mode->x_px > kMargin_px && mode->x_px < width - kMargin_px && mode->y_px > kMargin_px &&
          mode->y_px < height - kMargin_px))
      return;
    const float column = static_cast<float>(x) + 0.5f, row = static_cast<float>(rows.y0_px() + y) + 0.5f;
    const Sighting sighting{.pixel = {column, row},
                            .monitor_px = {static_cast<double>(mode->x_px), static_cast<double>(mode->y_px)},
                            .sd_px = static_cast<double>(mode->centre_sd_px)};
    const size_t texture = mode->texture;
    all_[texture].push_back(sighting);
    if (rows.coverage(x, y) > 0.0f) return;
    bare_[texture].push_back(sighting);
    ++bare_count_;
    const float lit_rows = height + static_cast<float>(monitor.patch_rows());
    const float off_x = mode->x_px - column * width / static_cast<float>(metadata_.width_px());
    const float off_y = mode->y_px - row * lit_rows / static_cast<float>(metadata_.height_px());
    straight_count_ += std::hypot(off_x, off_y) < kSamePlace_px;
  }

  const v1::MatteMetadata metadata_;
  const int step_;
  std::vector<std::vector<Sighting>> bare_, all_;  // by monitor: past the object, and of every pixel
  bool shows_stage_ = false;                       // some pixel shows no object, usable or not
  int bare_count_ = 0, straight_count_ = 0;
};

}  // namespace

absl::StatusOr<StageView> sightings_in(std::string_view matte) {
  GW_ASSIGN_OR_RETURN(const MatteOutline outline, outline_of(matte));
  const v1::MatteMetadata& metadata = outline.metadata;
  if (outline.x0_px != 0 || outline.y0_px != 0 || outline.width_px != metadata.width_px() ||
      outline.height_px != metadata.height_px() || metadata.sampling_px() > 1) {
    return absl::FailedPreconditionError(fmt::format(
        "the matte is {}x{} px from ({}, {}) on, of a picture of {}x{}; it must be the whole picture",
        outline.width_px, outline.height_px, outline.x0_px, outline.y0_px, metadata.width_px(),
        metadata.height_px()));
  }
  Sightings sightings(outline);
  GW_RETURN_IF_ERROR(for_rows_of_matte(matte, [&](const Matte& rows) {
    sightings.see(rows);
    return absl::OkStatus();
  }));
  StageView view{.width_px = outline.width_px, .height_px = outline.height_px, .monitors = {}};
  GW_ASSIGN_OR_RETURN(view.monitors, sightings.views());
  return view;
}

}  // namespace glasswing
