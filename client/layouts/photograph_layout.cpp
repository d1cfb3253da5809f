#include "client/layouts/photograph_layout.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fnmatch.h>

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

namespace fs = std::filesystem;

constexpr int kMinSteps = 3, kMaxSteps = 64;

template <typename Value>
using Named = std::pair<std::string_view, Value>;

constexpr std::array<Named<PatternCode>, 3> kCodes{{{"opencv-graycode", PatternCode::kGray},
                                                    {"binary", PatternCode::kBinary},
                                                    {"phase-shift", PatternCode::kPhaseShift}}};
constexpr std::array<Named<LayoutBlock>, 4> kBlocks{{{"columns", LayoutBlock::kColumns},
                                                     {"rows", LayoutBlock::kRows},
                                                     {"white", LayoutBlock::kWhite},
                                                     {"black", LayoutBlock::kBlack}}};
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
                    "columns or rows among them: columns,rows,white,black",
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
  if (options.inverse)
    return bad("--inverse is for opencv-graycode and binary; the steps of phase-shift have no inverse");
  if (!options.steps || *options.steps < kMinSteps || *options.steps > kMaxSteps) {
    return bad(
        fmt::format("--steps is {}; --layout phase-shift needs the number of steps in a period, {} to {}",
                    options.steps ? std::to_string(*options.steps) : "not given", kMinSteps, kMaxSteps));
  }
  if (!options.periods)
    return bad("--layout phase-shift needs --periods, the number of fringes along a side, as 1,8,64");
  layout.steps = *options.steps;
  GW_ASSIGN_OR_RETURN(layout.periods, periods_of(*options.periods));
  if (options.shift) {
    GW_ASSIGN_OR_RETURN(layout.backward, is_backward(*options.shift));
  }
  return absl::OkStatus();
}

int side_of(LayoutBlock block, const v1::Monitor& monitor) {
  return block == LayoutBlock::kColumns ? monitor.width_px() : monitor.height_px();
}

int bits_of(int side_px) {
  return std::bit_width(static_cast<unsigned>(side_px - 1));
}

v1::Stimulus solid(double light) {
  v1::Stimulus stimulus;
  stimulus.set_kind("solid");
  for (int c = 0; c < 3; ++c) stimulus.add_colour(light);
  return stimulus;
}

v1::Stimulus bars(PatternCode code, LayoutBlock block, int bit, bool inverse) {
  v1::Stimulus stimulus;
  stimulus.set_kind("square");
  stimulus.set_orient(block == LayoutBlock::kColumns ? "vertical_bars" : "horizontal_bars");
  const double first_px = std::exp2(bit);
  stimulus.set_bar_width_px(code == PatternCode::kGray ? 2.0 * first_px : first_px);
  stimulus.set_offset_px(first_px);
  stimulus.set_inverse(inverse);
  return stimulus;
}

void add_bars(const PhotographLayout& layout, LayoutBlock block, int side_px,
              std::vector<v1::Stimulus>& shown) {
  for (int bit = bits_of(side_px) - 1; bit >= 0; --bit) {
    const auto add = [&](bool inverse) { shown.push_back(bars(layout.code, block, bit, inverse)); };
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
      stimulus.set_phi_deg(block == LayoutBlock::kColumns ? 0.0 : 90.0);
      stimulus.set_period_px(period.px(side_px));
      const int turned = layout.backward ? (layout.steps - step) % layout.steps : step;
      stimulus.set_phase_deg(360.0 * turned / layout.steps);
      stimulus.set_peak(1.0);
      shown.push_back(std::move(stimulus));
    }
  }
}

std::vector<v1::Stimulus> shown_in(const PhotographLayout& layout, const v1::Monitor& monitor) {
  std::vector<v1::Stimulus> shown;
  for (const LayoutBlock block : layout.order) {
    if (block == LayoutBlock::kWhite || block == LayoutBlock::kBlack) {
      shown.push_back(solid(block == LayoutBlock::kWhite ? 1.0 : 0.0));
    } else if (layout.code == PatternCode::kPhaseShift) {
      add_fringes(layout, block, side_of(block, monitor), shown);
    } else {
      add_bars(layout, block, side_of(block, monitor), shown);
    }
  }
  return shown;
}

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

// The digits from `at` on, without leading zeros; moves `at` behind them.
std::string_view number_at(const std::string& text, size_t& at) {
  while (at < text.size() && text[at] == '0') ++at;
  const size_t start = at;
  while (at < text.size() && is_digit(text[at])) ++at;
  return std::string_view(text).substr(start, at - start);
}

bool is_picture(const fs::path& file) {
  constexpr std::array<std::string_view, 5> kSuffixes{".png", ".jpg", ".jpeg", ".tif", ".tiff"};
  std::string suffix = file.extension().string();
  for (char& c : suffix) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return std::ranges::find(kSuffixes, suffix) != kSuffixes.end();
}

}  // namespace

absl::StatusOr<PhotographLayout> layout_of(const LayoutOptions& options) {
  const std::optional<PatternCode> code = value_of(kCodes, options.layout);
  if (!code) return bad(fmt::format("--layout is \"{}\"; it must be {}", options.layout, kLayoutNames));
  PhotographLayout layout;
  layout.code = *code;
  const bool fringes = *code == PatternCode::kPhaseShift;
  GW_ASSIGN_OR_RETURN(
      layout.order, order_of(options.order.value_or(fringes ? "columns,rows" : "columns,rows,white,black")));
  if (fringes) {
    GW_RETURN_IF_ERROR(set_fringes(options, layout));
    return layout;
  }
  if (options.steps || options.periods || options.shift)
    return bad(
        fmt::format("--steps, --periods and --shift are for phase-shift; --layout is {}", options.layout));
  const std::string inverse = options.inverse.value_or(*code == PatternCode::kGray ? "after" : "none");
  const std::optional<Complements> complements = value_of(kComplements, inverse);
  if (!complements) return bad(fmt::format("--inverse is \"{}\"; it must be after, before or none", inverse));
  layout.complements = *complements;
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
          fmt::format("--periods is \"{}\"; it must be numbers of fringes along a side, as 1,8,64, or "
                      "lengths, as 1920px,120px",
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
    return options + fmt::format(" --inverse {}", name_of(kComplements, layout.complements));
  std::vector<std::string> periods;
  for (const FringePeriod& period : layout.periods)
    periods.push_back(fmt::format("{}{}", period.value, period.in_px ? "px" : ""));
  return options + fmt::format(" --steps {} --periods {} --shift {}", layout.steps, fmt::join(periods, ","),
                               name_of(kShifts, layout.backward));
}

int count_of(const PhotographLayout& layout, LayoutBlock block, const v1::Monitor& monitor) {
  if (block == LayoutBlock::kWhite || block == LayoutBlock::kBlack) return 1;
  if (layout.code == PatternCode::kPhaseShift) return layout.steps * static_cast<int>(layout.periods.size());
  return bits_of(side_of(block, monitor)) * (layout.complements == Complements::kNone ? 1 : 2);
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

bool natural_less(const std::string& a, const std::string& b) {
  size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (is_digit(a[i]) && is_digit(b[j])) {
      const std::string_view one = number_at(a, i), other = number_at(b, j);
      if (one.size() != other.size()) return one.size() < other.size();
      if (one != other) return one < other;
    } else {
      if (a[i] != b[j]) return static_cast<unsigned char>(a[i]) < static_cast<unsigned char>(b[j]);
      ++i;
      ++j;
    }
  }
  if (a.size() - i != b.size() - j) return a.size() - i < b.size() - j;
  return a < b;  // the same but for leading zeros
}

absl::StatusOr<std::vector<std::string>> photographs_in(const fs::path& directory, const std::string& glob) {
  std::vector<std::string> files;
  std::error_code error;
  fs::recursive_directory_iterator entry(directory, error), end;
  for (; !error && entry != end; entry.increment(error)) {
    if (glob.empty()) entry.disable_recursion_pending();
    if (!entry->is_regular_file(error) || !is_picture(entry->path())) continue;
    const std::string file = entry->path().lexically_relative(directory).string();
    if (!glob.empty() && ::fnmatch(glob.c_str(), file.c_str(), FNM_PERIOD) != 0) continue;
    files.push_back(file);
    if (files.size() > kMaxPhotographs) {
      return bad(fmt::format("{} holds more than {} photographs; --files can choose some of them",
                             directory.string(), kMaxPhotographs));
    }
  }
  if (error)
    return absl::NotFoundError(fmt::format("{} cannot be read: {}", directory.string(), error.message()));
  if (files.empty()) {
    return absl::NotFoundError(fmt::format("{} holds no PNG, JPEG or TIFF{}", directory.string(),
                                           glob.empty() ? "" : fmt::format(" that fits --files {}", glob)));
  }
  std::ranges::sort(files, natural_less);
  return files;
}

}  // namespace glasswing
