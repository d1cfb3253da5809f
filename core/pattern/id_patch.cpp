#include "core/pattern/id_patch.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

#include "core/base/median.h"

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
// Of the noise: 12 sd are out of reach of ten samples.
constexpr float kSureContrast = 12.0f;
// Of a pixel's contrast: pairs of ids may differ by so much. A cell that was lit twice in one pair and never
// in another makes 2; noise of a twelfth of the contrast, sqrt(2) times 2.3 sd, makes 0.3.
constexpr float kMaxPairDifference = 0.5f;
// Pixels that contradict: so many, and such a share of those with a sure contrast. If two ids are swapped
// half the cells contradict; a lag of an id leaves one cell of 32 that does not.
constexpr int kMinContradicting = 8;
constexpr double kMaxContradicting = 0.125;

using Light = std::array<float, kLearningIds.size()>;

// Of a pixel's channels.
float sum_at(const Image16& frame, size_t at) {
  float sum = 0.0f;
  for (size_t c = 0; c < static_cast<size_t>(frame.channels); ++c)
    sum += static_cast<float>(frame.samples[at + c]);
  return sum;
}

// A pixel's light by learning id.
Light light_at(std::span<const Image16> frames, size_t at) {
  Light light;
  for (size_t i = 0; i < light.size(); ++i) light[i] = sum_at(frames[i], at);
  return light;
}

bool pairs_differ(const Light& light, float contrast) {
  float least = light[0] + light[1], most = least;
  for (size_t i = 2; i < light.size(); i += 2) {
    least = std::min(least, light[i] + light[i + 1]);
    most = std::max(most, light[i] + light[i + 1]);
  }
  return most - least > kMaxPairDifference * contrast;
}

// From which on a pixel's contrast is no noise. Most pixels see no patch, and change in few of the frames:
// the median of what they change by from frame to frame is 0.95 sd of Gaussian noise.
float sure_contrast(std::span<const Image16> frames) {
  const size_t channels = frames.front().channels;
  std::vector<float> changes;
  for (size_t at = 0; at < frames.front().samples.size(); at += channels) {
    const Light light = light_at(frames, at);
    std::array<float, kLearningIds.size() - 1> steps;
    for (size_t i = 0; i < steps.size(); ++i) steps[i] = std::abs(light[i + 1] - light[i]);
    changes.push_back(median_in_place(std::span<float>(steps)));
  }
  return kSureContrast * median_in_place(std::span<float>(changes));
}

// Enough pixels change otherwise than the ids do.
bool contradicts(std::span<const Image16> frames) {
  const size_t channels = frames.front().channels;
  const float sure = std::max(kMinContrast * static_cast<float>(channels), sure_contrast(frames));
  int sure_count = 0, contradicting = 0;
  for (size_t at = 0; at < frames.front().samples.size(); at += channels) {
    const Light light = light_at(frames, at);
    const auto [low, high] = std::minmax_element(light.begin(), light.end());
    if (*high - *low < sure) continue;
    ++sure_count;
    if (pairs_differ(light, *high - *low)) ++contradicting;
  }
  return contradicting >= kMinContradicting && contradicting > kMaxContradicting * sure_count;
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
    const Light light = light_at(frames, at);
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
    if (clear && cell >= 0) reader.cells_[cell].push_back({.at = at, .dark = dark, .lit = lit});
  }
  if (dark_everywhere) return absl::NotFoundError("the camera does not see the id patch");
  for (std::vector<Pixel>& pixels : reader.cells_) keep_strongest(pixels);
  // One frame of another id would spoil the sequences of half the cells.
  if (std::ranges::all_of(reader.cells_, [](const auto& pixels) { return !pixels.empty(); })) return reader;
  if (contradicts(frames))
    return absl::OutOfRangeError("the id patch changes at other times than are reported");
  const int seen = std::popcount(reader.bits());
  if (seen >= IdPatch::kMinBits) return reader;
  return absl::FailedPreconditionError(
      fmt::format("the camera sees only {} of the {} bits of the id patch; it must see {}", seen,
                  IdPatch::kBits, IdPatch::kMinBits));
}

void PatchReader::keep_strongest(std::vector<Pixel>& pixels) {
  if (pixels.empty()) return;
  std::sort(pixels.begin(), pixels.end(),
            [](const Pixel& a, const Pixel& b) { return a.lit - a.dark > b.lit - b.dark; });
  // Noise occasionally matches a cell's sequence, but with low contrast.
  const float strongest = pixels.front().lit - pixels.front().dark;
  while (pixels.size() > kMaxPixels || pixels.back().lit - pixels.back().dark < 0.5f * strongest)
    pixels.pop_back();
}

std::uint16_t PatchReader::bits() const {
  unsigned bits = 0;
  for (int bit = 0; bit < IdPatch::kBits; ++bit) {
    if (sees(2 * bit) || sees(2 * bit + 1)) bits |= 1u << bit;
  }
  return static_cast<std::uint16_t>(bits);
}

double PatchReader::level(int cell, const Image16& frame) const {
  double above = 0.0, contrast = 0.0;
  for (const Pixel& pixel : cells_[cell]) {
    const auto dark = static_cast<double>(pixel.dark), lit = static_cast<double>(pixel.lit);
    above += sum_at(frame, pixel.at) - 0.5 * (dark + lit);
    contrast += 0.5 * (lit - dark);
  }
  return above / contrast;
}

std::optional<bool> PatchReader::read_bit(int bit, const Image16& frame) const {
  std::optional<bool> found;
  for (const bool upper : {true, false}) {
    const int cell = 2 * bit + (upper ? 0 : 1);
    if (!sees(cell)) continue;
    const double own = level(cell, frame);
    const bool one = own > 0.0 ? upper : !upper;
    if (std::abs(own) < kSure || (found && *found != one)) return std::nullopt;
    found = one;
  }
  return found;
}

std::optional<std::uint16_t> PatchReader::read(const Image16& frame) const {
  if (frame.samples.size() != sample_count_) return std::nullopt;
  const unsigned visible = bits();
  unsigned id = 0;
  for (int bit = 0; bit < IdPatch::kBits; ++bit) {
    if ((visible >> bit & 1) == 0) continue;
    const std::optional<bool> one = read_bit(bit, frame);
    if (!one) return std::nullopt;
    id |= (*one ? 1u : 0u) << bit;
  }
  return static_cast<std::uint16_t>(id);
}

bool differs(const Image16& frame, const Image16& other) {
  assert(frame.samples.size() == other.samples.size());
  const float least = kMinContrast * static_cast<float>(frame.channels);
  for (size_t at = 0; at < frame.samples.size(); at += static_cast<size_t>(frame.channels)) {
    if (std::abs(sum_at(frame, at) - sum_at(other, at)) >= least) return true;
  }
  return false;
}

}  // namespace glasswing
