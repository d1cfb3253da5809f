// Compares dithers as seen by a camera whose pixels each cover a few of the monitor's, and measures the time
// of ours. Not part of glasswing-bench: run build/release/bin/glasswing-dither-bench.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <functional>
#include <random>

#include "core/pattern/pattern.h"
#include "core/radiometry/dither.h"

namespace glasswing {
namespace {

constexpr int kSide = 192;
using Field = std::vector<double>;  // kSide x kSide
using Way = std::function<Field(const Field&, const ToneCurve&)>;

size_t at(int x, int y) {
  return static_cast<size_t>(y * kSide + x);
}

Way by_threshold(const std::function<double(int, int)>& threshold) {
  return [threshold](const Field& wanted, const ToneCurve& curve) {
    Field shown(wanted.size());
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const double code = std::floor(curve.code_for(wanted[at(x, y)]) + threshold(x, y));
        shown[at(x, y)] = curve.radiance(code);
      }
    }
    return shown;
  };
}

// Floyd and Steinberg 1976, of radiance.
Field diffused(const Field& wanted, const ToneCurve& curve) {
  Field left = wanted, shown(wanted.size());
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const double code = std::floor(curve.code_for(left[at(x, y)]) + 0.5);
      shown[at(x, y)] = curve.radiance(code);
      const double error = left[at(x, y)] - shown[at(x, y)];
      const auto pass = [&](int dx, int dy, double share) {
        if (x + dx >= 0 && x + dx < kSide && y + dy < kSide) left[at(x + dx, y + dy)] += share * error;
      };
      pass(1, 0, 7.0 / 16.0);
      pass(-1, 1, 3.0 / 16.0);
      pass(0, 1, 5.0 / 16.0);
      pass(1, 1, 1.0 / 16.0);
    }
  }
  return shown;
}

Field ours(const Field& wanted, const ToneCurve& curve) {
  RadianceImage picture(kSide, kSide);
  for (size_t i = 0; i < picture.samples.size(); ++i) picture.samples[i] = static_cast<float>(wanted[i / 3]);
  const Image<std::uint16_t> codes = Dither({curve, curve, curve}).codes(picture);
  Field shown(wanted.size());
  for (size_t i = 0; i < shown.size(); ++i) shown[i] = curve.radiance(codes.samples[3 * i]);
  return shown;
}

// Rank in [0, cells) of void and cluster (Ulichney 1993), 64 x 64 on a torus.
std::vector<int> void_and_cluster() {
  constexpr int kTile = 64, kCells = kTile * kTile;
  std::vector<char> set(kCells, 0);
  std::vector<double> crowding(kCells, 0.0);
  const auto change = [&](int cell, bool put) {
    set[cell] = put;
    for (int dy = -9; dy <= 9; ++dy) {
      for (int dx = -9; dx <= 9; ++dx) {
        const int there =
            ((cell / kTile + dy) % kTile + kTile) % kTile * kTile + ((cell + dx) % kTile + kTile) % kTile;
        crowding[there] += (put ? 1.0 : -1.0) * std::exp(-(dx * dx + dy * dy) / 4.5);
      }
    }
  };
  const auto extreme = [&](bool point) {
    int best = -1;
    for (int i = 0; i < kCells; ++i) {
      if ((set[i] != 0) != point) continue;
      const double more = best < 0 ? 0.0 : crowding[i] - crowding[best];
      if (best < 0 || (point ? more > 0.0 : more < 0.0)) best = i;
    }
    return best;
  };
  std::mt19937 random(1);
  int points = 0;
  while (points < kCells / 10) {
    const auto cell = static_cast<int>(random() % kCells);
    if (set[cell] != 0) continue;
    change(cell, true);
    ++points;
  }
  for (;;) {
    const int tightest = extreme(true);
    change(tightest, false);
    const int emptiest = extreme(false);
    change(emptiest, true);
    if (emptiest == tightest) break;
  }
  std::vector<int> rank(kCells);
  const std::vector<char> set_then = set;
  const std::vector<double> crowding_then = crowding;
  for (int r = points - 1; r >= 0; --r) {
    const int tightest = extreme(true);
    change(tightest, false);
    rank[tightest] = r;
  }
  set = set_then;
  crowding = crowding_then;
  for (int r = points; r < kCells; ++r) {
    const int emptiest = extreme(false);
    change(emptiest, true);
    rank[emptiest] = r;
  }
  return rank;
}

// Bayer 1973, of 2^levels pixels per side.
double bayer(int x, int y, int levels) {
  int rank = 0;
  for (int i = 0; i < levels; ++i) {
    const int a = (x >> i) & 1, b = (y >> i) & 1;
    rank = 4 * rank + 2 * (a ^ b) + b;
  }
  return (rank + 0.5) / static_cast<double>(1 << (2 * levels));
}

// The footprint of a camera pixel along one axis, of odd or even length; it is separable.
std::vector<double> box(double width) {
  const int reach = static_cast<int>(std::ceil(width / 2.0));
  std::vector<double> kernel;
  for (int i = -reach; i <= reach; ++i)
    kernel.push_back(std::clamp(0.5 * width + 0.5 - std::abs(i), 0.0, 1.0) / width);
  return kernel;
}
std::vector<double> gaussian(double sigma) {
  std::vector<double> kernel;
  double sum = 0.0;
  for (int i = -8; i <= 8; ++i) {
    kernel.push_back(std::exp(-i * i / (2.0 * sigma * sigma)));
    sum += kernel.back();
  }
  for (double& value : kernel) value /= sum;
  return kernel;
}

// Largest and rms difference over all positions.
std::pair<double, double> seen(const Field& difference, const std::vector<double>& kernel) {
  const int n = static_cast<int>(kernel.size());
  Field rows(difference.size(), 0.0);
  double worst = 0.0, square = 0.0, count = 0.0;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x + n <= kSide; ++x) {
      for (int i = 0; i < n; ++i) rows[at(x, y)] += kernel[i] * difference[at(x + i, y)];
    }
  }
  for (int y = 0; y + n <= kSide; ++y) {
    for (int x = 0; x + n <= kSide; ++x) {
      double sum = 0.0;
      for (int i = 0; i < n; ++i) sum += kernel[i] * rows[at(x, y + i)];
      worst = std::max(worst, std::abs(sum));
      square += sum * sum;
      count += 1.0;
    }
  }
  return {worst, std::sqrt(square / count)};
}

void compare() {
  const ToneCurve curve = ToneCurve::power(2.2, 8);
  const std::vector<int> rank = void_and_cluster();
  std::mt19937_64 random(1);
  std::vector<double> white(kSide * kSide);
  for (double& value : white) value = std::uniform_real_distribution<double>()(random);
  const std::vector<std::pair<const char*, Way>> ways{
      {"none", by_threshold([](int, int) { return 0.5; })},
      {"white noise", by_threshold([&](int x, int y) { return white[at(x, y)]; })},
      {"void and cluster 64",
       by_threshold([&](int x, int y) { return (rank[y % 64 * 64 + x % 64] + 0.5) / 4096.0; })},
      {"Floyd-Steinberg", diffused},
      {"ours", ours},
      {"Bayer 4", by_threshold([](int x, int y) { return bayer(x, y, 2); })},
      {"Bayer 8", by_threshold([](int x, int y) { return bayer(x, y, 3); })},
      {"Bayer 64", by_threshold([](int x, int y) { return bayer(x, y, 6); })}};
  const std::vector<std::pair<const char*, std::vector<double>>> kernels{{"box 4", {0.25, 0.25, 0.25, 0.25}},
                                                                         {"box 4.6", box(4.6)},
                                                                         {"box 3", box(3.0)},
                                                                         {"sigma 1.5", gaussian(1.5)}};
  std::printf("worst (rms) error of Gaussian stripes, %% of the peak, gamma 2.2, 8 bits\n");
  for (const double peak : {1.0, 0.25, 0.1}) {
    for (const auto& [way_name, way] : ways) {
      std::printf("peak %.2f  %-20s", peak, way_name);
      for (const auto& [kernel_name, kernel] : kernels) {
        double worst = 0.0, square = 0.0, count = 0.0;
        for (const double sigma_px : {3.0, 8.0, 20.0, 60.0}) {
          for (const double phi_deg : {0.0, 17.0, 45.0, 90.0}) {
            Field wanted(kSide * kSide);
            const double phi = phi_deg * 3.14159265358979 / 180.0;
            for (int y = 0; y < kSide; ++y) {
              for (int x = 0; x < kSide; ++x) {
                const double z = ((x + 0.5) * std::cos(phi) + (y + 0.5) * std::sin(phi) - 90.3) / sigma_px;
                wanted[at(x, y)] = peak * std::exp(-0.5 * z * z);
              }
            }
            Field difference = way(wanted, curve);
            for (size_t i = 0; i < difference.size(); ++i) difference[i] -= wanted[i];
            const auto [most, rms] = seen(difference, kernel);
            worst = std::max(worst, most);
            square += rms * rms;
            count += 1.0;
          }
        }
        std::printf("  %s %.3f (%.3f)", kernel_name, 100.0 * worst / peak,
                    100.0 * std::sqrt(square / count) / peak);
      }
      std::printf("\n");
    }
  }
}

// The whole cost of a stripe, from its equation to codes, in processor time, which other load disturbs least.
void time_ours() {
  constexpr MonitorSize kScreen{.width_px = 1920, .height_px = 1080};
  const ToneCurve curve = ToneCurve::power(2.2, 8);
  const Dither dither({curve, curve, curve});
  Image<std::uint16_t> codes(kScreen.width_px, kScreen.height_px);
  for (const double sigma_px : {8.0, 60.0, 200.0}) {
    v1::Stimulus stimulus;
    stimulus.set_kind("gauss_stripe");
    stimulus.set_peak(1.0);
    stimulus.set_sigma_px(sigma_px);
    stimulus.set_phi_deg(30.0);
    stimulus.set_r_px(1100.0);
    const Pattern pattern = Pattern::create(stimulus, kScreen).value();
    std::vector<double> times;
    for (int run = 0; run < 41; ++run) {
      const std::clock_t start = std::clock();
      dither.codes([&](int y_px, std::span<float> row) { pattern.rasterise(y_px, row); }, kScreen.width_px,
                   codes.samples);
      times.push_back(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
    }
    std::sort(times.begin(), times.end());
    std::printf("1920x1080, stripe of sigma %.0f px: %.2f ms (median of 41), %.2f ms (least)\n", sigma_px,
                1e3 * times[20], 1e3 * times[0]);
  }
}

}  // namespace
}  // namespace glasswing

int main() {
  glasswing::compare();
  glasswing::time_ours();
}
