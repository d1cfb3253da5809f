#include "client/cli/client.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <map>

#include "client/cli/caller_metadata.h"
#include "client/cli/colour.h"
#include "client/cli/config.h"
#include "client/cli/interrupt.h"
#include "client/cli/output_file.h"
#include "client/cli/suggestion.h"
#include "core/base/address.h"
#include "core/base/utf8.h"
#include "core/base/version.h"
#include "core/cli/help.h"
#include "core/security/tls.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

int fail(std::string message, bool coloured, int status = kFailure) {
  std::ranges::replace(message, '\n', ' ');
  std::cerr << painted("glasswing:", coloured ? Paint::kBad : Paint::kNone) << " " << printable(message)
            << "\n";
  return status;
}

// Sets the type of value (SESSION, FILE, DIR) of options and arguments by their names, for --help and
// completion. Commands override it where the name does not tell.
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

// Inner subcommands inherit their parent's group; they get one of their own.
void ungroup_inner(CLI::App& app) {
  for (CLI::App* command : app.get_subcommands({})) {
    for (CLI::App* inner : command->get_subcommands({})) inner->group("Commands");
  }
}

// The command that the words have led to.
const CLI::App& deepest(const CLI::App& app) {
  const std::vector<CLI::App*> parsed = app.get_subcommands();
  return parsed.empty() ? app : deepest(*parsed.back());
}

// "glasswing plan check"
std::string path_of(const CLI::App& command) {
  const CLI::App* parent = command.get_parent();
  return (parent == nullptr ? "" : path_of(*parent) + " ") + command.get_name();
}

// A word of the command line that is no command or option, and what may have been meant; empty: all are.
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

// `help X` as `X --help`, and nothing as --help.
std::vector<std::string> words_of(int argc, const char* const* argv) {
  std::vector<std::string> words(argv + 1, argv + argc);
  if (words.empty() || words.front() == "help") {
    words.erase(words.begin(), words.begin() + (words.empty() ? 0 : 1));
    words.emplace_back("--help");
  }
  std::ranges::reverse(words);  // as CLI::App wants them
  return words;
}

// What a command says goes to standard error while its file goes to standard output.
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

int run_client(int argc, const char* const* argv, const AddCommands& add_commands) {
  ::setenv("GRPC_VERBOSITY", "NONE", 0);  // we report each failure once
  spdlog::set_level(spdlog::level::off);  // logs are for daemons
  send_caller_metadata();
  Client client;
  CLI::App app("Captures environment mattes and composites the object over other pictures.", "glasswing");
  use_help_format(app);
  app.footer(
      "Examples:\n"
      "  glasswing capture deploy/plans/crystal.txtpb --session vase --watch\n"
      "  glasswing solve vase --watch\n"
      "  glasswing fetch vase -o vase.exr\n"
      "  glasswing composite vase.exr --background harbour.png -o vase.png");
  app.fallthrough();
  app.require_subcommand(1);
  app.set_version_flag("--version", kVersion, "print the version and exit");
  app.get_help_ptr()->description("print this help and exit");
  Config config(app);
  app.add_flag("--json", client.json, "write the answer as JSON");
  app.add_flag("--tsv", client.tsv, "write lists as tab-separated values with a header row")
      ->excludes("--json");
  add_commands(app, client, config);
  ungroup_inner(app);
  name_values(app);

  const auto coloured = [&config](int fd) { return is_coloured(config["color"], fd); };
  try {
    app.parse(words_of(argc, argv));
    const absl::Status configured = config.resolve();
    if (!configured.ok())
      return fail(std::string(configured.message()), coloured(STDERR_FILENO), kUsageError);
    client.server = config["server"];
    if (const absl::Status parsed = parse_address(client.server).status(); !parsed.ok()) {
      return fail(fmt::format("--server: {}", std::string(parsed.message())), coloured(STDERR_FILENO),
                  kUsageError);
    }
    const Answers answers(deepest(app));
    client.coloured = coloured(answers.fd());
    // The first call reports what is wrong with the files; commands that make no calls do not need them.
    (void)use_tls({config["ca"], config["certificate"], config["key"]});
    const absl::Status status = client.run();
    if (status.ok()) {
      if (std::cout.flush()) return client.exit_status;
      return fail(kNotTaken, coloured(STDERR_FILENO));
    }
    const bool broken_off = absl::IsCancelled(status) && interrupted();
    std::string message(status.message());
    if (message == client.server_title() + " does not answer")
      message += "; start glasswing-server there, or name another with --server";
    return fail(std::move(message), coloured(STDERR_FILENO), broken_off ? kInterrupted : kFailure);
  } catch (const CLI::ParseError& error) {
    const std::string unknown = unknown_word(app);
    if (error.get_exit_code() == 0 && unknown.empty()) {
      const int status = app.exit(error);
      return std::cout.flush() ? status : fail(kNotTaken, coloured(STDERR_FILENO));
    }
    return fail(fmt::format("{} ({} --help lists what there is)", unknown.empty() ? error.what() : unknown,
                            path_of(deepest(app))),
                coloured(STDERR_FILENO), kUsageError);
  } catch (const std::exception& error) {
    return fail(error.what(), coloured(STDERR_FILENO));
  }
}

}  // namespace glasswing
