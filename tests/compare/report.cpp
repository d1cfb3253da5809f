#include "tests/compare/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <map>
#include <set>
#include <utility>

#include "core/base/status.h"
#include "core/file/file.h"
#include "tests/compare/candidate.h"
#include "tests/compare/chart.h"
#include "tests/compare/picture_rows.h"

namespace glasswing {
namespace {

// Two monitors need twice the images, so means over scenes exclude this one.
constexpr const char* kTwoMonitors = "E_twomonitors";

const std::map<std::string, std::string> kColours = {{"gaussian", "#1565c0"},
                                                     {"gaussian, few images", "#c62828"},
                                                     {"gaussian, unoriented", "#64b5f6"},
                                                     {"hierarchical", "#2e7d32"},
                                                     {"fringe", "#8e24aa"},
                                                     {"fringe, two modes", "#d81b60"},
                                                     {"alpha", "#ef6c00"}};

using Measured = std::vector<const Figures*>;
using Filter = std::function<bool(const Figures&)>;

double mean(const Measured& figures, const std::function<double(const Figures&)>& of) {
  double sum = 0.0;
  for (const Figures* own : figures) sum += of(*own);
  return sum / static_cast<double>(figures.size());
}

double images(const Figures& own) {
  return own.images();
}
double seconds(const Figures& own) {
  return own.solve_seconds;
}
double decibels(const Figures& own) {
  return own.mean_psnr();
}

Measured those(const std::vector<Figures>& figures, const Filter& filter) {
  Measured found;
  for (const Figures& own : figures) {
    if (filter(own)) found.push_back(&own);
  }
  return found;
}

// The figures of every scene that passes the filter; empty if one of them was not measured, since means must
// cover the same scenes.
Measured of(const std::vector<Figures>& figures, const Candidate& candidate, const std::string& noise,
            const Filter& filter) {
  const Measured found = those(figures, [&](const Figures& own) {
    return own.family == candidate.family && own.variant == candidate.variant && own.noise == noise &&
           filter(own);
  });
  const Measured scenes =
      those(figures, [&](const Figures& own) { return own.family == kBare && filter(own); });
  return found.size() == scenes.size() ? found : Measured{};
}

bool one_monitor(const Figures& own) {
  return own.scene != kTwoMonitors;
}

ChartPanel panel(const std::string& title, const std::vector<Figures>& figures, const std::string& noise,
                 const Filter& filter, const std::function<double(const Figures&)>& x) {
  ChartPanel panel{.title = title, .curves = {}};
  for (const Candidate& candidate : candidates()) {
    const Measured own = of(figures, candidate, noise, filter);
    if (own.empty()) continue;
    if (panel.curves.empty() || panel.curves.back().name != candidate.family)
      panel.curves.push_back(
          {.name = candidate.family, .colour = kColours.at(candidate.family), .points = {}});
    panel.curves.back().points.push_back({.x = mean(own, x), .y = mean(own, decibels)});
  }
  const Measured bare =
      those(figures, [&](const Figures& own) { return own.family == kBare && filter(own); });
  panel.level = mean(bare, decibels);
  return panel;
}

absl::Status write_charts(const std::filesystem::path& folder, const std::vector<Figures>& figures) {
  Chart by_images{.x_label = "images, with and without the object, and seconds to capture them",
                  .y_label = "PSNR, dB",
                  .level_label = kBare,
                  .panels = {},
                  .per_second = kImagesPerSecond};
  Chart by_seconds = by_images, by_scene = by_images;
  by_seconds.per_second = 0.0;
  by_seconds.x_label = "seconds to solve, two cores";
  for (const NoiseLevel& noise : kNoiseLevels) {
    by_images.panels.push_back(panel(noise.name, figures, noise.name, one_monitor, images));
    by_seconds.panels.push_back(panel(noise.name, figures, noise.name, one_monitor, seconds));
  }
  std::set<std::string> scenes;
  for (const Figures& own : figures) scenes.insert(own.scene);
  for (const std::string& scene : scenes) {
    by_scene.panels.push_back(panel(
        scene, figures, kNoiseLevels[0].name, [&](const Figures& own) { return own.scene == scene; },
        images));
  }
  GW_RETURN_IF_ERROR(write_file_durably(folder / "comparison_images.svg", svg_of(by_images)));
  GW_RETURN_IF_ERROR(write_file_durably(folder / "comparison_solve.svg", svg_of(by_seconds)));
  return write_file_durably(folder / "comparison_scenes.svg", svg_of(by_scene));
}

std::string range(const Measured& figures, const std::function<double(const Figures&)>& of) {
  const auto [low, high] = std::ranges::minmax(figures, {}, [&](const Figures* own) { return of(*own); });
  return of(*low) == of(*high) ? fmt::format("{:.0f}", of(*low))
                               : fmt::format("{:.0f}–{:.0f}", of(*low), of(*high));
}

std::string table_of_means(const std::vector<Figures>& figures) {
  std::string table = "| method | | images: with | without | in all | capture, s | solve, s |";
  std::string rule = "| --- | --- | --- | --- | --- | --- | --- |";
  for (const NoiseLevel& noise : kNoiseLevels) {
    table += fmt::format(" {} |", noise.name);
    rule += " --- |";
  }
  table += " flagged, % |\n" + rule + " --- |\n";
  for (const Candidate& candidate : candidates()) {
    const Measured clean = of(figures, candidate, kNoiseLevels[0].name, one_monitor);
    if (clean.empty()) continue;
    table += fmt::format(
        "| {} | {} | {} | {} | {} | {:.1f} | {:.2f} |", candidate.family, candidate.variant,
        range(clean, [](const Figures& own) { return own.images_with_object; }),
        range(clean, [](const Figures& own) { return own.images_without; }), range(clean, images),
        mean(clean, [](const Figures& own) { return own.capture_seconds(); }), mean(clean, seconds));
    std::string flagged;
    for (const NoiseLevel& noise : kNoiseLevels) {
      const Measured own = of(figures, candidate, noise.name, one_monitor);
      table += fmt::format(" {:.1f} |", mean(own, decibels));
      flagged += fmt::format("{}{:.1f}", flagged.empty() ? "" : " / ",
                             100.0 * mean(own, [](const Figures& f) { return f.flagged; }));
    }
    table += " " + flagged + " |\n";
  }
  const Measured bare =
      those(figures, [](const Figures& own) { return own.family == kBare && one_monitor(own); });
  return table + fmt::format("| {} | | 0 | 0 | 0 | | | {:.1f} | | | |\n", kBare, mean(bare, decibels));
}

std::string table_of_scenes(const std::vector<Figures>& figures) {
  std::set<std::string> scenes;
  for (const Figures& own : figures) scenes.insert(own.scene);
  std::string table = "| method | |", rule = "| --- | --- |";
  for (const std::string& scene : scenes) {
    table += " " + scene + " |";
    rule += " --- |";
  }
  table += "\n" + rule + "\n";
  for (const Candidate& candidate : candidates()) {
    std::string row = fmt::format("| {} | {} |", candidate.family, candidate.variant);
    bool any = false;
    for (const std::string& scene : scenes) {
      std::string cell;
      for (const NoiseLevel& noise : kNoiseLevels) {
        const Measured own =
            of(figures, candidate, noise.name, [&](const Figures& f) { return f.scene == scene; });
        if (own.empty()) continue;
        cell += fmt::format("{}{:.1f}", cell.empty() ? "" : " / ", own.front()->mean_psnr());
        any = true;
      }
      row += " " + cell + " |";
    }
    if (any) table += row + "\n";
  }
  std::string bare = fmt::format("| {} | |", kBare);
  for (const std::string& scene : scenes) {
    const Measured own =
        those(figures, [&](const Figures& f) { return f.family == kBare && f.scene == scene; });
    bare += fmt::format(" {:.1f} |", mean(own, decibels));
  }
  return table + bare + "\n";
}

// Puts `text` between <!-- name --> and the next <!-- end -->.
absl::Status fill(const std::string& name, const std::string& text, std::string& page) {
  const std::string mark = fmt::format("<!-- {} -->\n", name);
  const size_t begin = page.find(mark);
  const size_t end = begin == std::string::npos ? begin : page.find("<!-- end -->", begin);
  if (end == std::string::npos)
    return absl::FailedPreconditionError(
        fmt::format("the page has no \"<!-- {} -->\" with an \"<!-- end -->\" after it", name));
  page.replace(begin + mark.size(), end - begin - mark.size(), text);
  return absl::OkStatus();
}

}  // namespace

absl::Status write_report(const std::filesystem::path& scenes, const std::filesystem::path& docs,
                          const std::filesystem::path& composites, const std::vector<Figures>& figures) {
  GW_RETURN_IF_ERROR(write_charts(docs / "pictures", figures));
  GW_RETURN_IF_ERROR(write_picture_rows(scenes, docs, composites, figures));
  const std::filesystem::path page = docs / "comparison.md";
  GW_ASSIGN_OR_RETURN(std::string text, read_file(page));
  GW_RETURN_IF_ERROR(fill("figures: comparison-means", table_of_means(figures), text));
  GW_RETURN_IF_ERROR(fill("figures: comparison-scenes", table_of_scenes(figures), text));
  return write_file_durably(page, text);
}

}  // namespace glasswing
