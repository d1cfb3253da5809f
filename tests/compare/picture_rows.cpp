#include "tests/compare/picture_rows.h"

#include <fmt/format.h>

#include <array>
#include <opencv2/imgcodecs.hpp>

#include "core/base/status.h"
#include "core/frame/image_file.h"
#include "tests/compare/measure.h"
#include "tests/results/panels.h"

namespace glasswing {
namespace {

constexpr int kScale = 3;

struct Row {
  const char *name, *scene, *photograph;
  cv::Rect part;  // of the camera's picture
};
const std::array kRows = {Row{"crystal", "A_crystal", "stilllife", {18, 2, 92, 92}},
                          Row{"bimodal", "B_bimodal", "stone", {10, 16, 92, 64}},
                          Row{"brushed", "C_brushed", "stilllife", {4, 52, 92, 42}},
                          Row{"oriented", "C_brushed", "lines", {18, 52, 92, 42}}};

struct Shown {
  const char *family, *variant, *caption;
};
const std::array kShown = {Shown{"hierarchical", "7 levels", "hierarchical"},
                           Shown{"gaussian, unoriented", "all sweeps", "unoriented"},
                           Shown{"gaussian", "all sweeps", "gaussian"},
                           Shown{"gaussian, few images", "100 images", "few images"},
                           Shown{"fringe", "4 periods, oblique too", "fringe"}};

const Figures* find(const std::vector<Figures>& figures, const Row& row, const Shown& shown) {
  for (const Figures& own : figures) {
    if (own.scene == row.scene && own.family == shown.family && own.variant == shown.variant &&
        own.noise == kNoiseLevels[0].name)
      return &own;
  }
  return nullptr;
}

}  // namespace

absl::Status write_picture_rows(const std::filesystem::path& scenes, const std::filesystem::path& docs,
                                const std::filesystem::path& composites,
                                const std::vector<Figures>& figures) {
  for (const Row& row : kRows) {
    const auto cell = [&](const std::filesystem::path& path) -> absl::StatusOr<cv::Mat> {
      GW_ASSIGN_OR_RETURN(const RadianceImage picture, read_radiance(path, Encoding::kLinear));
      return shown(picture)(row.part).clone();
    };
    std::vector<std::pair<std::string, cv::Mat>> cells;
    GW_ASSIGN_OR_RETURN(const cv::Mat photograph,
                        cell(scenes / row.scene / "ref" / (std::string(row.photograph) + "_obj.png")));
    cells.emplace_back("photograph", photograph);
    for (const Shown& own : kShown) {
      const Figures* const measured = find(figures, row, own);
      if (measured == nullptr) continue;
      GW_ASSIGN_OR_RETURN(const cv::Mat picture, cell(composite_path(composites, row.scene, own.family,
                                                                     own.variant, row.photograph)));
      cells.emplace_back(fmt::format("{}, {} images: {:.1f} dB", own.caption, measured->images(),
                                     measured->psnr.at(row.photograph)),
                         picture);
    }
    const std::filesystem::path path = docs / "pictures" / fmt::format("comparison_{}.png", row.name);
    if (!cv::imwrite(path.string(), side_by_side(cells, kScale, 3)))
      return absl::UnknownError(fmt::format("cannot write {}", path.string()));
  }
  return absl::OkStatus();
}

}  // namespace glasswing
