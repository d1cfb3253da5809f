#include "compositing/view/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>

#include "compositing/picture/picture.h"
#include "compositing/view/commands.h"
#include "core/base/status.h"
#include "core/cli/output.h"
#include "core/cli/progress.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

struct CompareArguments {
  std::string a;
  std::string b;
  std::string matte;
  bool linear = false;
  bool match = false;
};

absl::StatusOr<Difference> compared(const CompareArguments& arguments) {
  const Waiting waiting("comparing");
  const Encoding encoding = arguments.linear ? Encoding::kLinear : Encoding::kDisplay;
  GW_ASSIGN_OR_RETURN(RadianceImage a, read_picture(arguments.a, encoding));
  GW_ASSIGN_OR_RETURN(const RadianceImage b, read_picture(arguments.b, encoding));
  std::optional<Matte> matte;
  if (!arguments.matte.empty()) {
    GW_ASSIGN_OR_RETURN(matte, read_matte(arguments.matte));
  }
  const Matte* counted = matte ? &*matte : nullptr;
  if (arguments.match) {
    GW_ASSIGN_OR_RETURN(a, matched(a, b, counted));
  }
  return difference_of(a, b, counted);
}

absl::Status compare(const CommandLine& command_line, const CompareArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const Difference difference, compared(arguments));
  if (command_line.tsv) {
    print_table(command_line, {{"RMS"}, {"PSNR_DB"}, {"PIXELS"}},
                {{fmt::format("{:.9g}", difference.rms), fmt::format("{:.4f}", difference.psnr_db),
                  std::to_string(difference.pixel_count)}});
  } else if (command_line.json) {
    nlohmann::ordered_json answer = {
        {"rms", difference.rms}, {"psnr_db", difference.psnr_db}, {"pixels", difference.pixel_count}};
    if (std::isinf(difference.psnr_db)) answer["psnr_db"] = nullptr;  // JSON has no infinity
    std::cout << answer.dump(1) << "\n";
  } else {
    std::cout << fmt::format("rms {:.6f}, PSNR {:.2f} dB over {} pixels\n", difference.rms,
                             difference.psnr_db, difference.pixel_count);
  }
  return absl::OkStatus();
}

absl::Status check_sizes(const RadianceImage& a, const RadianceImage& b, const Matte* matte) {
  if (a.width_px != b.width_px || a.height_px != b.height_px) {
    return absl::InvalidArgumentError(fmt::format("the pictures are {}x{} and {}x{}; they must have one size",
                                                  a.width_px, a.height_px, b.width_px, b.height_px));
  }
  if (matte != nullptr && (matte->width_px() != a.width_px || matte->height_px() != a.height_px)) {
    return absl::InvalidArgumentError(fmt::format("the matte is {}x{} and the pictures are {}x{}",
                                                  matte->width_px(), matte->height_px(), a.width_px,
                                                  a.height_px));
  }
  return absl::OkStatus();
}

bool counts(const Matte* matte, int x, int y) {
  return matte == nullptr || matte->coverage(x, y) > 0.5f;
}

}  // namespace

absl::StatusOr<Difference> difference_of(const RadianceImage& a, const RadianceImage& b, const Matte* matte) {
  GW_RETURN_IF_ERROR(check_sizes(a, b, matte));
  Difference difference;
  double sum = 0.0;
  for (int y = 0; y < a.height_px; ++y) {
    for (int x = 0; x < a.width_px; ++x) {
      if (!counts(matte, x, y)) continue;
      ++difference.pixel_count;
      for (int channel = 0; channel < 3; ++channel) {
        const double error = static_cast<double>(a.at(x, y, channel)) - b.at(x, y, channel);
        sum += error * error;
      }
    }
  }
  if (difference.pixel_count == 0) return absl::InvalidArgumentError("the matte covers no pixel");
  difference.rms = std::sqrt(sum / (3.0 * static_cast<double>(difference.pixel_count)));
  difference.psnr_db = -20.0 * std::log10(difference.rms);
  return difference;
}

absl::StatusOr<RadianceImage> matched(const RadianceImage& a, const RadianceImage& b, const Matte* matte) {
  GW_RETURN_IF_ERROR(difference_of(a, b, matte).status());
  RadianceImage out = a;
  for (int channel = 0; channel < 3; ++channel) {
    double n = 0.0, sum_a = 0.0, sum_b = 0.0, sum_aa = 0.0, sum_ab = 0.0;
    for (int y = 0; y < a.height_px; ++y) {
      for (int x = 0; x < a.width_px; ++x) {
        if (!counts(matte, x, y)) continue;
        const double own = a.at(x, y, channel), other = b.at(x, y, channel);
        n += 1.0;
        sum_a += own;
        sum_b += other;
        sum_aa += own * own;
        sum_ab += own * other;
      }
    }
    const double variance = sum_aa - sum_a * sum_a / n;
    const double gain = variance > 0.0 ? (sum_ab - sum_a * sum_b / n) / variance : 1.0;
    const double offset = (sum_b - gain * sum_a) / n;
    for (size_t i = channel; i < out.samples.size(); i += 3)
      out.samples[i] = static_cast<float>(gain * out.samples[i] + offset);
  }
  return out;
}

void add_compare_command(CLI::App& app, CommandLine& command_line) {
  CLI::App& command =
      *app.add_subcommand("compare", "Measure the difference of two pictures in linear light.");
  command.footer(
      "Example:\n  glasswing compare composite.exr archive/frames/000310.tif --linear --matte vase.exr");
  auto arguments = std::make_shared<CompareArguments>();
  command.add_option("a", arguments->a, "a picture")->required();
  command.add_option("b", arguments->b, "another picture of the same size")->required();
  command.add_option("--matte", arguments->matte, "count only the pixels that this matte covers");
  command.add_flag(
      "--linear", arguments->linear,
      "PNG and TIFF values are linear radiance, value / full scale; frames of a calibrated archive are "
      "linearised by its calibrations in any case");
  command.add_flag("--match", arguments->match,
                   "first fit a gain and an offset per channel that bring A closest to B");
  command.callback([&command_line, arguments] {
    command_line.run = [&command_line, arguments] { return compare(command_line, *arguments); };
  });
}

}  // namespace glasswing
