#include <fmt/format.h>

#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "client/cli/commands.h"
#include "core/cli/config.h"
#include "core/cli/output.h"
#include "core/security/tls.h"

namespace glasswing {
namespace {

absl::Status print_config(const Client& client, const Config& config) {
  if (client.json) {
    nlohmann::ordered_json answer = {
        {"file", config.file().string()}, {"file_is_there", config.file_is_there()}, {"settings", {}}};
    for (const Setting& setting : config.settings())
      answer["settings"][setting.key] = {{"value", setting.value}, {"from", setting.from}};
    std::cout << answer.dump(1) << "\n";
  } else {
    std::vector<std::vector<std::string>> rows;
    for (const Setting& setting : config.settings())
      rows.push_back({setting.key, setting.value.empty() ? "-" : setting.value, setting.from});
    print_table(client, {{"SETTING"}, {"VALUE"}, {"FROM"}}, rows);
    if (!config.file_is_there() && !client.tsv)
      std::cout << fmt::format("The file {} does not exist.\n", config.file().string());
  }
  return use_tls({config["ca"], config["certificate"], config["key"]});
}

}  // namespace

void add_config_command(CLI::App& app, Client& client, const Config& config) {
  CLI::App& command = *app.add_subcommand(
      "config", "Show the settings in force and their sources, and check the certificates.");
  command.footer(
      "A setting is taken from its option, its environment variable, the configuration file, or the default, "
      "in this order.\n"
      "The file has one line for each:\n\n"
      "  server = \"rig.example.org:7440\"\n"
      "  ca = \"rig-ca.pem\"            # relative to the file's directory\n"
      "  certificate = \"me.pem\"\n"
      "  key = \"me.key\"\n"
      "  color = \"auto\"\n\n"
      "Example:\n  glasswing config");
  command.callback(
      [&client, &config] { client.run = [&client, &config] { return print_config(client, config); }; });
}

}  // namespace glasswing
