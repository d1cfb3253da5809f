#include "core/composite/light_paths.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <queue>

#include "core/composite/stmap.h"

namespace glasswing {
namespace {

constexpr float kNearPx = 4.0f;
constexpr float kMaxDistance = 8.0f;  // in l
constexpr float kRift = 0.5f;         // neighbours that differ more do not pass on numbers
constexpr std::uint32_t kNoRegion = ~0u;

float width_px(const Mode& mode) {
  return std::sqrt(std::max(0.5f * (mode.xx_px2 + mode.yy_px2), 0.0f));
}

// The modes of a node that take part, and their places.
struct Node {
  std::array<const Mode*, kMaxModes> modes;
  std::array<std::int8_t, kMaxModes> places;
  size_t count = 0;
};

// partner[b]: the mode of a that b matches, or -1.
struct Match {
  std::array<int, kMaxModes> partner;
  float difference = 0.0f;
};

Match match(const Node& a, const Node& b) {
  struct Pair {
    float distance;  // in l
    size_t a, b;
  };
  std::array<Pair, kMaxModes * kMaxModes> pairs;
  size_t count = 0;
  for (size_t i = 0; i < a.count; ++i) {
    for (size_t k = 0; k < b.count; ++k) {
      const Mode &from = *a.modes[i], &to = *b.modes[k];
      const float distance =
          std::hypot(from.x_px - to.x_px, from.y_px - to.y_px) / (kNearPx + width_px(from) + width_px(to));
      if (distance < kMaxDistance) pairs[count++] = {distance, i, k};
    }
  }
  std::sort(pairs.begin(), pairs.begin() + count,
            [](const Pair& one, const Pair& other) { return one.distance < other.distance; });
  Match found;
  found.partner.fill(-1);
  std::array<bool, kMaxModes> taken{};
  float whole = 0.0f, matched = 0.0f;
  for (size_t i = 0; i < a.count; ++i) whole += a.modes[i]->weight;
  for (size_t k = 0; k < b.count; ++k) whole += b.modes[k]->weight;
  for (size_t p = 0; p < count; ++p) {
    const Pair& pair = pairs[p];
    if (taken[pair.a] || found.partner[pair.b] >= 0) continue;
    taken[pair.a] = true;
    found.partner[pair.b] = static_cast<int>(pair.a);
    matched += 2.0f * std::min(a.modes[pair.a]->weight, b.modes[pair.b]->weight) / (1.0f + pair.distance);
  }
  found.difference = 1.0f - matched / whole;
  return found;
}

}  // namespace

struct LightPaths::Spread {
  Spread(const Matte& of, int of_texture, std::vector<Slots>& numbered)
      : matte(of),
        texture(of_texture),
        channels(of.is_colourless() ? 1 : kChannels),
        width(of.width_px()),
        height(of.height_px()),
        slots(numbered),
        region(numbered.size(), kNoRegion) {}

  Node node_at(size_t index) const {
    const auto i = static_cast<int>(index);
    const auto modes = matte.modes(i / channels % width, i / channels / width, i % channels);
    Node node;
    for (size_t m = 0; m < modes.size(); ++m) {
      if (!is_plausible(modes[m]) || modes[m].texture != texture) continue;
      node.modes[node.count] = &modes[m];
      node.places[node.count++] = static_cast<std::int8_t>(m);
    }
    return node;
  }

  // The strongest comes first, for there is nothing to go by.
  void seed(size_t index, const Node& node) {
    std::array<size_t, kMaxModes> order;
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.begin() + node.count,
                     [&](size_t a, size_t b) { return node.modes[a]->weight > node.modes[b]->weight; });
    for (size_t p = 0; p < node.count; ++p) slots[index][p] = node.places[order[p]];
  }

  // Takes the numbers of a neighbour's matching modes; others get numbers that neither has.
  void number(size_t index, const Node& node, size_t from, const Node& neighbour) {
    const Match matched = match(neighbour, node);
    Slots& own = slots[index];
    const Slots& others = slots[from];
    for (size_t m = 0; m < node.count; ++m) {
      if (matched.partner[m] < 0) continue;
      const auto path = std::ranges::find(others, neighbour.places[matched.partner[m]]);
      own[path - others.begin()] = node.places[m];
    }
    for (size_t m = 0; m < node.count; ++m) {
      if (matched.partner[m] >= 0) continue;
      size_t path = 0;
      while (path < own.size() && (own[path] >= 0 || others[path] >= 0)) ++path;
      if (path == own.size()) path = static_cast<size_t>(std::ranges::find(own, -1) - own.begin());
      own[path] = node.places[m];
    }
  }

  template <class Each>
  void for_neighbours(size_t index, Each each) const {
    const auto i = static_cast<int>(index);
    const int c = i % channels, x = i / channels % width, y = i / channels / width;
    for (int other = 0; other < channels; ++other) {
      if (other != c) each(index - static_cast<size_t>(c) + static_cast<size_t>(other));
    }
    const auto step = static_cast<size_t>(channels), row = step * static_cast<size_t>(width);
    if (x > 0) each(index - step);
    if (x + 1 < width) each(index + step);
    if (y > 0) each(index - row);
    if (y + 1 < height) each(index + row);
  }

  void run() {
    struct Edge {
      float difference;
      size_t from, to;
      bool operator<(const Edge& other) const { return difference > other.difference; }
    };
    std::priority_queue<Edge> edges;
    const auto enter = [&](size_t index, const Node& node) {
      region[index] = static_cast<std::uint32_t>(light.size() - 1);
      for (size_t p = 0; p < slots[index].size(); ++p) {
        if (slots[index][p] < 0) continue;
        for (size_t m = 0; m < node.count; ++m) {
          if (node.places[m] == slots[index][p])
            light.back()[p] += static_cast<double>(node.modes[m]->weight);
        }
      }
      for_neighbours(index, [&](size_t to) {
        if (region[to] != kNoRegion) return;
        const Node next = node_at(to);
        if (next.count == 0) return;
        const float difference = match(node, next).difference;
        if (difference < kRift) edges.push({difference, index, to});
      });
    };
    for (size_t index = 0; index < slots.size(); ++index) {
      const Node node = node_at(index);
      if (region[index] != kNoRegion || node.count == 0) continue;
      light.emplace_back();
      seed(index, node);
      enter(index, node);
      while (!edges.empty()) {
        const Edge edge = edges.top();
        edges.pop();
        if (region[edge.to] != kNoRegion) continue;
        const Node next = node_at(edge.to);
        number(edge.to, next, edge.from, node_at(edge.from));
        enter(edge.to, next);
      }
    }
  }

  // Renumbers each region's paths by their light.
  void order_by_light() {
    std::vector<std::array<size_t, kMaxModes>> place(light.size());
    for (size_t r = 0; r < light.size(); ++r) {
      std::array<size_t, kMaxModes> order;
      std::iota(order.begin(), order.end(), 0u);
      std::ranges::stable_sort(order, [&](size_t a, size_t b) { return light[r][a] > light[r][b]; });
      for (size_t p = 0; p < order.size(); ++p) place[r][order[p]] = p;
    }
    for (size_t i = 0; i < slots.size(); ++i) {
      if (region[i] == kNoRegion) continue;
      const Slots before = slots[i];
      for (size_t p = 0; p < before.size(); ++p) slots[i][place[region[i]][p]] = before[p];
    }
  }

  const Matte& matte;
  const int texture, channels, width, height;
  std::vector<Slots>& slots;
  std::vector<std::uint32_t> region;                 // by node
  std::vector<std::array<double, kMaxModes>> light;  // [region][path]
};

LightPaths::LightPaths(const Matte& matte, int texture) : matte_(matte) {
  Slots none;
  none.fill(-1);
  const size_t pixels = static_cast<size_t>(matte.width_px()) * matte.height_px();
  slots_.assign(pixels * (matte.is_colourless() ? 1 : kChannels), none);
  Spread spread(matte, texture, slots_);
  spread.run();
  spread.order_by_light();
  for (const Slots& slots : slots_) {
    for (int p = count_; p < kMaxModes; ++p) {
      if (slots[p] >= 0) count_ = p + 1;
    }
  }
}

const Mode* LightPaths::mode(int x, int y, int channel, int path) const {
  const size_t pixel = static_cast<size_t>(y) * matte_.width_px() + x;
  const size_t node = matte_.is_colourless() ? pixel : pixel * kChannels + static_cast<size_t>(channel);
  const std::int8_t place = slots_[node][path];
  return place < 0 ? nullptr : &matte_.modes(x, y, channel)[place];
}

}  // namespace glasswing
