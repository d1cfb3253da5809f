#include "client/cli/completion.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <iostream>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/rpc.h"
#include "core/cli/help.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

using Visit = std::function<void(const CLI::App& command, const std::string& path)>;

// The program first, with an empty path; then every command: "plan", "plan check".
void visit(const CLI::App& command, const std::string& path, const Visit& each) {
  each(command, path);
  for (const CLI::App* sub : subcommands_of(command))
    visit(*sub, path + (path.empty() ? "" : " ") + sub->get_name(), each);
}

// All have --help; here it is the program's.
std::vector<const CLI::Option*> own_options(const CLI::App& command) {
  std::vector<const CLI::Option*> options = options_of(command);
  if (command.get_parent() != nullptr) std::erase(options, command.get_help_ptr());
  return options;
}

std::vector<std::string> names_of(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  return names;
}

std::string option_words(const CLI::App& command) {
  std::vector<std::string> words;
  for (const CLI::Option* option : own_options(command)) {
    const std::vector<std::string> names = names_of(*option);
    words.insert(words.end(), names.begin(), names.end());
  }
  return fmt::format("{}", fmt::join(words, " "));
}

std::string command_words(const CLI::App& command) {
  std::vector<std::string> words;
  for (const CLI::App* sub : subcommands_of(command)) words.push_back(sub->get_name());
  return fmt::format("{}", fmt::join(words, " "));
}

// FILE, DIR, SESSION, the choices, or "-" for what only a person knows; empty for a flag.
std::string kind_of(const CLI::Option& option) {
  const std::string value = value_of(option);
  const std::vector<std::string> choices = choices_of(option);
  if (!choices.empty()) return fmt::format("{}", fmt::join(choices, " "));
  const bool known = value.empty() || value == "FILE" || value == "DIR" || value == "SESSION";
  return known ? value : "-";
}

// In single quotes, for any of the shells.
std::string quoted(const std::string& text) {
  return "'" + CLI::detail::find_and_replace(text, "'", "'\\''") + "'";
}

constexpr const char* kBashFunctions = R"bash(
# Completes `word`, which is of the kind $1.
_glasswing_reply() {
  local words=
  case $1 in
    FILE) compopt -o filenames 2>/dev/null; mapfile -t COMPREPLY < <(compgen -f -- "$word"); return ;;
    DIR) compopt -o filenames 2>/dev/null; mapfile -t COMPREPLY < <(compgen -d -- "$word"); return ;;
    SESSION) words=$("${COMP_WORDS[0]}" __sessions "${connection[@]}" 2>/dev/null) ;;
    - | '') ;;
    *) words=$1 ;;
  esac
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word")
}

_glasswing() {
  # The shell's own words are cut at = and :, which our values have.
  local -a typed connection=()
  read -ra typed <<< "${COMP_LINE:0:COMP_POINT}"
  [[ ${COMP_LINE:COMP_POINT-1:1} == ' ' ]] && typed+=('')
  local word=${typed[-1]} path= commands= options= option= kind= count=0 i
  local -a arguments=()
  COMPREPLY=()
  _glasswing_words
  for ((i = 1; i < ${#typed[@]} - 1; ++i)); do
    if [[ -n $kind ]]; then
      case $option in --server | --ca | --certificate | --key | --config) connection+=("$option" "${typed[i]}") ;; esac
      kind=
    elif [[ ${typed[i]} == --*=* ]]; then
      case ${typed[i]} in --server=* | --ca=* | --certificate=* | --key=* | --config=*) connection+=("${typed[i]}") ;; esac
    elif [[ ${typed[i]} == -* ]]; then
      option=${typed[i]}
      _glasswing_kind
    elif [[ " $commands " == *" ${typed[i]} "* ]]; then
      path=${path:+$path }${typed[i]}
      _glasswing_words
    else
      ((++count))
    fi
  done
  if [[ -n $kind ]]; then
    _glasswing_reply "$kind"
  elif [[ $word == --*=* ]]; then
    option=${word%%=*} word=${word#*=}
    _glasswing_kind
    _glasswing_reply "$kind"
  elif [[ $word == -* ]]; then
    _glasswing_reply "$options"
  elif [[ -n $commands ]]; then
    _glasswing_reply "$commands"
  else
    _glasswing_reply "${arguments[count]}"
  fi
}

complete -F _glasswing glasswing
)bash";

// A spec of zsh's _arguments.
std::string zsh_action(const std::string& kind) {
  if (kind == "FILE") return "_files";
  if (kind == "DIR") return "_files -/";
  if (kind == "SESSION") return "__glasswing_known_sessions";
  return kind == "-" ? " " : "(" + kind + ")";
}

std::string zsh_specs(const CLI::App& command) {
  std::string specs;
  for (const CLI::Option* option : own_options(command)) {
    std::string description = description_of(*option);
    for (const char* special : {"\\", "[", "]", ":"})
      description = CLI::detail::find_and_replace(description, special, std::string("\\") + special);
    const std::string kind = kind_of(*option);
    const std::string value = kind.empty() ? "" : ":" + std::string("value") + ":" + zsh_action(kind);
    const bool again = option->get_expected_max() > 1;
    for (const std::string& name : names_of(*option))
      specs += " \\\n    " + quoted((again ? "*" : "") + name + "[" + description + "]" + value);
  }
  return specs;
}

std::string zsh_function(const std::string& path) {
  return "_glasswing" + (path.empty() ? "" : "_" + CLI::detail::find_and_replace(path, " ", "_"));
}

std::string zsh_command(const CLI::App& command, const std::string& path, const std::string& global) {
  std::string text = zsh_function(path) + "() {\n";
  const std::string specs = global + (path.empty() ? "" : zsh_specs(command));
  if (subcommands_of(command).empty()) {
    text += "  _arguments" + specs;
    for (const CLI::Option* positional : positionals_of(command))
      text += " \\\n    " + quoted(":" + positional->get_name(true) + ":" + zsh_action(kind_of(*positional)));
    return text + "\n}\n\n";
  }
  text += "  local state line\n  _arguments -C" + specs + " \\\n    '1: :->command' '*:: :->arguments'\n";
  text += "  case $state in\n    command)\n      local -a commands=(\n";
  std::string branches;
  for (const CLI::App* sub : subcommands_of(command)) {
    text +=
        "        " +
        quoted(sub->get_name() + ":" + CLI::detail::find_and_replace(sub->get_description(), ":", "\\:")) +
        "\n";
    branches += "        " + sub->get_name() + ") " +
                zsh_function(path + (path.empty() ? "" : " ") + sub->get_name()) + " ;;\n";
  }
  return text + "      )\n      _describe command commands ;;\n    arguments)\n      case $words[1] in\n" +
         branches + "      esac ;;\n  esac\n}\n\n";
}

std::string fish_action(const std::string& kind) {
  if (kind == "FILE") return " -F";
  if (kind == "DIR") return " -a '(__fish_complete_directories)'";
  if (kind == "SESSION") return " -a '(__glasswing_sessions)'";
  return kind == "-" ? "" : " -a " + quoted(kind);
}

absl::Status print_sessions(const Client& client) {
  constexpr std::chrono::milliseconds kPatience(1500);  // of a person who pressed Tab
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  const auto listed = call(server, &v1::SessionService::Stub::ListSessions, {}, kPatience);
  if (!listed.ok()) return absl::OkStatus();  // nothing to offer
  for (const v1::Session& session : listed->sessions()) std::cout << session.name() << "\n";
  return absl::OkStatus();
}

}  // namespace

std::string bash_completion(const CLI::App& app) {
  const std::string global = option_words(app);
  std::string words =
      "# bash completion for glasswing\n\n_glasswing_words() {  # of $path\n  case $path in\n";
  std::string kinds = "_glasswing_kind() {  # of the value of $option\n  case \"$path $option\" in\n";
  std::string global_kinds;
  visit(app, "", [&](const CLI::App& command, const std::string& path) {
    std::vector<std::string> arguments;
    for (const CLI::Option* positional : positionals_of(command))
      arguments.push_back(quoted(kind_of(*positional)));
    words += fmt::format("    {}) commands='{}' options='{}' arguments=({}) ;;\n", quoted(path),
                         command_words(command), path.empty() ? global : option_words(command) + " " + global,
                         fmt::join(arguments, " "));
    for (const CLI::Option* option : own_options(command)) {
      const std::string kind = kind_of(*option);
      if (kind.empty()) continue;
      for (const std::string& name : names_of(*option)) {
        (path.empty() ? global_kinds : kinds) +=
            fmt::format("    {}) kind={} ;;\n",
                        path.empty() ? "*" + quoted(" " + name) : quoted(path + " " + name), quoted(kind));
      }
    }
  });
  return words + "  esac\n}\n\n" + kinds + global_kinds + "    *) kind= ;;\n  esac\n}\n" + kBashFunctions;
}

std::string zsh_completion(const CLI::App& app) {
  std::string text =
      "#compdef glasswing\n\n__glasswing_known_sessions() {  # a command could have no such name\n"
      "  local -a names=(${(f)\"$(glasswing __sessions 2>/dev/null)\"})\n  compadd -a names\n}\n\n";
  const std::string global = zsh_specs(app);
  visit(app, "", [&](const CLI::App& command, const std::string& path) {
    text += zsh_command(command, path, global);
  });
  // Found in $fpath it is called; sourced it is named.
  return text +
         "if [[ $funcstack[1] == _glasswing ]]; then _glasswing \"$@\"; else compdef _glasswing glasswing; "
         "fi\n";
}

std::string fish_completion(const CLI::App& app) {
  std::vector<std::string> with_value;
  for (const CLI::Option* option : options_of(app)) {
    if (kind_of(*option).empty()) continue;
    for (const std::string& name : names_of(*option)) with_value.push_back(name);
  }
  std::string text = fmt::format(
      R"fish(# fish completion for glasswing

function __glasswing_sessions
    glasswing __sessions 2>/dev/null
end

# The commands and arguments before the cursor, without options.
function __glasswing_path
    set -l words (commandline -opc)
    set -l skip 0
    for word in $words[2..-1]
        if test $skip = 1
            set skip 0
            continue
        end
        switch $word
            case {}
                set skip 1
            case '-*'
            case '*'
                echo $word
        end
    end
end

# Whether the command is this one, or one below it.
function __glasswing_at
    set -l path (__glasswing_path)
    set -l length (count $argv)
    test "$path[1..$length]" = "$argv"
end

# Whether it is this one and nothing more.
function __glasswing_exactly
    test "$(__glasswing_path)" = "$argv"
end

complete -c glasswing -f
)fish",
      fmt::join(with_value, " "));
  visit(app, "", [&](const CLI::App& command, const std::string& path) {
    const std::string begin = "complete -c glasswing";
    for (const CLI::App* sub : subcommands_of(command)) {
      const std::string here = std::string("__glasswing_exactly") + (path.empty() ? "" : " ") + path;
      text += fmt::format("{} -n '{}' -a {} -d {}\n", begin, here, sub->get_name(),
                          quoted(sub->get_description()));
    }
    const std::string here = path.empty() ? "" : " -n '__glasswing_at " + path + "'";
    for (const CLI::Option* option : own_options(command)) {
      const std::string kind = kind_of(*option);
      std::string names;
      for (const std::string& name : option->get_snames()) names += " -s " + name;
      for (const std::string& name : option->get_lnames()) names += " -l " + name;
      text += begin + here + names +
              (kind.empty()     ? ""
               : kind == "FILE" ? " -r -F"
                                : " -x" + fish_action(kind)) +
              " -d " + quoted(description_of(*option)) + "\n";
    }
    for (const CLI::Option* positional : positionals_of(command)) {
      if (const std::string action = fish_action(kind_of(*positional)); !action.empty())
        text += begin + here + action + "\n";
    }
  });
  return text;
}

void add_completion_commands(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand("completion", "Write what a shell needs to complete commands.");
  command.footer(
      "Examples:\n"
      "  source <(glasswing completion bash)\n"
      "  glasswing completion bash > ~/.local/share/bash-completion/completions/glasswing\n"
      "  glasswing completion zsh > ~/.zfunc/_glasswing\n"
      "  glasswing completion fish > ~/.config/fish/completions/glasswing.fish");
  auto shell = std::make_shared<std::string>();
  command.add_option("shell", *shell, "bash, zsh or fish")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
  command.callback([&app, &client, shell] {
    client.run = [&app, shell] {
      std::cout << (*shell == "bash"  ? bash_completion(app)
                    : *shell == "zsh" ? zsh_completion(app)
                                      : fish_completion(app));
      return absl::OkStatus();
    };
  });
  app.add_subcommand("__sessions", "Names of sessions, for completion.")
      ->callback([&client] { client.run = [&client] { return print_sessions(client); }; })
      ->group("");
}

}  // namespace glasswing
