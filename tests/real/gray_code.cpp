// real-gray-code ARCHIVE MATTE PICTURES: compares a matte of Gray-coded photographs with their plain
// decoding.
//
// Bit b of the Gray code of x is lit from 2^b to 3 2^b, and so on every 4 2^b px: bars of 2^(b+1) px with an
// offset of 2^b. A bit is 1 where its picture is brighter than the complement. Where every stripe down to 8
// px has a contrast of 8 codes in some channel, on both axes, the code without its last bits gives the 4 px
// that a pixel sees; finer stripes with that contrast narrow it further. The box's centre must lie within
// half of the box's own side of the middle of that, on both axes, on 95 % of those pixels.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include "core/base/status.h"
#include "core/image/image_file.h"
#include "core/import/mapped_archive.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

constexpr int kMinContrast = 8;  // codes of 8 bits
constexpr int kSureBit = 2;      // stripes of 8 px
constexpr double kMinShare = 0.95;
constexpr float kLit = 0.0015f;  // of full scale; pixels with less light are not drawn

// The 8-bit sRGB code of a linear sample.
std::vector<std::uint8_t> codes_of_samples() {
  std::vector<std::uint8_t> codes(65536);
  for (size_t sample = 0; sample < codes.size(); ++sample) {
    const double light = static_cast<double>(sample) / 65535.0;
    const double code = light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1.0 / 2.4) - 0.055;
    codes[sample] = static_cast<std::uint8_t>(std::lround(255.0 * code));
  }
  return codes;
}

// By bit, the frames of a stripe and its complement.
using Bits = std::map<int, std::array<int, 2>, std::greater<>>;

absl::StatusOr<Bits> bits_of(const v1::CaptureManifest& manifest, const std::string& orient) {
  Bits bits;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Stimulus& stimulus = manifest.frames(i).stimulus();
    if (stimulus.kind() != "square" || stimulus.orient() != orient) continue;
    const double bit = std::log2(stimulus.bar_width_px()) - 1.0;
    if (bit != std::floor(bit) || stimulus.offset_px() != 0.5 * stimulus.bar_width_px()) {
      return absl::InvalidArgumentError(
          fmt::format("{} shows no bit of a Gray code", manifest.frames(i).file()));
    }
    bits.try_emplace(static_cast<int>(bit), std::array{-1, -1}).first->second[stimulus.inverse() ? 1 : 0] = i;
  }
  for (const auto& [bit, frames] : bits) {
    if (frames[0] < 0 || frames[1] < 0)
      return absl::InvalidArgumentError(fmt::format("bit {} of {} must have two frames", bit, orient));
  }
  if (bits.empty() || bits.rbegin()->first > kSureBit)
    return absl::InvalidArgumentError(fmt::format("{} have no stripes of 8 px", orient));
  return bits;
}

// Decodes one row along one axis.
class Decoder {
 public:
  Decoder(const MappedArchive& archive, Bits bits) : archive_(archive), bits_(std::move(bits)) {}

  // The middle of each pixel's view, px; none if a stripe down to 8 px has too little contrast.
  std::vector<std::optional<double>> row(int y) const {
    const size_t width = archive_.manifest().camera().width_px();
    std::vector<int> place(width, 0), above(width, 0);  // code so far, in units of the last bit; that bit
    std::vector<int> last(width, bits_.begin()->first + 1);
    std::vector<bool> clear(width, true), done(width, false);
    for (const auto& [bit, frames] : bits_) {
      const auto lit = archive_.rows(frames[0], y, 1), dark = archive_.rows(frames[1], y, 1);
      for (size_t x = 0; x < width; ++x) {
        int contrast = 0, sum = 0;
        for (size_t c = 3 * x; c < 3 * x + 3; ++c) {
          const int difference = codes_[lit[c]] - codes_[dark[c]];
          contrast = std::max(contrast, std::abs(difference));
          sum += difference;
        }
        done[x] = done[x] || contrast < kMinContrast;
        if (done[x]) continue;
        above[x] ^= sum > 0 ? 1 : 0;
        place[x] = 2 * place[x] + above[x];
        last[x] = bit;
      }
    }
    std::vector<std::optional<double>> middles(width);
    for (size_t x = 0; x < width; ++x) {
      if (last[x] <= kSureBit) middles[x] = (place[x] + 0.5) * std::exp2(last[x]);
    }
    return middles;
  }

 private:
  const MappedArchive& archive_;
  const Bits bits_;
  const std::vector<std::uint8_t> codes_ = codes_of_samples();
};

// Red over yellow, green and blue to violet, as `share` goes from 0 to 1.
std::array<float, 3> hue(double share) {
  std::array<float, 3> colour{};
  const double sixth = 5.0 * std::clamp(share, 0.0, 1.0);
  for (size_t c = 0; c < 3; ++c) {
    const double from = std::fmod(sixth - 2.0 * static_cast<double>(c) + 9.0, 6.0) - 3.0;
    colour[c] = static_cast<float>(std::clamp(2.0 - std::abs(from), 0.0, 1.0));
  }
  return colour;
}

const Mode& strongest(const Matte& matte, int x, int y) {
  const Mode* best = &matte.modes(x, y, 0)[0];
  for (int c = 1; c < kChannels; ++c) {
    if (matte.modes(x, y, c)[0].weight > best->weight) best = &matte.modes(x, y, c)[0];
  }
  return *best;
}

absl::Status draw(const Matte& matte, const std::string& folder) {
  const v1::Monitor& monitor = matte.metadata.monitors(0);
  RadianceImage across(matte.width_px(), matte.height_px()), down = across, width = across;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      const Mode& mode = strongest(matte, x, y);
      if (mode.weight < kLit) continue;
      const auto bright = static_cast<float>(std::min(1.0, 0.2 + 2.0 * static_cast<double>(mode.weight)));
      const std::array<float, 3> x_hue = hue(static_cast<double>(mode.x_px) / monitor.width_px());
      const std::array<float, 3> y_hue = hue(static_cast<double>(mode.y_px) / monitor.height_px());
      const double side_px = std::sqrt(12.0 * static_cast<double>(std::max(mode.xx_px2, mode.yy_px2)));
      for (int c = 0; c < kChannels; ++c) {
        const size_t channel = c;
        across.at(x, y, c) = bright * x_hue[channel];
        down.at(x, y, c) = bright * y_hue[channel];
        width.at(x, y, c) = static_cast<float>(std::min(side_px / 32.0, 1.0));
      }
    }
  }
  GW_RETURN_IF_ERROR(write_radiance(folder + "/x.png", across, Encoding::kDisplay));
  GW_RETURN_IF_ERROR(write_radiance(folder + "/y.png", down, Encoding::kDisplay));
  return write_radiance(folder + "/width.png", width, Encoding::kDisplay);
}

absl::StatusOr<bool> check(const std::string& archive_path, const std::string& matte_path,
                           const std::string& pictures) {
  GW_ASSIGN_OR_RETURN(const auto archive, MappedArchive::open_interpolated(archive_path));
  GW_ASSIGN_OR_RETURN(const Matte matte, read_matte(matte_path));
  GW_ASSIGN_OR_RETURN(Bits across, bits_of(archive->manifest(), "vertical_bars"));
  GW_ASSIGN_OR_RETURN(Bits down, bits_of(archive->manifest(), "horizontal_bars"));
  const Decoder x_of(*archive, std::move(across)), y_of(*archive, std::move(down));
  double count = 0.0, agree = 0.0, unsolved = 0.0, lit = 0.0, flagged = 0.0;
  std::vector<double> off_px, half_px;
  for (int y = 0; y < matte.height_px(); ++y) {
    const auto xs = x_of.row(y), ys = y_of.row(y);
    for (int x = 0; x < matte.width_px(); ++x) {
      const Mode& mode = strongest(matte, x, y);
      lit += mode.weight >= kLit ? 1.0 : 0.0;
      flagged += mode.weight >= kLit && matte.flags(x, y) != kFlagNone ? 1.0 : 0.0;
      const size_t place = x;
      if (!xs[place] || !ys[place]) continue;
      count += 1.0;
      if (mode.weight <= 0.0f) {
        unsolved += 1.0;
        continue;
      }
      const double off_x = std::abs(static_cast<double>(mode.x_px) - *xs[place]);
      const double off_y = std::abs(static_cast<double>(mode.y_px) - *ys[place]);
      const double half_x = 0.5 * std::sqrt(12.0 * static_cast<double>(mode.xx_px2));
      const double half_y = 0.5 * std::sqrt(12.0 * static_cast<double>(mode.yy_px2));
      agree += off_x <= half_x && off_y <= half_y ? 1.0 : 0.0;
      off_px.push_back(std::max(off_x, off_y));
      half_px.push_back(std::max(half_x, half_y));
    }
  }
  if (count == 0.0) return absl::InvalidArgumentError("no pixel has contrast enough to decode");
  const auto at = [](std::vector<double>& values, double share) {
    const auto middle =
        values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  };
  const double share = agree / count;
  fmt::print("    {:.0f} pixels see light, {:.1f} % of them flagged; {:.0f} have contrast down to 8 px\n",
             lit, 100.0 * flagged / std::max(lit, 1.0), count);
  fmt::print(
      "    {:.2f} % of these agree with the plain decoding (at least {:.0f} % must), {:.2f} % have no box\n",
      100.0 * share, 100.0 * kMinShare, 100.0 * unsolved / count);
  fmt::print("    from the decoding: median {:.2f} px, 95 % within {:.2f} px; half sides: median {:.2f} px\n",
             at(off_px, 0.5), at(off_px, 0.95), at(half_px, 0.5));
  GW_RETURN_IF_ERROR(draw(matte, pictures));
  return share >= kMinShare;
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  if (argc != 4) {
    fmt::print(stderr, "usage: real-gray-code ARCHIVE MATTE PICTURES\n");
    return 2;
  }
  const absl::StatusOr<bool> held = glasswing::check(argv[1], argv[2], argv[3]);
  if (!held.ok()) fmt::print(stderr, "real-gray-code: {}\n", std::string(held.status().message()));
  return held.ok() && *held ? 0 : 1;
}
