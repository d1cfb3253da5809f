#include "tests/compare/picture_rows.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "core/base/status.h"
#include "core/image/image_file.h"
#include "tests/compare/measure.h"
#include "tests/results/panels.h"

namespace glasswing {
namespace {

constexpr int kScale = 3;

struct Row {
  const char *name, *scene, *photograph;
  cv::Rect part;  // section of the camera's picture
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
                           Shown{"fringe, two modes", "4 periods, oblique too", "fringe, two modes"}};

const Figures* find(const std::vector<Figures>& figures, const Row& row, const Shown& shown) {
  for (const Figures& own : figures) {
    if (own.scene == row.scene && own.family == shown.family && own.variant == shown.variant &&
        own.noise == kNoiseLevels[0].name)
      return &own;
  }
  return nullptr;
}

// |a - b|, eight times as bright.
RadianceImage difference(const RadianceImage& a, const RadianceImage& b) {
  RadianceImage left = a;
  for (size_t i = 0; i < left.samples.size(); ++i)
    left.samples[i] = 8.0f * std::abs(a.samples[i] - b.samples[i]);
  return left;
}

}  // namespace

absl::Status write_picture_rows(const std::filesystem::path& scenes, const std::filesystem::path& docs,
                                const std::filesystem::path& composites,
                                const std::vector<Figures>& figures) {
  for (const Row& row : kRows) {
    const auto read = [&](const std::filesystem::path& path) {
      return read_radiance(path, Encoding::kLinear);
    };
    std::vector<std::pair<std::string, cv::Mat>> looks, misses;
    GW_ASSIGN_OR_RETURN(const RadianceImage photograph,
                        read(scenes / row.scene / "ref" / (std::string(row.photograph) + "_obj.png")));
    looks.emplace_back("photograph", shown(photograph)(row.part).clone());
    for (const Shown& own : kShown) {
      const Figures* const measured = find(figures, row, own);
      if (measured == nullptr) continue;
      GW_ASSIGN_OR_RETURN(const RadianceImage picture, read(composite_path(composites, row.scene, own.family,
                                                                           own.variant, row.photograph)));
      const std::string caption = fmt::format("{}, {} images: {:.1f} dB", own.caption, measured->images(),
                                              measured->psnr.at(row.photograph));
      looks.emplace_back(caption, shown(picture)(row.part).clone());
      misses.emplace_back(caption, shown(difference(picture, photograph))(row.part).clone());
    }
    const std::string name = fmt::format("comparison_{}.png", row.name);
    for (const auto& [path, cells] :
         {std::pair(composites / name, looks), std::pair(docs / "pictures" / name, misses)}) {
      if (!cv::imwrite(path.string(), side_by_side(cells, kScale, 3)))
        return absl::UnknownError(fmt::format("cannot write {}", path.string()));
    }
  }
  return absl::OkStatus();
}

}  // namespace glasswing
