#include "core/matte/matte_layers.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/checksum.h"

namespace glasswing {
namespace {

constexpr const char* kConventionsText =
    "C = F + sum R integral G(x; c, S) T(x) dx per channel, linear light. Monitor px: origin at the outer "
    "corner of the top-left pixel, x right, y down, pixel centres at +0.5. S = [xx xy; xy yy] in px^2. G is "
    "a "
    "Gaussian, or, if the attribute \"glasswing\" has footprint \"box\", an upright box. For a mode, Y is "
    "the "
    "same in all colours. texture counts the monitors listed in that attribute.";
constexpr std::array<const char*, kChannels> kColours{"R", "G", "B"};
constexpr const char* kGray = "Y";
constexpr const char* kPreviewCoverage = "A";
constexpr const char* kCoverage = "foreground.coverage.Y";
constexpr const char* kFlags = "foreground.flags.Y";
std::string foreground_name(int channel) {
  return fmt::format("foreground.F.{}", kColours[channel]);
}

constexpr int kPyramidHead = 9;  // numbers before its coefficients
// A coefficient's place: level, column and row, from the corner of the pyramid.
constexpr int kPlaceSide = 1024, kPlaces = kPlaceSide * kPlaceSide;

// "mode1.weight.R", or "mode1.weight.Y" if it is the same in all channels. Compositors identify a layer by
// its channel names alone, so these include the name of the part.
std::string layer_name(size_t mode, size_t layer, int channel, bool colourless) {
  return fmt::format("mode{}.{}.{}", mode + 1, kModeLayers[layer].name,
                     colourless ? kGray : kColours[channel]);
}

}  // namespace

int stored_size(const PyramidFootprint& pyramid) {
  return kPyramidHead + 2 * static_cast<int>(pyramid.coefficients.size());
}

std::vector<ExrPart> matte_parts(int modes_per_channel, bool colourless, bool pyramids) {
  std::vector<ExrPart> parts;
  // A preview for people: half the weights and the foreground, so that any viewer shows the object;
  // premultiplied by the coverage, as every viewer expects.
  parts.push_back({.name = "preview", .channels = {"R", "G", "B", kPreviewCoverage}, .attributes = {}});
  parts.push_back({.name = "foreground", .channels = {kCoverage, kFlags}, .attributes = {}});
  for (int c = 0; c < kChannels; ++c) parts.back().channels.push_back(foreground_name(c));
  for (size_t m = 0; m < static_cast<size_t>(modes_per_channel); ++m) {
    ExrPart& part = parts.emplace_back();
    part.name = fmt::format("mode{}", m + 1);
    for (size_t layer = 0; layer < kModeLayers.size(); ++layer) {
      for (int c = 0; c < (colourless ? 1 : kChannels); ++c)
        part.channels.push_back(layer_name(m, layer, c, colourless));
    }
  }
  if (pyramids) {
    ExrPart& part = parts.emplace_back();
    part.name = kPyramidPart;
    for (int i = 0; i < kPyramidPlanes; ++i)
      part.channels.push_back(fmt::format("{}.{:03d}.Y", kPyramidPart, i));
  }
  for (ExrPart& part : parts) std::ranges::sort(part.channels);
  return parts;
}

std::string colourless_channel() {
  return layer_name(0, 0, 0, true);
}

std::string row_checksums(std::span<const std::uint64_t> rows) {
  std::string text;
  for (const std::uint64_t row : rows) text += fmt::format("{:016x}", row);
  return text;
}

std::string matte_checksum(const std::string& metadata, const std::vector<ExrPart>& parts,
                           const std::string& rows) {
  std::string bytes = metadata;
  for (const ExrPart& part : parts) {
    bytes += part.name;
    for (const std::string& channel : part.channels) bytes += channel;
  }
  return checksum_of(bytes + rows);
}

void put_attribute(std::string& exr, std::string_view name, std::string_view text) {
  using namespace std::string_literals;
  const std::string before = std::string(name) + "\0string\0"s;
  const size_t at = exr.find(before) + before.size() + sizeof(std::int32_t);
  exr.replace(at, text.size(), text);
}

void describe(std::vector<ExrPart>& parts, const std::string& metadata, const std::string& rows) {
  const std::string checksum = matte_checksum(metadata, parts, rows);
  for (ExrPart& part : parts)
    part.attributes = {{kMatteMetadata, metadata}, {kMatteConventions, kConventionsText}};
  parts.front().attributes[kMatteRows] = rows;
  parts.front().attributes[kMatteChecksum] = checksum;
}

std::string json_of(const v1::MatteMetadata& metadata) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  std::string json;
  (void)google::protobuf::util::MessageToJsonString(metadata, &json, options);
  return json;
}

MatteBlock::MatteBlock(int modes_per_channel, bool colourless, int width_px, bool pyramids)
    : modes_(modes_per_channel),
      channels_(colourless ? 1 : kChannels),
      width_px_(width_px),
      pyramids_(pyramids) {
  const std::vector<ExrPart> parts = matte_parts(modes_per_channel, colourless, pyramids);
  size_t count = 0;
  for (const ExrPart& part : parts) count += part.channels.size();
  const size_t plane = static_cast<size_t>(width_px) * kMaxBlockRows;
  values_.resize(count * plane);
  float* next = values_.data();
  for (const ExrPart& part : parts) {
    std::vector<float*>& planes = planes_.emplace_back();
    for (size_t i = 0; i < part.channels.size(); ++i, next += plane) planes.push_back(next);
  }
  const auto named = [&](size_t part, const std::string& channel) {
    const auto at = std::ranges::lower_bound(parts[part].channels, channel) - parts[part].channels.begin();
    return planes_[part][at];
  };
  for (int c = 0; c < kChannels; ++c) {
    preview_[c] = named(kPreviewPart, kColours[c]);
    foreground_[c] = named(kForegroundPart, foreground_name(c));
  }
  preview_coverage_ = named(kPreviewPart, kPreviewCoverage);
  coverage_ = named(kForegroundPart, kCoverage);
  flags_ = named(kForegroundPart, kFlags);
  for (size_t m = 0; m < static_cast<size_t>(modes_per_channel); ++m) {
    for (int c = 0; c < channels_; ++c) {
      for (size_t layer = 0; layer < kModeLayers.size(); ++layer)
        layers_.push_back(named(kFirstModePart + m, layer_name(m, layer, c, colourless)));
    }
  }
}

std::span<float* const> MatteBlock::layers(size_t mode, int channel) const {
  const size_t first =
      (mode * static_cast<size_t>(channels_) + static_cast<size_t>(channel)) * kModeLayers.size();
  return std::span(layers_).subspan(first, kModeLayers.size());
}

std::vector<const float*> MatteBlock::row(size_t part, int row) const {
  std::vector<const float*> pixels(planes_[part].begin(), planes_[part].end());
  for (const float*& first : pixels) first += static_cast<std::ptrdiff_t>(row) * width_px_;
  return pixels;
}

void MatteBlock::take(const Matte& matte, int y, int rows) {
  size_t i = 0;
  for (int row = y; row < y + rows; ++row) {
    for (int x = 0; x < width_px_; ++x, ++i) {
      for (int c = 0; c < kChannels; ++c) {
        const float foreground = matte.foreground(x, row)[c];
        float light = foreground;
        for (const Mode& mode : matte.modes(x, row, c)) light += 0.5f * mode.weight;
        foreground_[c][i] = foreground;
        preview_[c][i] = matte.coverage(x, row) * light;
      }
      preview_coverage_[i] = coverage_[i] = matte.coverage(x, row);
      flags_[i] = static_cast<float>(matte.flags(x, row));
    }
  }
  for (size_t m = 0; m < static_cast<size_t>(modes_); ++m) {
    for (int c = 0; c < channels_; ++c) {
      const std::span<float* const> to = layers(m, c);
      i = 0;
      for (int row = y; row < y + rows; ++row) {
        for (int x = 0; x < width_px_; ++x, ++i) {
          const Mode& mode = matte.modes(x, row, c)[m];
          for (size_t l = 0; l < kModeLayers.size(); ++l) {
            const auto member = kModeLayers[l].member;
            to[l][i] = member != nullptr ? mode.*member : static_cast<float>(mode.texture);
          }
        }
      }
    }
  }
  if (pyramids_) take_pyramids(matte, y, rows);
}

std::vector<float> MatteBlock::pyramid_row(const Matte& matte, int y, std::vector<int>& left_out) const {
  std::vector<float> numbers;
  const int room = width_px_ * kPyramidPlanes;
  for (int x = 0; x < width_px_; ++x) {
    for (int c = 0; c < kChannels; ++c) {
      for (const PyramidFootprint& own : matte.pyramids(x, y, c)) {
        int left = kMaxSide_px - 1, top = kMaxSide_px - 1;
        for (const Coefficient& at : own.coefficients) {
          if (at.level >= kPyramidLevels) continue;
          left = std::min(left, at.column << at.level);
          top = std::min(top, at.row << at.level);
        }
        const size_t before = numbers.size();
        numbers.insert(numbers.end(), {static_cast<float>(x + 1), static_cast<float>(c),
                                       static_cast<float>(own.texture), own.foreground, own.noise_sd,
                                       own.prior_sd, static_cast<float>(own.coefficients.size()),
                                       static_cast<float>(left), static_cast<float>(top)});
        bool fits = std::ssize(numbers) + 2 * std::ssize(own.coefficients) <= room;
        std::vector<std::pair<int, float>> places;
        for (const Coefficient& at : own.coefficients) {
          const bool mode = at.level >= kPyramidLevels;
          const int column = mode ? 0 : at.column - (left >> at.level),
                    row = mode ? 0 : at.row - (top >> at.level);
          fits = fits && column < kPlaceSide && row < kPlaceSide;
          places.emplace_back(at.level * kPlaces + column * kPlaceSide + row, at.weight);
        }
        // Small steps deflate better, as do weights among themselves.
        std::ranges::sort(places);
        int before_it = 0;
        for (const auto& [place, _] : places)
          numbers.push_back(static_cast<float>(place - std::exchange(before_it, place)));
        for (const auto& [_, weight] : places) numbers.push_back(weight);
        if (fits) continue;
        numbers.resize(before);
        left_out.push_back(x);
      }
    }
  }
  return numbers;
}

void MatteBlock::take_pyramids(const Matte& matte, int y, int rows) {
  const std::vector<float*>& planes = planes_.back();
  for (int row = 0; row < rows; ++row) {
    std::vector<int> left_out;
    std::vector<float> numbers = pyramid_row(matte, y + row, left_out);
    numbers.resize(size_t{kPyramidPlanes} * static_cast<size_t>(width_px_));
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(row) * width_px_;
    for (int p = 0; p < kPyramidPlanes; ++p)
      std::copy_n(&numbers[static_cast<std::ptrdiff_t>(p) * width_px_], width_px_, planes[p] + at);
    for (const int x : left_out) flags_[at + x] = static_cast<float>(matte.flags(x, y + row) | kFlagPoorFit);
  }
}

void MatteBlock::give_pyramids(Matte& matte, int y, int rows) const {
  const int room = width_px_ * kPyramidPlanes;
  for (int row = 0; row < rows; ++row) {
    int next = 0;
    // Of anything that is no number of that range, -1, which no pyramid has.
    const auto value = [&] {
      const int at = next++;
      return at < room
                 ? planes_
                       .back()[at / width_px_][static_cast<std::ptrdiff_t>(row) * width_px_ + at % width_px_]
                 : 0.0f;
    };
    const auto whole = [&](int end) {
      const float read = value();
      return read >= 0.0f && read < static_cast<float>(end) ? static_cast<int>(read) : -1;
    };
    while (next < room) {
      const int x = whole(width_px_ + 1) - 1;
      if (x < 0) break;
      const int channel = whole(kChannels);
      PyramidFootprint own;
      own.texture = whole(1024);
      own.foreground = value();
      own.noise_sd = value();
      own.prior_sd = value();
      const int count = whole(room), left = whole(kMaxSide_px), top = whole(kMaxSide_px);
      if (channel < 0 || count < 0 || left < 0 || top < 0 || next + 2 * count > room) {
        matte.coverage(x, y + row) = NAN;  // refused by the check of pixels
        break;
      }
      for (int i = 0, place = 0; i < count; ++i) {
        const int step = whole(16 * kPlaces);
        if (step < 0 || place + step >= 16 * kPlaces) own.texture = -1;
        if (own.texture >= 0) place += step;
        const int level = place / kPlaces;
        own.coefficients.push_back({.level = level});
        if (level >= kPyramidLevels) continue;
        own.coefficients.back().column = (left >> level) + place % kPlaces / kPlaceSide;
        own.coefficients.back().row = (top >> level) + place % kPlaceSide;
      }
      for (Coefficient& coefficient : own.coefficients) coefficient.weight = value();
      matte.add_pyramid(x, y + row, channel, std::move(own));
    }
  }
}

void MatteBlock::give(Matte& matte, int y, int rows) const {
  const auto whole_number = [](float value, float end, auto otherwise) {
    return value >= 0.0f && value < end ? static_cast<decltype(otherwise)>(value) : otherwise;
  };
  size_t i = 0;
  for (int row = y; row < y + rows; ++row) {
    for (int x = 0; x < width_px_; ++x, ++i) {
      for (size_t c = 0; c < kChannels; ++c) matte.foreground(x, row)[c] = foreground_[c][i];
      matte.coverage(x, row) = coverage_[i];
      matte.flags(x, row) = whole_number(flags_[i], 256.0f, std::uint8_t{kFlagNoData});
    }
  }
  for (size_t m = 0; m < static_cast<size_t>(modes_); ++m) {
    for (int c = 0; c < channels_; ++c) {
      const std::span<float* const> from = layers(m, c);
      i = 0;
      for (int row = y; row < y + rows; ++row) {
        for (int x = 0; x < width_px_; ++x, ++i) {
          Mode& mode = matte.modes(x, row, c)[m];
          for (size_t l = 0; l < kModeLayers.size(); ++l) {
            if (const auto member = kModeLayers[l].member; member != nullptr) {
              mode.*member = from[l][i];
            } else {
              mode.texture = whole_number(from[l][i], 1024.0f, std::int32_t{-1});
            }
          }
        }
      }
    }
  }
  if (pyramids_) give_pyramids(matte, y, rows);
}

std::vector<std::uint64_t> MatteBlock::checksums(int first_row, int rows, int first_column,
                                                 int columns) const {
  RunningChecksum checksum;
  std::vector<std::uint64_t> checksums;
  for (int row = first_row; row < first_row + rows; ++row) {
    checksum.start();
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(row) * width_px_ + first_column;
    for (const std::vector<float*>& part : planes_) {
      for (const float* plane : part)
        checksum.add(
            {reinterpret_cast<const char*>(plane + at), static_cast<size_t>(columns) * sizeof(float)});
    }
    checksums.push_back(checksum.value());
  }
  return checksums;
}

}  // namespace glasswing
