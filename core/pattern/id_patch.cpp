#include "core/pattern/id_patch.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>

namespace glasswing {
namespace {

// All dark, all lit, then each bit of the column's number and its complement: no two cells have the same
// sequence, and each is lit as often as dark.
constexpr std::array<std::uint16_t, 10> kLearningIds = {0x0000, 0xffff, 0xaaaa, 0x5555, 0xcccc,
                                                        0x3333, 0xf0f0, 0x0f0f, 0xff00, 0x00ff};
constexpr float kMinContrast = 0.01f * 65535.0f;  // of a pixel's sum, for each of its channels
constexpr float kMaxDeviation = 0.25f;            // of a pixel's contrast, from its dark or lit level
constexpr size_t kMaxPixels = 64;                 // of a cell
// Of full contrast: nine tenths of one picture mixed with a tenth of another is still doubtful.
constexpr double kSure = 0.8;

// Of a pixel's channels.
float sum_at(const Image16& frame, size_t at) {
  float sum = 0.0f;
  for (size_t c = 0; c < static_cast<size_t>(frame.channels); ++c)
    sum += static_cast<float>(frame.samples[at + c]);
  return sum;
}

bool is_lit(int cell, std::uint16_t id) {
  const bool bit = (id >> (cell / 2) & 1) != 0;
  return cell % 2 == 0 ? bit : !bit;
}

// The cell with this sequence, lit or dark by learning id; -1: none.
int cell_of(unsigned sequence) {
  for (int cell = 0; cell < 2 * IdPatch::kBits; ++cell) {
    unsigned own = 0;
    for (size_t i = 0; i < kLearningIds.size(); ++i) own |= (is_lit(cell, kLearningIds[i]) ? 1u : 0u) << i;
    if (own == sequence) return cell;
  }
  return -1;
}

}  // namespace

std::span<const std::uint16_t> patch_learning_ids() {
  return kLearningIds;
}

void IdPatch::draw(std::uint16_t id, RadianceImage& picture) const {
  assert(picture.width_px == width_px && first_row + rows <= picture.height_px);
  for (int y = first_row; y < first_row + rows; ++y) {
    const double v = 2.0 * (y - first_row + 0.5) / rows;
    for (int x = 0; x < width_px; ++x) {
      const double u = kBits * (x + 0.5) / width_px;
      const int column = static_cast<int>(u), row = static_cast<int>(v);
      const bool inside = std::abs(u - column - 0.5) < 0.375 && std::abs(v - row - 0.5) < 0.375;
      const float light = inside && is_lit(2 * column + row, id) ? 1.0f : 0.0f;
      for (int c = 0; c < 3; ++c) picture.at(x, y, c) = light;
    }
  }
}

absl::StatusOr<PatchReader> PatchReader::learn(std::span<const Image16> frames) {
  assert(frames.size() == kLearningIds.size());
  std::array<int, 1 << kLearningIds.size()> cell_by_sequence;
  for (unsigned sequence = 0; sequence < cell_by_sequence.size(); ++sequence)
    cell_by_sequence[sequence] = cell_of(sequence);
  PatchReader reader;
  bool dark_everywhere = true;
  reader.sample_count_ = frames.front().samples.size();
  const int channels = frames.front().channels;
  for (size_t at = 0; at < reader.sample_count_; at += static_cast<size_t>(channels)) {
    std::array<float, kLearningIds.size()> light;
    for (size_t i = 0; i < light.size(); ++i) light[i] = sum_at(frames[i], at);
    const auto [low, high] = std::minmax_element(light.begin(), light.end());
    const float contrast = *high - *low;
    if (contrast < kMinContrast * static_cast<float>(channels)) continue;
    dark_everywhere = false;
    float dark = 0.0f, lit = 0.0f;
    unsigned sequence = 0;
    bool clear = true;
    for (size_t i = 0; i < light.size() && clear; ++i) {
      const bool on = light[i] - *low > 0.5f * contrast;
      clear = std::min(light[i] - *low, *high - light[i]) < kMaxDeviation * contrast;
      sequence |= (on ? 1u : 0u) << i;
      (on ? lit : dark) += 2.0f * light[i] / static_cast<float>(light.size());
    }
    const int cell = cell_by_sequence[sequence];
    if (clear && cell >= 0)
      reader.cells_[static_cast<size_t>(cell)].push_back({.at = at, .dark = dark, .lit = lit});
  }
  if (dark_everywhere) return absl::NotFoundError("the camera does not see the id patch");
  for (int cell = 0; cell < kCells; ++cell) {
    std::vector<Pixel>& pixels = reader.cells_[static_cast<size_t>(cell)];
    if (pixels.empty()) {
      return absl::FailedPreconditionError(fmt::format("the camera sees no {} cell of bit {} of the id patch",
                                                       cell % 2 == 0 ? "upper" : "lower", cell / 2));
    }
    std::sort(pixels.begin(), pixels.end(),
              [](const Pixel& a, const Pixel& b) { return a.lit - a.dark > b.lit - b.dark; });
    // Noise occasionally matches a cell's sequence, but with low contrast.
    const float strongest = pixels.front().lit - pixels.front().dark;
    while (pixels.size() > kMaxPixels || pixels.back().lit - pixels.back().dark < 0.5f * strongest)
      pixels.pop_back();
  }
  return reader;
}

double PatchReader::level(int cell, const Image16& frame) const {
  double above = 0.0, contrast = 0.0;
  for (const Pixel& pixel : cells_[static_cast<size_t>(cell)]) {
    const auto dark = static_cast<double>(pixel.dark), lit = static_cast<double>(pixel.lit);
    above += static_cast<double>(sum_at(frame, pixel.at)) - 0.5 * (dark + lit);
    contrast += 0.5 * (lit - dark);
  }
  return above / contrast;
}

std::optional<std::uint16_t> PatchReader::read(const Image16& frame) const {
  if (frame.samples.size() != sample_count_) return std::nullopt;
  unsigned id = 0;
  for (int bit = 0; bit < IdPatch::kBits; ++bit) {
    const double own = level(2 * bit, frame), other = level(2 * bit + 1, frame);
    if (std::min(std::abs(own), std::abs(other)) < kSure || (own > 0.0) == (other > 0.0)) return std::nullopt;
    id |= (own > 0.0 ? 1u : 0u) << bit;
  }
  return static_cast<std::uint16_t>(id);
}

}  // namespace glasswing
