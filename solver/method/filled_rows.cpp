#include "solver/method/filled_rows.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

namespace glasswing {
namespace {

constexpr int kRounds = 3;  // of pixels that have bad ones all around: those filled before count as good

// What a pixel is made of: pixels of the stack.
struct Recipe {
  size_t pixel = 0;
  std::vector<std::pair<size_t, float>> parts;
};

class Neighbours {
 public:
  Neighbours(const FrameStack& stack, const std::vector<int>& pixels)
      : width_(stack.width_px), height_(stack.row_count), step_(stack.mosaic ? 2 : 1) {
    good_.assign(static_cast<size_t>(width_) * height_, true);
    for (const int pixel : pixels) {
      const int y = pixel / width_ - stack.first_row;
      if (y < 0 || y >= height_) continue;
      left_.push_back(index(pixel % width_, y));
      good_[left_.back()] = false;
    }
  }

  std::vector<Recipe> recipes() {
    std::vector<Recipe> recipes;
    for (int round = 0; round < kRounds && !left_.empty(); ++round) {
      std::vector<size_t> later;
      const size_t first = recipes.size();
      for (const size_t pixel : left_) {
        Recipe recipe = recipe_of(pixel);
        if (recipe.parts.empty()) {
          later.push_back(pixel);
        } else {
          recipes.push_back(std::move(recipe));
        }
      }
      for (size_t i = first; i < recipes.size(); ++i) good_[recipes[i].pixel] = true;
      left_ = std::move(later);
    }
    return recipes;
  }

 private:
  size_t index(int x, int y) const { return static_cast<size_t>(y) * width_ + x; }

  // The good pixel so many steps away.
  std::optional<size_t> good_at(size_t pixel, int dx, int dy) const {
    const int x = static_cast<int>(pixel) % width_ + step_ * dx,
              y = static_cast<int>(pixel) / width_ + step_ * dy;
    if (x < 0 || x >= width_ || y < 0 || y >= height_ || !good_[index(x, y)]) return std::nullopt;
    return index(x, y);
  }

  Recipe recipe_of(size_t pixel) const {
    Recipe recipe{.pixel = pixel, .parts = {}};
    const auto take = [&](std::optional<size_t> from, float weight) {
      if (from) recipe.parts.emplace_back(*from, weight);
    };
    for (const auto& [ax, ay] : {std::pair{1, 0}, {0, 1}}) {
      const std::optional<size_t> before = good_at(pixel, -ax, -ay), after = good_at(pixel, ax, ay);
      if (!before || !after) continue;
      std::vector<std::array<size_t, 3>> lines;  // of three, on either side
      for (const int side : {-1, 1}) {
        const auto first = good_at(pixel, side * ay - ax, side * ax - ay),
                   middle = good_at(pixel, side * ay, side * ax),
                   last = good_at(pixel, side * ay + ax, side * ax + ay);
        if (first && middle && last) lines.push_back({*first, *middle, *last});
      }
      if (lines.empty()) continue;
      const float share = 0.5f / static_cast<float>(lines.size());
      take(before, 0.5f);
      take(after, 0.5f);
      for (const auto& [first, middle, last] : lines) {
        take(first, -share);
        take(middle, 2.0f * share);
        take(last, -share);
      }
      return recipe;
    }
    for (const auto& [dx, dy] : {std::pair{1, 0}, {0, 1}, {1, 1}, {1, -1}}) {
      const std::optional<size_t> before = good_at(pixel, -dx, -dy), after = good_at(pixel, dx, dy);
      if (!before || !after || (dx * dy != 0 && !recipe.parts.empty())) continue;
      take(before, 1.0f);
      take(after, 1.0f);
    }
    if (recipe.parts.empty()) {
      for (const int dy : {-1, 0, 1}) {
        for (const int dx : {-1, 0, 1}) take(good_at(pixel, dx, dy), 1.0f);
      }
    }
    for (auto& [from, weight] : recipe.parts) weight /= static_cast<float>(recipe.parts.size());
    return recipe;
  }

  int width_, height_, step_;
  std::vector<bool> good_;
  std::vector<size_t> left_;  // to be filled
};

// What is saturated on average stays so.
std::uint16_t mix_of(const std::vector<std::uint16_t>& samples, const Recipe& recipe, size_t lanes,
                     size_t lane) {
  float sum = 0.5f, saturated = 0.0f;
  for (const auto& [from, weight] : recipe.parts) {
    const std::uint16_t sample = samples[from * lanes + lane];
    sum += weight * static_cast<float>(std::min(sample, kSaturatedCode));
    if (sample >= kSaturatedCode) saturated += weight;
  }
  if (saturated > 0.5f) return 65535;
  return static_cast<std::uint16_t>(std::clamp(sum, 0.0f, static_cast<float>(kSaturatedCode - 1)));
}

struct Filled {
  std::shared_ptr<const void> source;
  std::vector<std::vector<std::uint16_t>> frames;
};

}  // namespace

int filled_reach(bool mosaic) {
  return mosaic ? 2 : 1;
}

FrameStack filled_rows(const FrameStack& stack, const std::vector<int>& pixels) {
  const std::vector<Recipe> recipes = Neighbours(stack, pixels).recipes();
  if (recipes.empty()) return stack;
  FrameStack rows = stack;
  const auto owned = std::make_shared<Filled>();
  owned->source = stack.owner;
  owned->frames.resize(stack.rows.size());
  const size_t lanes = stack.samples_per_pixel();
  for (size_t f = 0; f < stack.rows.size(); ++f) {
    if (stack.rows[f].empty()) continue;
    std::vector<std::uint16_t>& own = owned->frames[f];
    own.assign(stack.rows[f].begin(), stack.rows[f].end());
    for (const Recipe& recipe : recipes) {
      for (size_t lane = 0; lane < lanes; ++lane)
        own[recipe.pixel * lanes + lane] = mix_of(own, recipe, lanes, lane);
    }
    rows.rows[f] = own;
  }
  rows.owner = owned;
  return rows;
}

}  // namespace glasswing
