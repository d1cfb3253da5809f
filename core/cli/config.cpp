#include "core/cli/config.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <optional>
#include <set>
#include <sstream>

#include "core/base/status.h"
#include "core/file/file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFileVariable = "GLASSWING_CONFIG";
// The file is shared by all programs; each ignores settings that it does not use.
constexpr std::string_view kKeys[] = {"server", "ca", "certificate", "key", "color"};

std::string environment(const std::string& variable) {
  const char* value = variable.empty() ? nullptr : std::getenv(variable.c_str());
  return value == nullptr ? "" : value;
}

// Empty without a home directory.
fs::path usual_file() {
  const std::string config_home = environment("XDG_CONFIG_HOME"), home = environment("HOME");
  if (config_home.empty() && home.empty()) return {};
  return (config_home.empty() ? fs::path(home) / ".config" : fs::path(config_home)) / "glasswing" /
         "config.toml";
}

constexpr std::string_view kBlank = " \t\r\v\f";

std::string_view without_blanks(std::string_view text) {
  return text.substr(std::min(text.find_first_not_of(kBlank), text.size()));
}

// Removes "VALUE" (with the escapes \" and \\) or 'VALUE' from the front of `text` and returns VALUE.
std::optional<std::string> take_quoted(std::string_view& text) {
  if (text.empty() || (text[0] != '"' && text[0] != '\'')) return std::nullopt;
  const char quote = text[0];
  std::string value;
  for (size_t at = 1; at < text.size(); ++at) {
    if (text[at] == quote) {
      text.remove_prefix(at + 1);
      return value;
    }
    if (quote == '"' && text[at] == '\\') {
      ++at;
      if (at == text.size() || (text[at] != '"' && text[at] != '\\')) return std::nullopt;
    }
    value += text[at];
  }
  return std::nullopt;
}

// KEY = "VALUE" or KEY = 'VALUE', optionally with a comment; nullopt for a blank line or a comment. Not a
// std::regex, which uses stack space for every character.
struct Line {
  std::string key, value;
};
absl::StatusOr<std::optional<Line>> parse_line(std::string_view text) {
  const auto bad = [&] {
    return absl::InvalidArgumentError(
        fmt::format("it is {}; it must be KEY = \"VALUE\", as in TOML", text.substr(0, 200)));
  };
  const auto ends = [](std::string_view rest) { return rest.empty() || rest[0] == '#'; };
  std::string_view rest = without_blanks(text);
  if (ends(rest)) return std::nullopt;
  const auto is_of_key = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-';
  };
  const std::string key(rest.begin(), std::ranges::find_if_not(rest, is_of_key));
  rest = without_blanks(rest.substr(key.size()));
  if (key.empty() || rest.empty() || rest[0] != '=') return bad();
  rest = without_blanks(rest.substr(1));
  const std::optional<std::string> value = take_quoted(rest);
  if (!value || !ends(without_blanks(rest))) return bad();
  return Line{key, *value};
}

}  // namespace

Config::Config(CLI::App& app, std::vector<Setting> settings) : settings_(std::move(settings)) {
  settings_.push_back(
      {.key = "color", .value = "auto", .help = "colours; auto: on a terminal unless NO_COLOR is set"});
  for (Setting& setting : settings_) {
    const std::string variable = setting.environment.empty() ? "" : "; or $" + setting.environment;
    app.add_option("--" + setting.key, setting.given, setting.help + variable)->type_name(setting.type);
  }
  app.get_option("--color")->check(CLI::IsMember({"auto", "always", "never"}));
  app.add_option("--config", file_option_,
                 std::string("file with these settings; or $") + kFileVariable +
                     "; default: ~/.config/glasswing/config.toml, if it exists")
      ->type_name("FILE");
}

const std::string& Config::operator[](const std::string& key) const {
  return std::ranges::find(settings_, key, &Setting::key)->value;
}

absl::Status Config::read(const fs::path& path) {
  GW_ASSIGN_OR_RETURN(const std::string text, read_file(path));
  std::istringstream in(text);
  std::set<std::string> seen;
  int number = 0;
  for (std::string line; std::getline(in, line);) {
    const std::string place = fmt::format("{}:{}: ", path.string(), ++number);
    const absl::StatusOr<std::optional<Line>> parsed = parse_line(line);
    if (!parsed.ok()) return absl::InvalidArgumentError(place + std::string(parsed.status().message()));
    if (!*parsed) continue;
    const auto& [key, value] = **parsed;
    if (std::ranges::find(kKeys, key) == std::end(kKeys))
      return absl::InvalidArgumentError(
          fmt::format("{}there is no key {}; the keys are {}", place, key, fmt::join(kKeys, ", ")));
    if (!seen.insert(key).second)
      return absl::InvalidArgumentError(fmt::format("{}{} is repeated", place, key));
    const auto setting = std::ranges::find(settings_, key, &Setting::key);
    if (setting == settings_.end()) continue;
    setting->value =
        setting->type == "FILE" && !value.empty() ? (path.parent_path() / value).string() : value;
    setting->from = path.string();
  }
  return absl::OkStatus();
}

absl::Status Config::resolve() {
  const std::string asked = file_option_.empty() ? environment(kFileVariable) : file_option_;
  file_ = asked.empty() ? usual_file() : fs::path(asked);
  std::error_code ignored;
  file_is_there_ = !file_.empty() && fs::exists(file_, ignored);
  if (file_is_there_ || !asked.empty()) GW_RETURN_IF_ERROR(read(file_));
  for (Setting& setting : settings_) {
    if (setting.given) {
      setting.value = *setting.given;
      setting.from = "option";
    } else if (const std::string value = environment(setting.environment); !value.empty()) {
      setting.value = value;
      setting.from = setting.environment;
    }
  }
  const Setting& color = *std::ranges::find(settings_, "color", &Setting::key);
  if (color.value == "auto" || color.value == "always" || color.value == "never") return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{}: color is {}; it must be auto, always or never", color.from, color.value));
}

}  // namespace glasswing
