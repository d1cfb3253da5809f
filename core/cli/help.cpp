#include "core/cli/help.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <sstream>

namespace glasswing {
namespace {

constexpr size_t kColumn = 30;  // where descriptions begin
constexpr size_t kWidth = 110;

// CLI11's type name of an option: its type, then after colons the descriptions of its checks.
std::vector<std::string> type_parts(const CLI::Option& option) {
  return CLI::detail::split(option.get_type_name(), ':');
}

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_option(const CLI::Option* option, bool positional) const override {
    const std::string value = value_of(*option);
    const std::string name = positional ? option->get_name(true, false)
                                        : option->get_name(false, true) + (value.empty() ? "" : " ");
    return help_entry(positional ? name : name + value, description_of(*option));
  }
  std::string make_subcommand(const CLI::App* command) const override {
    return help_entry(command->get_name(), command->get_description());
  }
};

}  // namespace

std::string help_entry(const std::string& name, const std::string& description) {
  std::string text = "  " + name, line;
  text += text.size() < kColumn ? std::string(kColumn - text.size(), ' ') : "\n" + std::string(kColumn, ' ');
  for (const std::string& word : words_of(description)) {
    if (!line.empty() && kColumn + line.size() + 1 + word.size() > kWidth) {
      text += line + "\n" + std::string(kColumn, ' ');
      line.clear();
    }
    line += (line.empty() ? "" : " ") + word;
  }
  return text + line + "\n";
}

std::vector<std::string> choices_of(const CLI::Option& option) {
  for (const std::string& part : type_parts(option)) {
    if (part.starts_with('{') && part.ends_with('}'))
      return CLI::detail::split(part.substr(1, part.size() - 2), ',');
  }
  return {};
}

std::string value_of(const CLI::Option& option) {
  if (option.get_type_size() == 0 || option.get_expected_max() == 0) return "";
  const std::vector<std::string> choices = choices_of(option);
  if (!choices.empty()) return fmt::format("{}", fmt::join(choices, "|"));
  const std::vector<std::string> parts = type_parts(option);
  if (std::ranges::find(parts, "DIR") != parts.end()) return "DIR";
  if (parts[0] == "FLOAT" || parts[0] == "INT" || parts[0] == "UINT") return "NUMBER";
  return parts[0];
}

std::string description_of(const CLI::Option& option) {
  std::vector<std::string> more;
  for (const std::string& part : type_parts(option)) {
    double low = 0.0, high = 0.0;
    if (std::sscanf(part.c_str(), "%*s in [%lg - %lg]", &low, &high) == 2)
      more.push_back(fmt::format("{:.10g} to {:.10g}", low, high));
  }
  if (!option.get_default_str().empty()) more.push_back("default: " + option.get_default_str());
  if (option.get_required() && option.nonpositional()) more.push_back("required");
  return option.get_description() + (more.empty() ? "" : fmt::format(" ({})", fmt::join(more, "; ")));
}

Footer footer_of(const CLI::App& command) {
  Footer footer;
  std::istringstream in(command.get_footer());
  bool examples = false;
  for (std::string line; std::getline(in, line);) {
    if (line == "Example:" || line == "Examples:") {
      examples = true;
    } else if (!examples) {
      footer.text += line + "\n";
    } else if (!line.empty()) {
      footer.examples.push_back(CLI::detail::trim_copy(line));
    }
  }
  CLI::detail::trim(footer.text);
  return footer;
}

std::vector<const CLI::App*> subcommands_of(const CLI::App& command) {
  return command.get_subcommands([](const CLI::App* sub) { return !sub->get_group().empty(); });
}

std::vector<const CLI::Option*> options_of(const CLI::App& command) {
  return command.get_options(
      [](const CLI::Option* option) { return option->nonpositional() && !option->get_group().empty(); });
}

std::vector<const CLI::Option*> positionals_of(const CLI::App& command) {
  return command.get_options(
      [](const CLI::Option* option) { return option->get_positional() && !option->get_group().empty(); });
}

void use_help_format(CLI::App& app) {
  app.formatter(std::make_shared<HelpFormatter>());
}

}  // namespace glasswing
