#include "core/cli/man_page.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cctype>
#include <cstdlib>
#include <ctime>
#include <sstream>

#include "core/base/status.h"
#include "core/base/version.h"
#include "core/cli/help.h"
#include "core/file/file.h"

namespace glasswing {
namespace {

std::string today() {
  const char* epoch = std::getenv("SOURCE_DATE_EPOCH");
  const std::time_t time = epoch != nullptr ? std::strtoll(epoch, nullptr, 10) : std::time(nullptr);
  return fmt::format("{:%Y-%m-%d}", fmt::gmtime(time));
}

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

// Escapes what troff would interpret: backslashes, dashes, and dots and quotes at the start of a line.
std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const bool begins = out.empty() || out.back() == '\n';
    if (begins && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else {
      out += c;
    }
  }
  return out;
}

std::string bold(const std::string& text) {
  return "\\fB" + escaped(text) + "\\fR";
}

std::string italic(const std::string& text) {
  return "\\fI" + escaped(text) + "\\fR";
}

std::string as_it_is(const std::string& lines) {
  return ".nf\n" + escaped(lines) + "\n.fi\n";
}

// Paragraphs are separated by empty lines; indented ones keep their line breaks.
std::string paragraphs(const std::string& text) {
  std::string out, paragraph;
  std::istringstream in(text + "\n\n");
  for (std::string line; std::getline(in, line);) {
    if (!line.empty()) {
      paragraph += (paragraph.empty() ? "" : "\n") + line;
      continue;
    }
    if (paragraph.empty()) continue;
    if (!out.empty()) out += ".PP\n";
    out += paragraph.starts_with("  ") ? as_it_is(paragraph) : escaped(paragraph) + "\n";
    paragraph.clear();
  }
  return out;
}

std::string synopsis(const CLI::App& command, const std::string& name) {
  std::string line = bold(name) + " [" + italic("options") + "]";
  for (const CLI::Option* positional : positionals_of(command)) {
    const std::string words = italic(positional->get_name(true, false));
    line += positional->get_required() ? " " + words : " [" + words + "]";
  }
  if (!subcommands_of(command).empty()) {
    const bool needed = command.get_require_subcommand_min() > 0;
    line += (needed ? " " : " [") + italic("command") + " ..." + (needed ? "" : "]");
  }
  return line + "\n";
}

std::string options(const std::string& title, const std::vector<const CLI::Option*>& options) {
  if (options.empty()) return "";
  std::string out = ".SH " + title + "\n";
  for (const CLI::Option* option : options) {
    std::string names;
    if (option->get_positional()) {
      names = italic(option->get_name(true, false));
    } else {
      for (const std::string& name : option->get_snames())
        names += (names.empty() ? "" : ", ") + bold("-" + name);
      for (const std::string& name : option->get_lnames())
        names += (names.empty() ? "" : ", ") + bold("--" + name);
      if (const std::string value = value_of(*option); !value.empty()) names += " " + italic(value);
    }
    out += ".TP\n" + names + "\n" + escaped(description_of(*option)) + "\n";
  }
  return out;
}

std::string commands(const CLI::App& program, const std::string& page, int section) {
  std::string out, group;
  for (const CLI::App* command : subcommands_of(program)) {
    if (out.empty()) out = ".SH COMMANDS\n";
    if (command->get_group() != group) out += ".SS " + (group = command->get_group()) + "\n";
    out += fmt::format(".TP\n{}({})\n{}\n", bold(page + "-" + command->get_name()), section,
                       escaped(command->get_description()));
  }
  return out;
}

// `title` "glasswing plan check", `page` "glasswing-plan-check".
absl::Status write_page(const CLI::App& command, const std::string& title, const std::string& page,
                        const std::string& above, int section, const std::filesystem::path& directory,
                        const std::string& more) {
  const Footer footer = footer_of(command);
  std::string summary = command.get_description();
  if (summary.ends_with('.')) summary.pop_back();
  std::string text = fmt::format(
      ".TH \"{}\" \"{}\" \"{}\" \"glasswing {}\" \"Glasswing\"\n.SH NAME\n{} \\- {}\n.SH SYNOPSIS\n{}.SH "
      "DESCRIPTION\n{}",
      upper(page), section, today(), kVersion, page, escaped(summary), synopsis(command, title),
      paragraphs(command.get_description() + "\n\n" + footer.text));
  text += commands(command, page, section) + options("ARGUMENTS", positionals_of(command)) +
          options("OPTIONS", options_of(command));
  if (!above.empty()) text += fmt::format(".PP\nThe options of {}({}) also apply.\n", bold(above), section);
  text += more;
  if (!footer.examples.empty()) {
    text += ".SH EXAMPLES\n.nf\n";
    for (const std::string& line : footer.examples) text += escaped(line) + "\n";
    text += ".fi\n";
  }
  if (!above.empty()) text += fmt::format(".SH SEE ALSO\n{}({})\n", bold(above), section);
  GW_RETURN_IF_ERROR(write_file_durably(directory / fmt::format("{}.{}", page, section), text));
  for (const CLI::App* sub : subcommands_of(command)) {
    GW_RETURN_IF_ERROR(write_page(*sub, title + " " + sub->get_name(), page + "-" + sub->get_name(), page,
                                  section, directory, ""));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status write_man_pages(const CLI::App& program, int section, const std::filesystem::path& directory,
                             const std::string& more) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error) return absl::ErrnoToStatus(error.value(), fmt::format("cannot create {}", directory.string()));
  const std::string& name = program.get_name();
  return write_page(program, name, name, "", section, directory, more);
}

void add_man_pages_command(CLI::App& app, CommandLine& command_line, std::string more) {
  auto directory = std::make_shared<std::string>();
  CLI::App& command = *app.add_subcommand("man", "Write the manual pages.");
  command.group("");
  command.add_option("directory", *directory, "the directory to write to")->required();
  command.callback([&app, &command_line, directory, more = std::move(more)] {
    command_line.run = [&app, directory, more] { return write_man_pages(app, 1, *directory, more); };
  });
}

void set_up_help(CLI::App& daemon, const std::string& name) {
  daemon.name(name);
  use_help_format(daemon);
  const auto write = [&daemon](const std::string& directory) {
    const absl::Status written = write_man_pages(daemon, 8, directory);
    if (written.ok()) throw CLI::Success();
    throw CLI::FileError(std::string(written.message()), 1);
  };
  daemon.add_option_function<std::string>("--man", write)->trigger_on_parse()->group("");
}

}  // namespace glasswing
