// real-folded ARCHIVE MATTE TRUTH.png: Gray code and phase shift, solved by method fringe. The truth is the
// author's own decode at twice the size: B = x mod 256, G = y mod 256 of whole monitor px, R = 128 where
// decoded. 99 % of unflagged pixels must have their centre within 1 px of it, modulo 256.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

#include "core/base/status.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

constexpr int kGreen = 1;
constexpr double kFold_px = 256.0, kNear_px = 1.0, kShare = 0.99;

// The middle of the four pixels that one of the photographs' stands for; NAN unless all are decoded, and
// agree within 4 px.
double truth_at(const Image16& truth, int x, int y, int channel) {
  std::vector<double> places;
  for (int i = 0; i < 4; ++i) {
    const int u = 2 * x + i % 2, v = 2 * y + i / 2;
    if (truth.at(u, v, 0) / 257 != 128) return NAN;
    places.push_back(truth.at(u, v, channel) / 257.0);
  }
  double mean = 0.0;
  for (const double place : places) {
    const double off = std::remainder(place - places[0], kFold_px);
    if (std::abs(off) > 4.0) return NAN;
    mean += 0.25 * off;
  }
  return places[0] + mean + 0.5;  // the middle of a monitor's pixel
}

absl::StatusOr<bool> check(const char* matte_path, const char* truth_path) {
  GW_ASSIGN_OR_RETURN(const Matte matte, read_matte(matte_path));
  GW_ASSIGN_OR_RETURN(const CodedPhotograph truth, read_photograph(truth_path));
  int compared = 0, near = 0, flagged = 0;
  std::array<std::vector<double>, 2> off;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      const std::array<double, 2> place{truth_at(truth.codes, x, y, 2), truth_at(truth.codes, x, y, 1)};
      if (std::isnan(place[0]) || std::isnan(place[1])) continue;
      const Mode& mode = matte.modes(x, y, kGreen)[0];
      if (matte.flags(x, y) != kFlagNone || mode.weight <= 0.0f) {
        ++flagged;
        continue;
      }
      ++compared;
      const double dx = std::remainder(static_cast<double>(mode.x_px) - place[0], kFold_px);
      const double dy = std::remainder(static_cast<double>(mode.y_px) - place[1], kFold_px);
      off[0].push_back(dx);
      off[1].push_back(dy);
      near += std::max(std::abs(dx), std::abs(dy)) <= kNear_px ? 1 : 0;
    }
  }
  const double share = near / std::max(1.0, static_cast<double>(compared));
  fmt::print("{:.2f} % of {} unflagged pixels within {} px of the truth; {} flagged\n", 100.0 * share,
             compared, kNear_px, flagged);
  for (std::vector<double>& along : off) {
    std::ranges::sort(along);
    const auto at = [&](double rank) {
      return along[static_cast<size_t>(rank * static_cast<double>(along.size() - 1))];
    };
    if (!along.empty())
      fmt::print("off by {:.2f} px in the middle, {:.2f} to {:.2f} of 99 %, {:.2f} to {:.2f} of 90 %\n",
                 at(0.5), at(0.005), at(0.995), at(0.05), at(0.95));
  }
  return compared > 0 && share >= kShare;
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fputs("real-folded ARCHIVE MATTE TRUTH.png\n", stderr);
    return 2;
  }
  const auto held = glasswing::check(argv[2], argv[3]);
  if (!held.ok()) std::fprintf(stderr, "%s\n", std::string(held.status().message()).c_str());
  return held.ok() && *held ? 0 : 1;
}
