// The client's configuration file.
#include <absl/status/statusor.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "core/cli/config.h"
#include "tests/fuzz/fuzz_target.h"

namespace glasswing::fuzz {
namespace {

absl::StatusOr<std::string> server_in(const std::filesystem::path& path) {
  CLI::App app;
  Config config(app, {{.key = "server"}, {.key = "ca", .type = "FILE"}});
  app.parse("--config " + path.string());
  const absl::Status status = config.resolve();
  if (!status.ok()) return status;
  FUZZ_CHECK(config.file() == path && config.file_is_there());
  FUZZ_CHECK(config["color"] == "auto" || config["color"] == "always" || config["color"] == "never");
  for (const Setting& setting : config.settings())
    FUZZ_CHECK(setting.from == "default" || setting.from == path.string());
  return config["server"];
}

std::string quoted(const std::string& value) {
  std::string text = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') text += '\\';
    text += c;
  }
  return text + "\"";
}

}  // namespace

std::vector<std::string> seeds() {
  return {
      "server = \"rig.example.org:7440\"\nca = \"rig-ca.pem\"            # relative\ncertificate = 'me.pem'\n"
      "key = \"/etc/me.key\"\n\n# a remark\ncolor = \"never\"\n",
      "  server=\"a \\\"b\\\" \\\\ c\"#\r\n",
      "color = \"green\"\n",
      "server = \"a\"\nserver = \"b\"\n",
      "server = \"" + std::string(60000, 'x') + "\"\n",
      std::string(60000, ' ') + "#\n"};
}

void try_input(std::string_view input) {
  for (const char* variable : {"GLASSWING_SERVER", "GLASSWING_CA", "GLASSWING_CERTIFICATE", "GLASSWING_KEY"})
    ::unsetenv(variable);
  const std::filesystem::path path = scratch_directory() / "config.toml";
  write_plainly(path, input);
  const absl::StatusOr<std::string> server = server_in(path);
  if (!server.ok()) {
    FUZZ_CHECK(server.status().message().find(path.string()) == 0);
    return;
  }
  write_plainly(path, fmt::format("server = {}\n", quoted(*server)));
  FUZZ_CHECK(server_in(path).value() == *server);
}

}  // namespace glasswing::fuzz
