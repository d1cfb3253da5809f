#include "client/exchange/photograph_list.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <sstream>
#include <string_view>

#include "client/cli/monitor_argument.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/file/file.h"
#include "core/pattern/pattern.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

using Field = google::protobuf::FieldDescriptor;

constexpr double kNs = 1e9;
constexpr double kLatest_s = 9e9;  // rig time is 64-bit ns

absl::Status bad(const std::string& what) {
  return absl::InvalidArgumentError(what);
}

// Parses the whole text, or returns nullopt.
template <typename Number>
std::optional<Number> parsed(const std::string& text) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == separator) {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

absl::StatusOr<double> number_of(const std::string& name, const std::string& text, double min, double max,
                                 const std::string& accepted) {
  const std::optional<double> value = parsed<double>(text);
  if (value && *value >= min && *value <= max) return *value;
  return bad(fmt::format("{} is \"{}\"; it must be {}", name, text, accepted));
}

absl::StatusOr<bool> truth_of(const std::string& name, const std::string& text) {
  if (text == "true" || text == "false") return text == "true";
  return bad(fmt::format("{} is \"{}\"; it must be true or false", name, text));
}

// Sets a field of Stimulus from its cell.
absl::Status set_field(const Field& field, const std::string& text, v1::Stimulus& stimulus) {
  const google::protobuf::Reflection& reflection = *v1::Stimulus::GetReflection();
  const std::string& name = field.name();
  constexpr double kAny = std::numeric_limits<double>::max();
  switch (field.cpp_type()) {
    case Field::CPPTYPE_STRING:
      reflection.SetString(&stimulus, &field, text);
      return absl::OkStatus();
    case Field::CPPTYPE_BOOL: {
      GW_ASSIGN_OR_RETURN(const bool value, truth_of(name, text));
      reflection.SetBool(&stimulus, &field, value);
      return absl::OkStatus();
    }
    case Field::CPPTYPE_INT32: {
      const std::optional<std::int32_t> value = parsed<std::int32_t>(text);
      if (!value) return bad(fmt::format("{} is \"{}\"; it must be a whole number", name, text));
      reflection.SetInt32(&stimulus, &field, *value);
      return absl::OkStatus();
    }
    case Field::CPPTYPE_UINT32: {
      const std::optional<std::uint32_t> value = parsed<std::uint32_t>(text);
      if (!value) return bad(fmt::format("{} is \"{}\"; it must be a whole number, 0 or more", name, text));
      reflection.SetUInt32(&stimulus, &field, *value);
      return absl::OkStatus();
    }
    default:
      break;
  }
  if (!field.is_repeated()) {
    GW_ASSIGN_OR_RETURN(const double value, number_of(name, text, -kAny, kAny, "a number"));
    reflection.SetDouble(&stimulus, &field, value);
    return absl::OkStatus();
  }
  for (const std::string& part : split(text, ',')) {
    GW_ASSIGN_OR_RETURN(const double value,
                        number_of(name, part, -kAny, kAny, "numbers separated by commas, such as 1,0,0.5"));
    reflection.AddDouble(&stimulus, &field, value);
  }
  return absl::OkStatus();
}

constexpr std::array<std::string_view, 4> kFrameColumns = {"file", "object", "time_s", "exposure_ms"};

std::vector<std::string> all_columns() {
  std::vector<std::string> columns(kFrameColumns.begin(), kFrameColumns.end());
  const google::protobuf::Descriptor& stimulus = *v1::Stimulus::descriptor();
  for (int i = 0; i < stimulus.field_count(); ++i) columns.push_back(stimulus.field(i)->name());
  return columns;
}

class Reader {
 public:
  Reader(PhotographList& list, const PhotographOptions& options) : list_(list), options_(options) {}

  absl::Status read(const std::string& text) {
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      ++line_;
      if (line.ends_with('\r')) line.pop_back();
      if (line.empty()) continue;
      if (!is_utf8(line)) return at_line(bad("it is not UTF-8"));
      const absl::Status status = line[0] == '#' ? read_remark(line.substr(1)) : read_row(line);
      if (!status.ok()) return at_line(status);
    }
    if (list_.lines.empty()) return bad(list_.path.string() + ": it lists no photographs");
    return absl::OkStatus();
  }

 private:
  absl::Status at_line(const absl::Status& status) const {
    return absl::Status(status.code(),
                        fmt::format("{}:{}: {}", list_.path.string(), line_, std::string(status.message())));
  }

  // "#monitor back:1920x1080" is a setting, "# anything" a comment.
  absl::Status read_remark(const std::string& line) {
    if (line.empty() || line[0] == ' ' || line[0] == '#') return absl::OkStatus();
    const size_t space = std::min(line.find(' '), line.size());
    const std::string key = line.substr(0, space), value = line.substr(std::min(space + 1, line.size()));
    if (!columns_.empty())
      return bad(fmt::format("#{} comes after the header row; it must come before it", key));
    if (key == "monitor") {
      GW_ASSIGN_OR_RETURN(const v1::Monitor monitor, parse_monitor_argument(value));
      if (options_.monitors.empty()) *list_.manifest.add_monitors() = monitor;
    } else if (key == "response") {
      if (!options_.response) list_.response = value;
    } else if (key == "black") {
      GW_ASSIGN_OR_RETURN(const double black, number_of(key, value, 0.0, 65535.0, "0 or more codes"));
      if (!options_.black) list_.black = black;
    } else if (key == "white") {
      const std::optional<int> white = parsed<int>(value);
      if (!white) return bad(fmt::format("white is \"{}\"; it must be a code", value));
      if (!options_.white) list_.white = white;
    } else if (key == "scene") {
      list_.manifest.set_scene(value);
    } else {
      return bad(fmt::format(
          "unknown setting \"#{}\"; it must be #monitor, #response, #black, #white or #scene, or a comment "
          "that starts with \"# \"",
          key));
    }
    return absl::OkStatus();
  }

  absl::Status read_row(const std::string& line) {
    const std::vector<std::string> cells = split(line, '\t');
    if (columns_.empty()) return read_header(cells);
    if (cells.size() != columns_.size()) {
      return bad(
          fmt::format("it has {} tab-separated cells; the header row has {}", cells.size(), columns_.size()));
    }
    v1::Frame frame;
    frame.set_step(-1);
    frame.set_proof(v1::PROOF_IMPORTED);
    double time_s = 0.0;
    for (size_t i = 0; i < cells.size(); ++i)
      GW_RETURN_IF_ERROR(read_cell(columns_[i], cells[i], frame, time_s));
    if (time_s > 0.0) {
      frame.set_exposure_start_ns(std::llround(time_s * kNs));
      frame.set_exposure_end_ns(frame.exposure_start_ns() + std::llround(frame.exposure_ms() * 1e6));
    }
    GW_RETURN_IF_ERROR(check_stimulus(*frame.mutable_stimulus()));
    GW_RETURN_IF_ERROR(check_frame(frame));
    const auto [before, fresh] = line_of_file_.emplace(frame.file(), line_);
    if (!fresh) return bad(fmt::format("{} is already listed in line {}", frame.file(), before->second));
    *list_.manifest.add_frames() = std::move(frame);
    list_.lines.push_back(line_);
    return absl::OkStatus();
  }

  absl::Status read_header(const std::vector<std::string>& cells) {
    const std::vector<std::string> known = all_columns();
    for (const std::string& cell : cells) {
      if (std::find(known.begin(), known.end(), cell) == known.end()) {
        return bad(fmt::format("there is no column \"{}\"; columns are {}", cell, fmt::join(known, ", ")));
      }
      if (std::count(cells.begin(), cells.end(), cell) > 1)
        return bad(fmt::format("column \"{}\" is there twice", cell));
    }
    for (const char* needed : {"file", "object", "kind"}) {
      if (std::find(cells.begin(), cells.end(), needed) == cells.end())
        return bad(fmt::format("there is no column \"{}\"; there must be file, object and kind", needed));
    }
    columns_ = cells;
    for (const std::string& text : options_.monitors) {
      GW_ASSIGN_OR_RETURN(*list_.manifest.add_monitors(), parse_monitor_argument(text));
    }
    if (list_.manifest.monitors().empty())
      return bad("no monitor is named before the header row; add #monitor back:1920x1080, or --monitor");
    return absl::OkStatus();
  }

  static absl::Status read_cell(const std::string& column, const std::string& text, v1::Frame& frame,
                                double& time_s) {
    if (column == "file") {
      frame.set_file(text);
    } else if (column == "object") {
      GW_ASSIGN_OR_RETURN(const bool object, truth_of(column, text));
      frame.set_object(object);
    } else if (text.empty()) {
      return absl::OkStatus();
    } else if (column == "time_s") {
      GW_ASSIGN_OR_RETURN(time_s, number_of(column, text, 0.0, kLatest_s, "seconds, 0 or more"));
    } else if (column == "exposure_ms") {
      GW_ASSIGN_OR_RETURN(const double exposure_ms,
                          number_of(column, text, std::numeric_limits<double>::min(), 1e9, "above 0 ms"));
      frame.set_exposure_ms(exposure_ms);
    } else {
      return set_field(*v1::Stimulus::descriptor()->FindFieldByName(column), text, *frame.mutable_stimulus());
    }
    return absl::OkStatus();
  }

  absl::Status check_stimulus(v1::Stimulus& stimulus) const {
    const auto& monitors = list_.manifest.monitors();
    if (stimulus.panel().empty() && monitors.size() == 1) stimulus.set_panel(monitors[0].name());
    const auto monitor = std::find_if(monitors.begin(), monitors.end(), [&](const v1::Monitor& each) {
      return each.name() == stimulus.panel();
    });
    if (monitor == monitors.end()) {
      std::vector<std::string> names;
      for (const v1::Monitor& each : monitors) names.push_back(each.name());
      return bad(
          fmt::format("panel is \"{}\"; it must be a monitor: {}", stimulus.panel(), fmt::join(names, ", ")));
    }
    if (kind_of(stimulus) == StimulusKind::kPhoto || kind_of(stimulus) == StimulusKind::kPatch)
      return absl::OkStatus();  // no pure functions
    return Pattern::create(stimulus, {monitor->width_px(), monitor->height_px()}).status();
  }

  PhotographList& list_;
  const PhotographOptions& options_;
  int line_ = 0;
  std::vector<std::string> columns_;
  std::map<std::string, int> line_of_file_;
};

}  // namespace

std::string PhotographList::place(int frame) const {
  if (lines.empty()) return path.string();
  return fmt::format("{}:{}", path.string(), lines[frame]);
}

absl::Status check_white(const std::filesystem::path& path, int largest, int bits) {
  constexpr int kBits = 16;
  for (const int fewer : {10, 12, 14}) {
    const int highest = (1 << fewer) - 1;
    if (bits == kBits && (largest == highest || largest == highest << (kBits - fewer))) {
      return bad(fmt::format(
          "{}: the largest code of all photographs is {}: {} bits in {}? If so, pass --white {}; if not, "
          "--white 65535",
          path.string(), largest, fewer, kBits, largest));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<PhotographList> read_photograph_list(const std::filesystem::path& path,
                                                    const PhotographOptions& options) {
  GW_ASSIGN_OR_RETURN(const std::string text, read_file(path));
  PhotographList list;
  list.path = path;
  list.manifest.set_format_version(1);
  if (options.response) list.response = *options.response;
  if (options.black) list.black = *options.black;
  list.white = options.white;
  GW_RETURN_IF_ERROR(Reader(list, options).read(text));
  return list;
}

}  // namespace glasswing
