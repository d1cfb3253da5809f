#include <CLI/CLI.hpp>
#include <iostream>
#include <thread>

#include "core/base/name.h"
#include "core/service/registration.h"
#include "core/service/service.h"
#include "solver/work_loop.h"

int main(int argc, char** argv) {
  using namespace glasswing;
  CLI::App app("Glasswing's solver: turns frames into tiles of a matte, for as long as the server has any.");
  app.footer("Example:\n  glasswing-solver --server 127.0.0.1:7440 --name solver-1");
  std::string server = "127.0.0.1:7440", name = "solver-1", level = "info";
  app.add_option("--server", server, "host:port of glasswing-server")->capture_default_str();
  app.add_option("--name", name, "this node's name in the rig")->capture_default_str();
  app.add_option("--log-level", level, "debug, info, warn or error")->capture_default_str();
  app.set_version_flag("--version", kVersion);
  CLI11_PARSE(app, argc, argv);
  block_signals();
  start_logging("glasswing-solver", level);
  if (absl::Status status = check_name("node", name); !status.ok()) {
    std::cerr << "glasswing-solver: " << status.message() << "\n";
    return 1;
  }
  v1::RegisterRequest node;
  node.set_kind(v1::NODE_KIND_SOLVER);
  node.set_name(name);
  const Registration registration(server, node);
  const std::jthread worker([&](std::stop_token stop) { run_work_loop(server, name, stop); });
  wait_for_signal();
  return 0;
}
