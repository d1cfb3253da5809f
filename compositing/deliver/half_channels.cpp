#include "compositing/deliver/half_channels.h"

#include <half.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace glasswing {
namespace {

bool in(std::string_view layer, std::span<const std::string_view> layers) {
  return std::ranges::find(layers, layer) != layers.end();
}

bool is_light(std::string_view layer) {
  static constexpr std::array<std::string_view, 4> kLight{"preview", "F", "coverage", "weight"};
  return in(layer, kLight);
}
bool is_error(std::string_view layer) {
  static constexpr std::array<std::string_view, 2> kErrors{"weight_sd", "centre_sd"};
  return in(layer, kErrors);
}

}  // namespace

std::string_view layer_of(std::string_view channel) {
  const size_t first = channel.find('.'), last = channel.rfind('.');
  return first == std::string_view::npos ? "preview" : channel.substr(first + 1, last - first - 1);
}

HalfChannels::HalfChannels(const std::vector<ExrPart>& parts) {
  for (const ExrPart& part : parts) {
    names_.push_back(part.channels);
    good_.emplace_back(part.channels.size(), true);
  }
}

void HalfChannels::look(const MatteBlock& block, int rows, int width_px) {
  const auto count = static_cast<size_t>(rows) * width_px;
  for (size_t part = 0; part < names_.size(); ++part) {
    for (size_t c = 0; c < names_[part].size(); ++c) {
      if (!good_[part][c]) continue;
      const std::string_view layer = layer_of(names_[part][c]);
      const bool error = is_error(layer), light = error || is_light(layer);
      const std::span<const float> samples(block.planes(part)[c], count);
      good_[part][c] = std::ranges::all_of(samples, [&](float sample) {
        const float stored = Imath::half(sample);
        if (!light) return stored == sample;
        return std::abs(stored - sample) <= std::max(kHalfError * std::abs(sample), kLeastHalfError) &&
               (!error || (stored > 0.0f) == (sample > 0.0f));
      });
    }
  }
}

void HalfChannels::join(const HalfChannels& other) {
  for (size_t part = 0; part < good_.size(); ++part) {
    for (size_t c = 0; c < good_[part].size(); ++c) good_[part][c] = good_[part][c] && other.good_[part][c];
  }
}

std::vector<std::string> HalfChannels::layers() const {
  std::vector<std::string> layers;
  for (size_t part = 0; part < names_.size(); ++part) {
    for (size_t c = 0; c < names_[part].size(); ++c) {
      const std::string_view layer = layer_of(names_[part][c]);
      if (good_[part][c] && std::ranges::find(layers, layer) == layers.end()) layers.emplace_back(layer);
    }
  }
  return layers;
}

}  // namespace glasswing
