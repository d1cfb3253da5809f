#include "core/cli/command_line.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <iostream>
#include <map>

#include "core/base/utf8.h"
#include "core/base/version.h"
#include "core/cli/colour.h"
#include "core/cli/help.h"
#include "core/cli/interrupt.h"
#include "core/cli/output_file.h"
#include "core/cli/suggestion.h"

namespace glasswing {
namespace {

int fail(const std::string& program, std::string message, bool coloured, int status = kFailure) {
  std::ranges::replace(message, '\n', ' ');
  std::cerr << painted(program + ":", coloured ? Paint::kBad : Paint::kNone) << " " << printable(message)
            << "\n";
  return status;
}

// Sets the type of value (SESSION, FILE, DIR) of options and arguments by their names, for --help and
// completion. Commands override it if the name does not determine it.
void name_values(CLI::App& app) {
  static const std::map<std::string, const char*> kKinds = {
      {"session", "SESSION"}, {"sessions", "SESSION"}, {"matte", "FILE"},    {"plan", "FILE"},
      {"input", "FILE"},      {"a", "FILE"},           {"b", "FILE"},        {"output", "FILE"},
      {"directory", "FILE"},  {"--plan", "FILE"},      {"--output", "FILE"}, {"--background", "FILE"},
      {"--match", "FILE"},    {"--matte", "FILE"},     {"--list", "FILE"},   {"--archive", "DIR"},
      {"--empty", "DIR"},     {"mattes", "FILE"},      {"--ids", "FILE"}};
  for (CLI::Option* option : app.get_options({})) {
    const auto kind = kKinds.find(option->get_positional() ? option->get_name(true) : option->get_name());
    if (kind != kKinds.end() && option->get_type_name() == "TEXT") option->type_name(kind->second);
  }
  for (CLI::App* sub : app.get_subcommands({})) name_values(*sub);
}

// Inner subcommands inherit their parent's group; they get their own.
void ungroup_inner(CLI::App& app) {
  for (CLI::App* command : app.get_subcommands({})) {
    for (CLI::App* inner : command->get_subcommands({})) inner->group("Commands");
  }
}

// The command selected by the words.
const CLI::App& deepest(const CLI::App& app) {
  const std::vector<CLI::App*> parsed = app.get_subcommands();
  return parsed.empty() ? app : deepest(*parsed.back());
}

// "glasswing plan check"
std::string path_of(const CLI::App& command) {
  const CLI::App* parent = command.get_parent();
  return (parent == nullptr ? "" : path_of(*parent) + " ") + command.get_name();
}

// A word of the command line that is not a command or option, and what may have been meant; empty: all are
// valid.
std::string unknown_word(const CLI::App& app) {
  if (app.remaining().empty()) return "";
  const std::string word = app.remaining().front();
  const CLI::App& command = deepest(app);
  const std::vector<const CLI::App*> subcommands = subcommands_of(command);
  std::vector<std::string> known;
  std::string what;
  if (word.starts_with("--")) {
    what = fmt::format("there is no option {}", word);
    for (const CLI::App* at = &command; at != nullptr; at = at->get_parent()) {
      for (const CLI::Option* option : options_of(*at)) {
        for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
      }
    }
  } else if (!subcommands.empty()) {
    what = fmt::format("there is no command{} {}", path_of(command).substr(app.get_name().size()), word);
    for (const CLI::App* sub : subcommands) known.push_back(sub->get_name());
  } else {
    return "";
  }
  const std::string meant = nearest(word.substr(0, word.find('=')), known);
  return what + (meant.empty() ? "" : fmt::format("; did you mean {}?", meant));
}

// `help X` as `X --help`, and no words as --help.
std::vector<std::string> words_of(int argc, const char* const* argv) {
  std::vector<std::string> words(argv + 1, argv + argc);
  if (words.empty() || words.front() == "help") {
    words.erase(words.begin(), words.begin() + (words.empty() ? 0 : 1));
    words.emplace_back("--help");
  }
  std::ranges::reverse(words);  // as CLI::App wants them
  return words;
}

// A command's messages go to standard error while its file goes to standard output.
class Answers {
 public:
  explicit Answers(const CLI::App& command) {
    const CLI::Option* const output = command.get_option_no_throw("--output");
    if (output != nullptr && !output->empty() && output->as<std::string>() == kStandardOutput)
      usual_ = std::cout.rdbuf(std::cerr.rdbuf());
  }
  Answers(const Answers&) = delete;
  Answers& operator=(const Answers&) = delete;
  ~Answers() {
    if (usual_ != nullptr) std::cout.rdbuf(usual_);
  }
  int fd() const { return usual_ == nullptr ? STDOUT_FILENO : STDERR_FILENO; }

 private:
  std::streambuf* usual_ = nullptr;
};

constexpr const char* kNotTaken = "the answer could not be written to standard output";

}  // namespace

int run_command_line(int argc, const char* const* argv, const Program& program, CommandLine& command_line) {
  CLI::App app(program.description, program.name);
  use_help_format(app);
  app.footer(program.footer);
  app.fallthrough();
  app.require_subcommand(1);
  app.set_version_flag("--version", kVersion, "print the version and exit");
  app.get_help_ptr()->description("print this help and exit");
  Config config(app, program.settings);
  app.add_flag("--json", command_line.json, "write the answer as JSON");
  app.add_flag("--tsv", command_line.tsv, "write lists as tab-separated values with a header row")
      ->excludes("--json");
  program.add_commands(app, config);
  ungroup_inner(app);
  name_values(app);

  const auto failed = [&](std::string message, int status) {
    return fail(program.name, std::move(message), is_coloured(config["color"], STDERR_FILENO), status);
  };
  try {
    app.parse(words_of(argc, argv));
    absl::Status configured = config.resolve();
    if (configured.ok() && program.configure) configured = program.configure(config);
    if (!configured.ok()) return failed(std::string(configured.message()), kUsageError);
    const Answers answers(deepest(app));
    command_line.coloured = is_coloured(config["color"], answers.fd());
    const absl::Status status = command_line.run();
    if (!status.ok()) {
      const bool broken_off = absl::IsCancelled(status) && interrupted();
      return failed(std::string(status.message()), broken_off ? kInterrupted : kFailure);
    }
    return std::cout.flush() ? command_line.exit_status : failed(kNotTaken, kFailure);
  } catch (const CLI::ParseError& error) {
    const std::string unknown = unknown_word(app);
    if (error.get_exit_code() == 0 && unknown.empty()) {
      const int status = app.exit(error);
      return std::cout.flush() ? status : failed(kNotTaken, kFailure);
    }
    return failed(fmt::format("{} ({} --help lists them)", unknown.empty() ? error.what() : unknown,
                              path_of(deepest(app))),
                  kUsageError);
  } catch (const std::exception& error) {
    return failed(error.what(), kFailure);
  }
}

}  // namespace glasswing
