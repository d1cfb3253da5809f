#include "client/cli/completion_values.h"

#include <algorithm>
#include <chrono>

#include "client/cli/client.h"
#include "client/cli/rpc.h"
#include "core/base/status.h"
#include "core/method/methods.h"
#include "core/security/tls.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

absl::StatusOr<Candidates> session_names(std::vector<std::string> words) {
  constexpr std::chrono::milliseconds kPatience(1500);  // of a person who pressed Tab
  CLI::App command_line;
  command_line.set_help_flag();
  command_line.allow_extras();  // everything but the settings
  Config config(command_line, call_settings());
  std::ranges::reverse(words);  // as CLI::App wants them
  try {
    command_line.parse(std::move(words));
  } catch (const CLI::ParseError& error) {
    return absl::InvalidArgumentError(error.what());
  }
  GW_RETURN_IF_ERROR(config.resolve());
  GW_RETURN_IF_ERROR(use_tls({config["ca"], config["certificate"], config["key"]}));
  const Peer<v1::SessionService> server("server at " + config["server"], config["server"]);
  GW_ASSIGN_OR_RETURN(const v1::ListSessionsResponse listed,
                      call_pages(server, &v1::SessionService::Stub::ListSessions, {}, kPatience));
  Candidates names;
  for (const v1::Session& session : listed.sessions()) {
    names.emplace_back(session.name(), "");
    for (const v1::Session& view : session.views()) names.emplace_back(view.name(), "");
  }
  return names;
}

// "modes=", "smoothing=adaptive": the options of the method named on the command line, or else of all
// methods.
Candidates settings(std::span<const std::string> words) {
  std::string_view named = std::ranges::count(words, "live") > 0 ? kRampMethod : "";
  for (size_t i = 0; i < words.size(); ++i) {
    if (words[i] == "--method" && i + 1 < words.size()) named = words[i + 1];
    if (words[i].starts_with("--method=")) named = std::string_view(words[i]).substr(9);
  }
  Candidates settings;
  for (const SolvingMethod& method : solving_methods()) {
    if (!options_of(named).empty() && method.name != named) continue;
    for (const MethodOption& option : method.options) {
      const std::string start = std::string(option.name) + "=";
      const bool known = std::ranges::any_of(settings, [&](const auto& s) { return s.first == start; });
      if (option.choices.empty() && !known) settings.emplace_back(start, description_of(option));
      for (const std::string_view choice : option.choices)
        settings.emplace_back(start + std::string(choice), option.help);
    }
  }
  return settings;
}

}  // namespace

Candidates client_values(const std::string& kind, std::span<const std::string> words) {
  if (kind == "NAME=VALUE") return settings(words);
  if (kind != "SESSION") return {};
  return session_names({words.begin(), words.end()}).value_or(Candidates());
}

}  // namespace glasswing
