// --layout auto on layouts of many kinds: kinds x orders x sizes x noise x saturation x bad photographs,
// drawn at random from the definitions of the patterns alone. It is right, or it asks; it is never wrong.
#include <gtest/gtest.h>

#include <iostream>

#include "client/layouts/layout_guess.h"
#include "tests/client/layouts/synthetic_stack.h"

namespace glasswing {
namespace {

using Random = std::mt19937;

int whole(Random& random, int low, int high) {
  return std::uniform_int_distribution<int>(low, high)(random);
}
double between(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

// One picture: its light at t px of an axis; axis -1: everywhere.
struct Picture {
  int axis = -1;
  std::function<double(double)> light;
};

struct Drawn {
  int width_px = 0, height_px = 0;
  std::vector<Picture> pictures;
  std::string options;
  LayoutFacts facts;
  bool fringes = false;
  int steps = 0;
};

int bits_for(double cells) {
  int bits = 0;
  while (std::exp2(bits) < std::ceil(cells)) ++bits;
  return bits;
}

void add_code(Drawn& drawn, int axis, bool gray, double cell_px, int complements) {
  const double side_px = axis == 0 ? drawn.width_px : drawn.height_px;
  for (int bit = bits_for(side_px / cell_px) - 1; bit >= 0; --bit) {
    const auto add = [&](bool inverse) {
      drawn.pictures.push_back({axis, [=](double t) {
                                  const int n = static_cast<int>(t / cell_px);
                                  const bool lit = ((gray ? n ^ (n >> 1) : n) >> bit & 1) != 0;
                                  return lit != inverse ? 1.0 : 0.0;
                                }});
    };
    if (complements < 0) add(true);
    add(false);
    if (complements > 0) add(true);
  }
}

void add_waves(Drawn& drawn, int axis, const std::vector<double>& periods_px, bool backward,
               double phase_deg) {
  for (const double period_px : periods_px) {
    for (int step = 0; step < drawn.steps; ++step) {
      const double turns = (backward ? -1.0 : 1.0) * step / drawn.steps + phase_deg / 360.0;
      drawn.pictures.push_back({axis, [=](double t) {
                                  return 0.5 +
                                         0.5 * std::cos(2.0 * std::numbers::pi * (t / period_px - turns));
                                }});
    }
  }
}

std::vector<std::string> order_of(Random& random, std::vector<std::string> blocks) {
  const int solids = whole(random, 0, 3);  // none, white, white and black, white and black
  if (solids > 0) blocks.emplace_back("white");
  if (solids > 1) blocks.emplace_back("black");
  std::ranges::shuffle(blocks, random);
  return blocks;
}

Drawn draw(Random& random, int kind) {
  constexpr std::array<std::array<int, 2>, 5> kSizes{{{64, 48}, {128, 96}, {100, 60}, {96, 40}, {160, 90}}};
  Drawn drawn;
  const auto& size = kSizes[whole(random, 0, 4)];
  drawn.width_px = size[0], drawn.height_px = size[1];
  const bool gray = kind != 1, fringes_alone = kind == 2 || kind == 3, beside = kind == 4 || kind == 5;
  // Complements of a binary code before it look like a mirrored view.
  const int complements = whole(random, gray ? -1 : 0, 1) * (fringes_alone ? 0 : 1);
  const bool backward = whole(random, 0, 1) == 1;
  std::vector<double> periods_px;
  double cell_px = 1.0, phase_deg = 0.0;
  drawn.steps = fringes_alone || beside ? std::array{3, 4, 5, 6, 8}[whole(random, 0, 4)] : 0;
  if (kind == 2) {  // each several times shorter than the one before
    periods_px = {160.0};
    const double ratio = between(random, 3.0, 5.0);
    for (int wave = whole(random, 0, 2); wave > 0 && periods_px.back() / ratio > 6.0; --wave)
      periods_px.push_back(periods_px.back() / ratio);
  } else if (kind == 3) {  // heterodyne: nearly alike
    periods_px = {10.0, 11.0, 12.0};
    periods_px.resize(whole(random, 2, 3));
  } else if (beside) {
    periods_px = {whole(random, 0, 1) == 0 ? 16.0 : 12.0};
    cell_px = kind == 5 ? 0.5 * periods_px.front() : periods_px.front();
    phase_deg = whole(random, 0, 1) * 360.0 / drawn.steps;
  }
  drawn.fringes = fringes_alone || beside;
  std::vector<std::string> blocks{"columns", "rows"};
  if (beside) blocks.insert(blocks.end(), {"fringe-columns", "fringe-rows"});
  const std::vector<std::string> order = order_of(random, blocks);
  for (const std::string& block : order) {
    const int axis = block.ends_with("rows") ? 1 : 0;
    if (block == "white" || block == "black") {
      drawn.pictures.push_back({-1, [light = block == "white" ? 1.0 : 0.0](double) { return light; }});
    } else if (fringes_alone || block.starts_with("fringe")) {
      add_waves(drawn, axis, periods_px, backward, phase_deg);
    } else {
      add_code(drawn, axis, gray, cell_px, complements);
    }
  }
  std::vector<std::string> periods;
  for (const double period_px : periods_px) {
    drawn.facts.periods.push_back({.value = period_px, .in_px = true});
    periods.push_back(fmt::format("{}px", period_px));
  }
  if (fringes_alone) drawn.facts.backward = backward;  // pictures of fringes alone do not show it
  drawn.options = fmt::format("--layout {} --order {}",
                              fringes_alone ? "phase-shift"
                              : gray        ? "opencv-graycode"
                                            : "binary",
                              fmt::join(order, ","));
  if (!fringes_alone)
    drawn.options += fmt::format(" --inverse {}", complements == 0  ? "none"
                                                  : complements > 0 ? "after"
                                                                    : "before");
  if (cell_px != 1.0) drawn.options += fmt::format(" --cell {:.6g}", cell_px);
  if (drawn.fringes) {
    drawn.options += fmt::format(" --steps {} --periods {} --shift {}", drawn.steps, fmt::join(periods, ","),
                                 backward ? "backward" : "forward");
  }
  if (phase_deg != 0.0) drawn.options += fmt::format(" --phase {:.6g}", phase_deg);
  return drawn;
}

struct Camera {
  double noise = 1.0, gain = 1.0, gamma = 1.0, wander = 0.0;
  double share_lit = 1.0;  // of a side of the frame; the rest is dark
  bool mirrored = false;
};

// What went wrong with a photograph.
enum class Fault { kNone, kBlack, kWhite, kRepeated, kFlat };

double code_of(const Camera& camera, double light, double brightness, double exposure, Random& random) {
  std::normal_distribution<double> noise(0.0, camera.noise / 255.0);
  const double linear = camera.gain * exposure * (0.02 + brightness * light);
  return std::clamp(std::round(255.0 * (std::pow(linear, 1.0 / camera.gamma) + noise(random))) / 255.0, 0.0,
                    1.0);
}

StackSamples photographed(const Drawn& drawn, const Camera& camera, const std::vector<Fault>& faults,
                          Random& random) {
  constexpr double kScale = 2.5;  // px of the camera to one of the monitor
  constexpr int kLines = 64;
  const std::array<double, 2> sides_px{kScale * drawn.width_px, kScale * drawn.height_px};
  StackSamples samples{.width_px = static_cast<int>(sides_px[0] / camera.share_lit),
                       .height_px = static_cast<int>(sides_px[1] / camera.share_lit),
                       .bits = 8,
                       .rows = {},
                       .columns = {}};
  samples.rows = {kLines, samples.width_px, {}};
  samples.columns = {kLines, samples.height_px, {}};
  for (size_t i = 0; i < drawn.pictures.size(); ++i) {
    const Picture& picture = drawn.pictures[faults[i] == Fault::kRepeated && i > 0 ? i - 1 : i];
    const double exposure = 1.0 + between(random, -camera.wander, camera.wander);
    for (const int along : {0, 1}) {
      const SampledLines& lines = along == 0 ? samples.rows : samples.columns;
      std::vector<float> codes;
      for (int line = 0; line < kLines; ++line) {
        for (int at = 0; at < lines.length_px; ++at) {
          // Along the line, and across it.
          const std::array<double, 2> sides{along == 0 ? sides_px[0] : sides_px[1],
                                            along == 0 ? sides_px[1] : sides_px[0]};
          const double across = (line + 0.5) / kLines / camera.share_lit * sides[1];
          double light = 0.0;
          for (const double blur_px : {-0.7, 0.0, 0.7}) {
            const std::array<double, 2> place{at + 0.5 + blur_px, across};
            if (place[0] < 0.0 || place[0] >= sides[0] || place[1] >= sides[1]) continue;
            const int axis = picture.axis == -1 ? along : picture.axis;
            double t = place[axis == along ? 0 : 1] / kScale;
            if (camera.mirrored && axis == 0) t = drawn.width_px - t;
            light += picture.light(t) / 3.0;
          }
          const bool lit = at < sides[0] && across < sides[1];
          if (faults[i] == Fault::kBlack) light = 0.0;
          if (faults[i] == Fault::kWhite) light = lit ? 1.0 : 0.0;
          if (faults[i] == Fault::kFlat) light = lit ? 0.5 : 0.0;
          const double brightness = 0.6 + 0.2 * std::sin(0.05 * at) + 0.1 * std::cos(0.3 * line);
          codes.push_back(static_cast<float>(code_of(camera, light, brightness, exposure, random)));
        }
      }
      (along == 0 ? samples.rows : samples.columns).codes.push_back(std::move(codes));
    }
  }
  return samples;
}

// A tenth of the photographs, of one layout in three.
std::vector<Fault> faults_of(const Drawn& drawn, Random& random) {
  std::vector<Fault> faults(drawn.pictures.size(), Fault::kNone);
  if (whole(random, 0, 2) > 0) return faults;
  constexpr std::array kFaults{Fault::kBlack, Fault::kWhite, Fault::kRepeated, Fault::kFlat};
  const int count = static_cast<int>(drawn.pictures.size()) / 10;
  for (int k = 0; k < count; ++k) {
    const size_t at = whole(random, 0, static_cast<int>(faults.size()) - 1);
    faults[at] = kFaults[whole(random, 0, 3)];
  }
  return faults;
}

TEST(LayoutGenerator, LayoutsAreRightOrAskedAbout) {
  constexpr int kLayouts = 48;
  int right = 0, asked = 0;
  for (int seed = 0; seed < kLayouts; ++seed) {
    Random random(static_cast<unsigned>(seed));
    const Drawn drawn = draw(random, seed % 6);
    const Camera camera{.noise = between(random, 0.3, 4.0),
                        .gain = whole(random, 0, 2) == 0 && !drawn.fringes ? 2.5 : 1.0,
                        .gamma = between(random, 1.0, drawn.fringes ? 1.6 : 2.4),
                        .wander = drawn.fringes ? 0.03 : 0.15,
                        .share_lit = between(random, 0.3, 0.95),
                        .mirrored = whole(random, 0, 3) == 0};
    const std::vector<Fault> faults = faults_of(drawn, random);
    std::vector<std::string> files;
    for (size_t i = 0; i < drawn.pictures.size(); ++i) files.push_back(fmt::format("{:03d}.png", i));
    v1::Monitor monitor;
    monitor.set_width_px(drawn.width_px);
    monitor.set_height_px(drawn.height_px);
    const LayoutGuess guess =
        guess_layout(photographed(drawn, camera, faults, random), files, monitor, drawn.facts);
    if (!guess.layout.ok()) {
      ++asked;
      std::cout << fmt::format("{} {} ({} bad): {}\n", seed, drawn.options,
                               std::ranges::count_if(faults, [](Fault f) { return f != Fault::kNone; }),
                               std::string(guess.layout.status().message()));
      continue;
    }
    EXPECT_EQ(options_of(*guess.layout), drawn.options) << "seed " << seed;
    right += options_of(*guess.layout) == drawn.options ? 1 : 0;
  }
  std::cout << fmt::format("{} of {} right, {} asked about\n", right, kLayouts, asked);
  EXPECT_GE(right, kLayouts * 2 / 3);  // 174 of the first 200; the others were asked about
}

}  // namespace
}  // namespace glasswing
