#include "client/layouts/stack_samples.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/cli/interrupt.h"
#include "core/cli/progress.h"
#include "core/image/image_file.h"

namespace glasswing {
namespace {

constexpr int kGreen = 1;
constexpr int kMaxLines = 128;
constexpr size_t kMaxSamples = 48u << 20;  // of all photographs: 200 MB

int lines_of(const Image16& first, size_t photographs, int side_px) {
  const size_t length = static_cast<size_t>(first.width_px) + static_cast<size_t>(first.height_px);
  const size_t affordable = std::max<size_t>(1, kMaxSamples / (length * photographs));
  return static_cast<int>(
      std::min({affordable, static_cast<size_t>(kMaxLines), static_cast<size_t>(side_px)}));
}

// The centre of the i-th of `count` equal parts of a side.
int place_of(int i, int count, int side_px) {
  return (2 * i + 1) * side_px / (2 * count);
}

void add_lines(const Image16& image, StackSamples& samples) {
  std::vector<float> rows, columns;
  rows.reserve(samples.rows.size());
  columns.reserve(samples.columns.size());
  for (int i = 0; i < samples.rows.count; ++i) {
    const int y = place_of(i, samples.rows.count, image.height_px);
    for (int x = 0; x < image.width_px; ++x) rows.push_back(radiance_of(image.at(x, y, kGreen)));
  }
  for (int i = 0; i < samples.columns.count; ++i) {
    const int x = place_of(i, samples.columns.count, image.width_px);
    for (int y = 0; y < image.height_px; ++y) columns.push_back(radiance_of(image.at(x, y, kGreen)));
  }
  samples.rows.codes.push_back(std::move(rows));
  samples.columns.codes.push_back(std::move(columns));
}

}  // namespace

absl::StatusOr<StackSamples> sample_stack(const std::filesystem::path& directory,
                                          const std::vector<std::string>& files, std::optional<int> white) {
  StackSamples samples;
  Progress progress("looking");
  for (size_t i = 0; i < files.size(); ++i) {
    if (interrupted()) return absl::CancelledError("the import was interrupted before anything was written");
    GW_ASSIGN_OR_RETURN(const CodedPhotograph photograph, read_photograph(directory / files[i], white));
    const Image16 image = interpolated(photograph);
    if (i == 0) {
      samples.width_px = image.width_px;
      samples.height_px = image.height_px;
      samples.bits = photograph.bits;
      samples.rows = {lines_of(image, files.size(), image.height_px), image.width_px, {}};
      samples.columns = {lines_of(image, files.size(), image.width_px), image.height_px, {}};
    }
    if (image.width_px != samples.width_px || image.height_px != samples.height_px ||
        photograph.bits != samples.bits) {
      return absl::InvalidArgumentError(
          fmt::format("{} is {}x{} of {} bits; it must match the first one, {}, which is {}x{} of {} bits",
                      files[i], image.width_px, image.height_px, photograph.bits, files[0], samples.width_px,
                      samples.height_px, samples.bits));
    }
    add_lines(image, samples);
    samples.largest_code = std::max<int>(samples.largest_code, *std::ranges::max_element(image.samples));
    progress.update((static_cast<double>(i) + 1.0) / static_cast<double>(files.size()),
                    fmt::format("{} of {} photographs", i + 1, files.size()));
  }
  return samples;
}

}  // namespace glasswing
