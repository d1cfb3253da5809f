#include "core/cli/completion.h"

#include <absl/strings/str_replace.h>

#include <algorithm>
#include <iostream>
#include <span>

#include "core/cli/help.h"

namespace glasswing {
namespace {

constexpr std::string_view kBash = R"bash(# bash completion for glasswing

_glasswing() {
  # The shell cuts its own words at = and :, which occur in our values.
  local -a words
  read -ra words <<< "${COMP_LINE:0:COMP_POINT}"
  [[ ${COMP_LINE:COMP_POINT-1:1} == ' ' ]] && words+=('')
  local word=${words[-1]}
  [[ $word == --*=* ]] && word=${word#*=}
  mapfile -t COMPREPLY < <("${COMP_WORDS[0]}" __complete -- "${words[@]:1}" 2>/dev/null)
  case ${COMPREPLY[0]} in
    :FILE) compopt -o filenames 2>/dev/null; mapfile -t COMPREPLY < <(compgen -f -- "$word") ;;
    :DIR) compopt -o filenames 2>/dev/null; mapfile -t COMPREPLY < <(compgen -d -- "$word") ;;
    *) COMPREPLY=("${COMPREPLY[@]%%$'\t'*}"); [[ ${COMPREPLY[0]} != *= ]] || compopt -o nospace 2>/dev/null ;;
  esac
}

complete -F _glasswing glasswing
)bash";

constexpr std::string_view kZsh = R"zsh(#compdef glasswing

_glasswing() {
  local -a found=(${(f)"$("$words[1]" __complete -- "${(@Q)words[2,CURRENT-1]}" "$PREFIX" 2>/dev/null)"})
  [[ $PREFIX == --*=* ]] && compset -P '*='
  case $found[1] in
    :FILE) _files ;;
    :DIR) _files -/ ;;
    *) found=("${(@)found/$'\t'/:}"); _describe glasswing found ;;
  esac
}

# Found in $fpath it is called; sourced it is registered.
if [[ $funcstack[1] == _glasswing ]]; then _glasswing "$@"; else compdef _glasswing glasswing; fi
)zsh";

constexpr std::string_view kFish = R"fish(# fish completion for glasswing

function __glasswing_complete
    set -l words (commandline -opc)
    set -l word (commandline -ct)
    set -l found ($words[1] __complete -- $words[2..-1] "$word" 2>/dev/null)
    set -l option (string match -r -- '^--[^=]*=' $word)
    switch "$found[1]"
        case ':FILE'
            set found (__fish_complete_path (string replace -- "$option" '' "$word"))
        case ':DIR'
            set found (__fish_complete_directories (string replace -- "$option" '' "$word"))
    end
    test -n "$found"; and printf '%s\n' "$option"$found
end

complete -c glasswing -f -a '(__glasswing_complete)'
)fish";

// The position determined by the words before the cursor.
struct Cursor {
  const CLI::App* command;
  const CLI::Option* option = nullptr;  // whose value comes next; null: none
  size_t argument_count = 0;            // the command's positional arguments so far
};

// An option of the command or of those above it; null: there is none with this name.
const CLI::Option* find_option(const CLI::App& command, const std::string& name) {
  for (const CLI::App* app = &command; app != nullptr; app = app->get_parent()) {
    if (const CLI::Option* option = app->get_option_no_throw(name)) return option;
  }
  return nullptr;
}

const CLI::App* find_subcommand(const CLI::App& command, const std::string& name) {
  const std::vector<const CLI::App*> subcommands = subcommands_of(command);
  const auto found =
      std::ranges::find(subcommands, name, [](const CLI::App* sub) { return sub->get_name(); });
  return found == subcommands.end() ? nullptr : *found;
}

Cursor cursor_after(const CLI::App& program, std::span<const std::string> words) {
  Cursor cursor{.command = &program};
  for (const std::string& word : words) {
    if (cursor.option != nullptr) {
      cursor.option = nullptr;
    } else if (word.starts_with('-')) {
      const CLI::Option* option = find_option(*cursor.command, word);  // null for --option=value too
      if (option != nullptr && !value_of(*option).empty()) cursor.option = option;
    } else if (const CLI::App* subcommand = find_subcommand(*cursor.command, word)) {
      cursor = {.command = subcommand};
    } else {
      ++cursor.argument_count;
    }
  }
  return cursor;
}

// The command's options first, then those of the commands above it.
Candidates option_names(const CLI::App& command) {
  Candidates names;
  for (const CLI::App* app = &command; app != nullptr; app = app->get_parent()) {
    for (const CLI::Option* option : options_of(*app)) {
      if (app->get_parent() != nullptr && option == app->get_help_ptr())
        continue;  // the program's comes last
      for (const std::string& name : option->get_snames())
        names.emplace_back("-" + name, description_of(*option));
      for (const std::string& name : option->get_lnames())
        names.emplace_back("--" + name, description_of(*option));
    }
  }
  return names;
}

Candidates values_of(const CLI::Option& option, std::span<const std::string> words_before,
                     const ValuesOfKind& values_of_kind) {
  Candidates values;
  for (const std::string& choice : choices_of(option)) values.emplace_back(choice, "");
  if (!values.empty()) return values;
  const std::string kind = value_of(option);
  if (kind == "FILE") return {{std::string(kFileMarker), ""}};
  if (kind == "DIR") return {{std::string(kDirectoryMarker), ""}};
  return values_of_kind ? values_of_kind(kind, words_before) : Candidates();
}

// The positional argument that comes next; the last one may take several words. Null: none.
const CLI::Option* next_argument(const Cursor& cursor) {
  const std::vector<const CLI::Option*> arguments = positionals_of(*cursor.command);
  if (cursor.argument_count < arguments.size()) return arguments[cursor.argument_count];
  return arguments.empty() || arguments.back()->get_expected_max() <= 1 ? nullptr : arguments.back();
}

void print(const Candidates& candidates) {
  for (const auto& [word, description] : candidates)
    std::cout << word << (description.empty() ? "" : "\t") << description << "\n";
}

}  // namespace

std::string completion_script(std::string_view shell, std::string_view program) {
  const std::string_view script = shell == "bash" ? kBash : shell == "zsh" ? kZsh : kFish;
  return absl::StrReplaceAll(std::string(script), {{"glasswing", std::string(program)}});
}

Candidates candidates_for(const CLI::App& program, const std::vector<std::string>& words,
                          const ValuesOfKind& values_of_kind) {
  const std::span<const std::string> before(words.data(), words.size() - 1);
  const Cursor cursor = cursor_after(program, before);
  std::string typed = words.back();
  const CLI::Option* option = cursor.option;
  if (const size_t equals = typed.find('=');
      option == nullptr && typed.starts_with("--") && equals != std::string::npos) {
    option = find_option(*cursor.command, typed.substr(0, equals));
    if (option == nullptr) return {};
    typed.erase(0, equals + 1);
  }
  Candidates candidates;
  if (option != nullptr) {
    candidates = values_of(*option, before, values_of_kind);
  } else if (typed.starts_with('-')) {
    candidates = option_names(*cursor.command);
  } else if (const auto subcommands = subcommands_of(*cursor.command); !subcommands.empty()) {
    for (const CLI::App* sub : subcommands) candidates.emplace_back(sub->get_name(), sub->get_description());
  } else if (const CLI::Option* argument = next_argument(cursor)) {
    candidates = values_of(*argument, before, values_of_kind);
  }
  std::erase_if(candidates, [&](const auto& candidate) {
    return !candidate.first.starts_with(':') && !candidate.first.starts_with(typed);
  });
  return candidates;
}

void add_completion_commands(CLI::App& app, CommandLine& command_line, ValuesOfKind values_of_kind) {
  CLI::App& command = *app.add_subcommand("completion", "Write a script for command completion in a shell.");
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
  command.callback([&app, &command_line, shell] {
    command_line.run = [&app, shell] {
      std::cout << completion_script(*shell, app.get_name());
      return absl::OkStatus();
    };
  });

  CLI::App& complete =
      *app.add_subcommand("__complete", "Print what may follow; the shells' scripts call it.");
  complete.group("");
  auto words = std::make_shared<std::vector<std::string>>();
  complete.add_option("words", *words, "the command line so far, after --")->required();
  complete.callback([&app, &command_line, words, values_of_kind = std::move(values_of_kind)] {
    command_line.run = [&app, words, values_of_kind] {
      print(candidates_for(app, *words, values_of_kind));
      return absl::OkStatus();
    };
  });
}

}  // namespace glasswing
