#include "client/layouts/photograph_layout.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <string_view>
#include <utility>

#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr int kMinSteps = 3, kMaxSteps = 64;
constexpr double kMinCell_px = 1.0, kMaxCell_px = 8192.0;

template <typename Value>
using Named = std::pair<std::string_view, Value>;

constexpr std::array<Named<PatternCode>, 3> kCodes{{{"opencv-graycode", PatternCode::kGray},
                                                    {"binary", PatternCode::kBinary},
                                                    {"phase-shift", PatternCode::kPhaseShift}}};
constexpr std::array<Named<LayoutBlock>, 6> kBlocks{{{"columns", LayoutBlock::kColumns},
                                                     {"rows", LayoutBlock::kRows},
                                                     {"white", LayoutBlock::kWhite},
                                                     {"black", LayoutBlock::kBlack},
                                                     {"fringe-columns", LayoutBlock::kFringeColumns},
                                                     {"fringe-rows", LayoutBlock::kFringeRows}}};
constexpr std::array<Named<Complements>, 3> kComplements{
    {{"none", Complements::kNone}, {"after", Complements::kAfter}, {"before", Complements::kBefore}}};
constexpr std::array<Named<bool>, 2> kShifts{{{"forward", false}, {"backward", true}}};

template <typename Value, size_t count>
std::optional<Value> value_of(const std::array<Named<Value>, count>& names, std::string_view name) {
  const auto found = std::ranges::find(names, name, &Named<Value>::first);
  if (found == names.end()) return std::nullopt;
  return found->second;
}

template <typename Value, size_t count>
std::string_view name_of(const std::array<Named<Value>, count>& names, Value value) {
  return std::ranges::find(names, value, &Named<Value>::second)->first;
}

absl::Status bad(const std::string& what) {
  return absl::InvalidArgumentError(what);
}

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == ',') {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

absl::StatusOr<std::vector<LayoutBlock>> order_of(const std::string& text) {
  const auto refused = [&] {
    return bad(
        fmt::format("--order is \"{}\"; it must be some of columns, rows, white and black, each once, with "
                    "columns or rows among them, and fringe-columns or fringe-rows if fringes accompany a "
                    "code of bars: columns,rows,white,black",
                    text));
  };
  std::vector<LayoutBlock> order;
  for (const std::string& part : split(text)) {
    const std::optional<LayoutBlock> block = value_of(kBlocks, part);
    if (!block || std::ranges::count(order, *block) > 0) return refused();
    order.push_back(*block);
  }
  if (std::ranges::count(order, LayoutBlock::kColumns) + std::ranges::count(order, LayoutBlock::kRows) == 0)
    return refused();
  return order;
}

absl::Status set_fringes(const LayoutOptions& options, PhotographLayout& layout) {
  if (!options.steps || *options.steps < kMinSteps || *options.steps > kMaxSteps) {
    return bad(fmt::format("--steps is {}; fringes need the number of steps per period, {} to {}",
                           options.steps ? std::to_string(*options.steps) : "not given", kMinSteps,
                           kMaxSteps));
  }
  if (!options.periods)
    return bad(
        "fringes need --periods, the number of fringes along a side, such as "
        "1,8,64");
  layout.steps = *options.steps;
  layout.phase_deg = options.phase_deg.value_or(0.0);
  if (!(std::abs(layout.phase_deg) <= 360.0))
    return bad(fmt::format("--phase is {}; it must be -360 to 360 degrees", layout.phase_deg));
  GW_ASSIGN_OR_RETURN(layout.periods, periods_of(*options.periods));
  if (options.shift) {
    GW_ASSIGN_OR_RETURN(layout.backward, is_backward(*options.shift));
  }
  return absl::OkStatus();
}

absl::Status set_bars(const LayoutOptions& options, PhotographLayout& layout) {
  const std::string inverse = options.inverse.value_or(layout.code == PatternCode::kGray ? "after" : "none");
  const std::optional<Complements> complements = value_of(kComplements, inverse);
  if (!complements) return bad(fmt::format("--inverse is \"{}\"; it must be after, before or none", inverse));
  layout.complements = *complements;
  layout.cell_px = options.cell_px.value_or(1.0);
  if (layout.cell_px >= kMinCell_px && layout.cell_px <= kMaxCell_px) return absl::OkStatus();
  return bad(fmt::format("--cell is {}; it must be {} to {} px", layout.cell_px, kMinCell_px, kMaxCell_px));
}

int side_of(LayoutBlock block, const v1::Monitor& monitor) {
  return axis_of(block) == 0 ? monitor.width_px() : monitor.height_px();
}

v1::Stimulus solid(double light) {
  v1::Stimulus stimulus;
  stimulus.set_kind("solid");
  for (int c = 0; c < 3; ++c) stimulus.add_colour(light);
  return stimulus;
}

v1::Stimulus bars(const PhotographLayout& layout, LayoutBlock block, int bit, bool inverse) {
  v1::Stimulus stimulus;
  stimulus.set_kind("square");
  stimulus.set_orient(block == LayoutBlock::kColumns ? "vertical_bars" : "horizontal_bars");
  const double first_px = layout.cell_px * std::exp2(bit);
  stimulus.set_bar_width_px(layout.code == PatternCode::kGray ? 2.0 * first_px : first_px);
  stimulus.set_offset_px(first_px);
  stimulus.set_inverse(inverse);
  return stimulus;
}

void add_bars(const PhotographLayout& layout, LayoutBlock block, int side_px,
              std::vector<v1::Stimulus>& shown) {
  for (int bit = bits_of(side_px / layout.cell_px) - 1; bit >= 0; --bit) {
    const auto add = [&](bool inverse) { shown.push_back(bars(layout, block, bit, inverse)); };
    if (layout.complements == Complements::kBefore) add(true);
    add(false);
    if (layout.complements == Complements::kAfter) add(true);
  }
}

void add_fringes(const PhotographLayout& layout, LayoutBlock block, int side_px,
                 std::vector<v1::Stimulus>& shown) {
  for (const FringePeriod& period : layout.periods) {
    for (int step = 0; step < layout.steps; ++step) {
      v1::Stimulus stimulus;
      stimulus.set_kind("sinusoid");
      stimulus.set_phi_deg(axis_of(block) == 0 ? 0.0 : 90.0);
      stimulus.set_period_px(period.px(side_px));
      const int turned = layout.backward ? (layout.steps - step) % layout.steps : step;
      stimulus.set_phase_deg(std::fmod(360.0 * turned / layout.steps + layout.phase_deg + 360.0, 360.0));
      stimulus.set_peak(1.0);
      shown.push_back(std::move(stimulus));
    }
  }
}

std::vector<v1::Stimulus> shown_in(const PhotographLayout& layout, const v1::Monitor& monitor) {
  std::vector<v1::Stimulus> shown;
  for (const LayoutBlock block : layout.order) {
    if (is_solid(block)) {
      shown.push_back(solid(block == LayoutBlock::kWhite ? 1.0 : 0.0));
    } else if (has_fringes(layout, block)) {
      add_fringes(layout, block, side_of(block, monitor), shown);
    } else {
      add_bars(layout, block, side_of(block, monitor), shown);
    }
  }
  return shown;
}

}  // namespace

bool is_fringe(LayoutBlock block) {
  return block == LayoutBlock::kFringeColumns || block == LayoutBlock::kFringeRows;
}

bool is_solid(LayoutBlock block) {
  return block == LayoutBlock::kWhite || block == LayoutBlock::kBlack;
}

bool has_fringes(const PhotographLayout& layout, LayoutBlock block) {
  if (is_fringe(block)) return true;
  return layout.code == PatternCode::kPhaseShift && !is_solid(block);
}

size_t axis_of(LayoutBlock block) {
  return block == LayoutBlock::kRows || block == LayoutBlock::kFringeRows ? 1 : 0;
}

int bits_of(double cells) {
  return std::bit_width(static_cast<unsigned>(std::ceil(cells)) - 1u);
}

absl::StatusOr<PhotographLayout> layout_of(const LayoutOptions& options) {
  const std::optional<PatternCode> code = value_of(kCodes, options.layout);
  if (!code) return bad(fmt::format("--layout is \"{}\"; it must be {}", options.layout, kLayoutNames));
  PhotographLayout layout;
  layout.code = *code;
  const bool only_fringes = *code == PatternCode::kPhaseShift;
  GW_ASSIGN_OR_RETURN(
      layout.order,
      order_of(options.order.value_or(only_fringes ? "columns,rows" : "columns,rows,white,black")));
  if (only_fringes && (options.inverse || options.cell_px))
    return bad("--inverse and --cell are for opencv-graycode and binary; phase-shift has neither");
  if (only_fringes && std::ranges::any_of(layout.order, is_fringe))
    return bad("the columns and rows of phase-shift are fringes; pass --order columns,rows");
  if (!only_fringes) GW_RETURN_IF_ERROR(set_bars(options, layout));
  const bool fringes =
      std::ranges::any_of(layout.order, [&](LayoutBlock block) { return has_fringes(layout, block); });
  if (fringes) GW_RETURN_IF_ERROR(set_fringes(options, layout));
  if (!fringes && (options.steps || options.periods || options.shift || options.phase_deg)) {
    return bad(
        fmt::format("--steps, --periods, --shift and --phase are for fringes: phase-shift, or "
                    "fringe-columns or fringe-rows in --order; --layout is {}",
                    options.layout));
  }
  return layout;
}

absl::StatusOr<std::vector<FringePeriod>> periods_of(const std::string& text) {
  std::vector<FringePeriod> periods;
  for (std::string part : split(text)) {
    FringePeriod period{.value = 0.0, .in_px = part.ends_with("px")};
    if (period.in_px) part.resize(part.size() - 2);
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), period.value);
    if (error != std::errc() || end != part.data() + part.size() || !(period.value >= 0.01) ||
        !(period.value <= 1e6)) {
      return bad(
          fmt::format("--periods is \"{}\"; it must be numbers of fringes along a side, such as 1,8,64, or "
                      "lengths, such as 1920px,120px",
                      text));
    }
    periods.push_back(period);
  }
  return periods;
}

absl::StatusOr<bool> is_backward(const std::string& text) {
  const std::optional<bool> backward = value_of(kShifts, text);
  if (backward) return *backward;
  return bad(fmt::format("--shift is \"{}\"; it must be forward or backward", text));
}

std::string options_of(const PhotographLayout& layout) {
  std::vector<std::string_view> order;
  for (const LayoutBlock block : layout.order) order.push_back(name_of(kBlocks, block));
  std::string options =
      fmt::format("--layout {} --order {}", name_of(kCodes, layout.code), fmt::join(order, ","));
  if (layout.code != PatternCode::kPhaseShift)
    options += fmt::format(" --inverse {}", name_of(kComplements, layout.complements));
  if (layout.cell_px != 1.0) options += fmt::format(" --cell {:.6g}", layout.cell_px);
  if (layout.steps == 0) return options;
  std::vector<std::string> periods;
  for (const FringePeriod& period : layout.periods)
    periods.push_back(fmt::format("{}{}", period.value, period.in_px ? "px" : ""));
  options += fmt::format(" --steps {} --periods {} --shift {}", layout.steps, fmt::join(periods, ","),
                         name_of(kShifts, layout.backward));
  return layout.phase_deg == 0.0 ? options : options + fmt::format(" --phase {:.6g}", layout.phase_deg);
}

int count_of(const PhotographLayout& layout, LayoutBlock block, const v1::Monitor& monitor) {
  if (is_solid(block)) return 1;
  if (has_fringes(layout, block)) return layout.steps * static_cast<int>(layout.periods.size());
  return bits_of(side_of(block, monitor) / layout.cell_px) *
         (layout.complements == Complements::kNone ? 1 : 2);
}

absl::StatusOr<std::vector<v1::Frame>> frames_of(const PhotographLayout& layout, const v1::Monitor& monitor,
                                                 const std::vector<std::string>& files) {
  std::vector<v1::Stimulus> shown = shown_in(layout, monitor);
  if (shown.size() != files.size()) {
    std::vector<std::string> blocks;
    for (const LayoutBlock block : layout.order)
      blocks.push_back(fmt::format("{} {}", count_of(layout, block, monitor), name_of(kBlocks, block)));
    return bad(fmt::format("there are {} photographs; {} has {} on a monitor of {}x{} px: {}", files.size(),
                           options_of(layout), shown.size(), monitor.width_px(), monitor.height_px(),
                           fmt::join(blocks, ", ")));
  }
  std::vector<v1::Frame> frames(files.size());
  for (size_t i = 0; i < files.size(); ++i) {
    frames[i].set_file(files[i]);
    frames[i].set_object(true);
    frames[i].set_step(-1);
    frames[i].set_proof(v1::PROOF_IMPORTED);
    *frames[i].mutable_stimulus() = std::move(shown[i]);
    frames[i].mutable_stimulus()->set_panel(monitor.name());
  }
  return frames;
}

}  // namespace glasswing
