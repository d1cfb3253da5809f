#include "tests/compare/figures.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>
#include <fmt/format.h>

#include <tuple>

#include "core/base/status.h"
#include "core/file/file.h"

namespace glasswing {
namespace {

constexpr const char* kHeader =
    "scene;method;variant;noise;with_object;without_object;solve_seconds;flagged;photograph;psnr_db\n";

}  // namespace

double Figures::mean_psnr() const {
  double sum = 0.0;
  for (const auto& [photograph, decibels] : psnr) sum += decibels;
  return sum / static_cast<double>(psnr.size());
}

absl::StatusOr<std::vector<Figures>> read_figures(const std::filesystem::path& path) {
  GW_ASSIGN_OR_RETURN(const std::string text, read_file(path));
  std::vector<Figures> all;
  const std::vector<std::string> lines = absl::StrSplit(text, '\n', absl::SkipEmpty());
  for (size_t i = 1; i < lines.size(); ++i) {
    const std::vector<std::string> field = absl::StrSplit(lines[i], ';');
    Figures own;
    double decibels = 0.0;
    if (field.size() != 10 || !absl::SimpleAtoi(field[4], &own.images_with_object) ||
        !absl::SimpleAtoi(field[5], &own.images_without) || !absl::SimpleAtod(field[6], &own.solve_seconds) ||
        !absl::SimpleAtod(field[7], &own.flagged) || !absl::SimpleAtod(field[9], &decibels)) {
      return absl::DataLossError(
          fmt::format("{}:{} is \"{}\"; it must have the header's fields", path.string(), i + 1, lines[i]));
    }
    std::tie(own.scene, own.family, own.variant, own.noise) =
        std::tie(field[0], field[1], field[2], field[3]);
    const auto same = [&](const Figures& other) {
      return std::tie(own.scene, own.family, own.variant, own.noise) ==
             std::tie(other.scene, other.family, other.variant, other.noise);
    };
    if (all.empty() || !same(all.back())) all.push_back(own);
    all.back().psnr[field[8]] = decibels;
  }
  return all;
}

absl::Status write_figures(const std::filesystem::path& path, const std::vector<Figures>& figures) {
  std::string text = kHeader;
  for (const Figures& own : figures) {
    for (const auto& [photograph, decibels] : own.psnr) {
      text += fmt::format("{};{};{};{};{};{};{:.2f};{:.4f};{};{:.2f}\n", own.scene, own.family, own.variant,
                          own.noise, own.images_with_object, own.images_without, own.solve_seconds,
                          own.flagged, photograph, decibels);
    }
  }
  return write_file_durably(path, text);
}

}  // namespace glasswing
