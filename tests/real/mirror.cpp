// real-mirror ARCHIVE MATTE PICTURES: photographs of a mirror in front of a fringe display, solved by method
// fringe. Compares the map with a plain four-step decode and with its own standard errors. Writes a composite
// of the mirror with a photograph from GLASSWING_DATA (default ../shared/data) below PICTURES.
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <numbers>
#include <optional>

#include "core/composite/compositor.h"
#include "core/image/image_file.h"
#include "core/import/mapped_archive.h"
#include "core/matte/matte_file.h"
#include "solver/method/method.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPicture = "real/backgrounds_cc0/astronaut.png";
constexpr int kChannel = 1;
constexpr float kMaxVariance_px2 = 400.0f;
constexpr float kLit = 0.25f;                 // of the mirror, white minus black
constexpr double kMinModulation = 8.0 / 255;  // minimum for a plain decode
constexpr int kReach = 3;                     // px, of the window in which the map is smooth

// Frames of one sinusoid, by quarter turns.
using Quarters = std::array<int, 4>;

// By axis, then by period, long to short.
std::array<std::map<double, Quarters, std::greater<>>, 2> fringes_of(const v1::CaptureManifest& manifest) {
  std::array<std::map<double, Quarters, std::greater<>>, 2> fringes;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Stimulus& stimulus = manifest.frames(i).stimulus();
    if (stimulus.kind() != "sinusoid") continue;
    const size_t quarter = std::lround(stimulus.phase_deg() / 90.0);
    fringes[stimulus.phi_deg() == 0.0 ? 0 : 1][stimulus.period_px()][quarter] = i;
  }
  return fringes;
}

// atan2 of the differences of opposite frames, coarse to fine; none if a modulation is too small.
std::optional<double> decode(const FrameStack& stack,
                             const std::map<double, Quarters, std::greater<>>& fringes, int x, int y) {
  std::optional<double> place_px;
  for (const auto& [period_px, frames] : fringes) {
    const auto at = [&](size_t k) { return static_cast<double>(stack.at(frames[k], x, y, kChannel)); };
    const double cosine = at(0) - at(2), sine = at(1) - at(3);
    if (0.5 * std::hypot(cosine, sine) < kMinModulation) return std::nullopt;
    const double turn = std::atan2(sine, cosine) / (2.0 * std::numbers::pi);
    const double own_px = (turn < 0.0 ? turn + 1.0 : turn) * period_px;
    place_px = place_px ? own_px + std::round((*place_px - own_px) / period_px) * period_px : own_px;
  }
  return place_px;
}

bool is_lit(const v1::CaptureManifest& manifest, const FrameStack& stack, int x, int y) {
  float low = 1.0f, high = 0.0f;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    if (manifest.frames(i).stimulus().kind() != "solid") continue;
    low = std::min(low, stack.at(i, x, y, kChannel));
    high = std::max(high, stack.at(i, x, y, kChannel));
  }
  return high - low > kLit;
}

double median(std::vector<double> values) {
  if (values.empty()) return NAN;
  const auto middle = values.begin() + values.size() / 2;
  std::ranges::nth_element(values, middle);
  return *middle;
}

// A filter that subtracts a fitted parabola from the middle of a window, scaled to preserve noise. The window
// lies along a row: from one row of these photographs to the next, waves of 17 and of 68 px, whose noise is
// independent, agree on steps of a third of a pixel (correlation 0.97).
constexpr int kWindow = 2 * kReach + 1;
std::array<double, kWindow> residual_filter() {
  Eigen::Matrix<double, kWindow, 3> terms;
  for (int i = 0; i < kWindow; ++i) {
    const double u = i - kReach;
    terms.row(i) << 1.0, u, u * u;
  }
  const Eigen::Matrix<double, kWindow, kWindow> fitted =
      terms * (terms.transpose() * terms).inverse() * terms.transpose();
  std::array<double, kWindow> filter{};
  for (int i = 0; i < kWindow; ++i)
    filter[i] = ((i == kReach ? 1.0 : 0.0) - fitted(kReach, i)) / std::sqrt(1.0 - fitted(kReach, kReach));
  return filter;
}

// The archive's photographs and the matte solved from them.
struct Solved {
  const v1::CaptureManifest& manifest;
  FrameStack stack;
  Matte matte;

  bool lit(int x, int y) const { return is_lit(manifest, stack, x, y); }
  bool good(int x, int y) const {
    return lit(x, y) && matte.flags(x, y) == kFlagNone && matte.modes(x, y, kChannel)[0].weight > 0;
  }
};

struct Comparison {
  int lit = 0, flagged = 0, poor = 0, compared = 0, wrong = 0;
  std::array<std::vector<double>, 2> residuals;
  std::vector<double> errors, ratios, differences;
};

// The residual of a mode's x and y along its row; none unless all pixels of the window are good.
std::optional<std::array<double, 2>> residual_of(const Solved& solved, int x, int y) {
  static const std::array<double, kWindow> filter = residual_filter();
  double left_x = 0.0, left_y = 0.0;
  for (int i = 0; i < kWindow; ++i) {
    const int u = x + i - kReach;
    if (u < 0 || u >= solved.matte.width_px() || !solved.good(u, y)) return std::nullopt;
    const Mode& there = solved.matte.modes(u, y, kChannel)[0];
    left_x += filter[i] * static_cast<double>(there.x_px);
    left_y += filter[i] * static_cast<double>(there.y_px);
  }
  return std::array{left_x, left_y};
}

Comparison compare(const Solved& solved) {
  const Matte& matte = solved.matte;
  const auto fringes = fringes_of(solved.manifest);
  Comparison result;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      if (!solved.lit(x, y)) continue;
      ++result.lit;
      const Mode& mode = matte.modes(x, y, kChannel)[0];
      if (!solved.good(x, y)) {
        ++result.flagged;
        result.poor += matte.flags(x, y) & kFlagPoorFit ? 1 : 0;
        continue;
      }
      const auto plain_x = decode(solved.stack, fringes[0], x, y),
                 plain_y = decode(solved.stack, fringes[1], x, y);
      if (plain_x && plain_y) {
        ++result.compared;
        const double dx = std::abs(static_cast<double>(mode.x_px) - *plain_x),
                     dy = std::abs(static_cast<double>(mode.y_px) - *plain_y);
        result.differences.push_back(std::hypot(dx, dy));
        if (dx > 0.5 * fringes[0].rbegin()->first || dy > 0.5 * fringes[1].rbegin()->first) ++result.wrong;
      }
      const auto left = residual_of(solved, x, y);
      if (!left) continue;
      for (size_t axis = 0; axis < 2; ++axis) result.residuals[axis].push_back(std::abs((*left)[axis]));
      result.errors.push_back(static_cast<double>(mode.centre_sd_px));
      result.ratios.push_back(std::hypot((*left)[0], (*left)[1]) /
                              (std::numbers::sqrt2 * result.errors.back()));
    }
  }
  return result;
}

void write_mirrored_picture(const Solved& solved, const fs::path& pictures) {
  const char* const data = std::getenv("GLASSWING_DATA");
  const fs::path background = fs::path(data != nullptr ? data : "../shared/data") / kPicture;
  if (!fs::exists(background)) {
    fmt::print("no picture to put into the mirror at {}\n", background.string());
    return;
  }
  const v1::Monitor& monitor = solved.matte.metadata.monitors(0);
  const RadianceImage picture =
      resized(read_radiance(background, Encoding::kDisplay).value(), monitor.width_px(), monitor.height_px());
  // The rest of the scene and the mirror's rim see the whole screen, which is slow to integrate.
  Matte mirror = solved.matte;
  for (int y = 0; y < mirror.height_px(); ++y) {
    for (int x = 0; x < mirror.width_px(); ++x) {
      for (int c = 0; c < kChannels; ++c) {
        if (solved.good(x, y) && solved.matte.modes(x, y, c)[0].yy_px2 < kMaxVariance_px2) break;
        std::ranges::fill(mirror.modes(x, y, c), Mode{});
      }
    }
  }
  const absl::Status written =
      write_radiance(pictures / "mirror.png", composite(mirror, {picture}).value(), Encoding::kDisplay);
  if (!written.ok()) fmt::print(stderr, "{}\n", std::string(written.message()));
}

FrameStack whole_stack(const MappedArchive& archive) {
  const v1::Camera& camera = archive.manifest().camera();
  FrameStack stack{.width_px = camera.width_px(),
                   .first_row = 0,
                   .row_count = camera.height_px(),
                   .rows = {},
                   .owner = nullptr};
  for (int i = 0; i < archive.manifest().frames_size(); ++i)
    stack.rows.push_back(archive.rows(i, 0, camera.height_px()));
  return stack;
}

bool check(const std::string& folder, const std::string& matte_file, const fs::path& pictures) {
  const auto archive = MappedArchive::open_interpolated(folder).value();
  const Solved solved{.manifest = archive->manifest(),
                      .stack = whole_stack(*archive),
                      .matte = read_matte(matte_file).value()};
  const Comparison result = compare(solved);
  const double ratio = median(result.ratios);
  fmt::print("{} lit pixels of {}x{}, {:.2f} % flagged ({:.2f} % poor)\n", result.lit,
             solved.matte.width_px(), solved.matte.height_px(), 100.0 * result.flagged / result.lit,
             100.0 * result.poor / result.lit);
  fmt::print(
      "{} of {} pixels in another period than a plain decode has them; the median distance is {:.3f} px\n",
      result.wrong, result.compared, median(result.differences));
  fmt::print(
      "local residual along rows {:.3f} px in x, {:.3f} px in y; standard error {:.3f} px; median ratio "
      "{:.2f}\n",
      median(result.residuals[0]), median(result.residuals[1]), median(result.errors), ratio);
  std::fflush(stdout);
  write_mirrored_picture(solved, pictures);
  return result.compared > 0 && result.wrong == 0 && ratio >= 0.5 && ratio <= 2.0;
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: real-mirror ARCHIVE MATTE PICTURES\n");
    return 2;
  }
  return glasswing::check(argv[1], argv[2], argv[3]) ? 0 : 1;
}
