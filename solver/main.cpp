#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <thread>

#include "core/base/file.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/frame/mapped_archive.h"
#include "core/matte/matte_file.h"
#include "core/service/registration.h"
#include "core/service/service.h"
#include "solver/bands.h"
#include "solver/work_loop.h"

namespace glasswing {
namespace {

struct Work {
  std::string server = "127.0.0.1:7440", name = "solver-1";
  int threads = 0;
};

absl::Status serve(const Work& work) {
  GW_RETURN_IF_ERROR(check_name("node", work.name));
  v1::RegisterRequest node;
  node.set_kind(v1::NODE_KIND_SOLVER);
  node.set_name(work.name);
  const Registration registration(work.server, node);
  const std::jthread worker(
      [&](std::stop_token stop) { run_work_loop(work.server, work.name, work.threads, stop); });
  wait_for_signal();
  return absl::OkStatus();
}

struct Solve {
  std::string archive, matte, method = "gaussian";
  std::vector<std::string> settings;
  int threads = 0;
};

absl::Status solve(const Solve& solve) {
  MethodOptions options;
  for (const std::string& setting : solve.settings) {
    const size_t equals = setting.find('=');
    if (equals == std::string::npos) {
      return absl::InvalidArgumentError(
          fmt::format("--set {}: it must be NAME=VALUE, such as modes=2", setting));
    }
    options[setting.substr(0, equals)] = setting.substr(equals + 1);
  }
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<Method> method, make_method(solve.method, options));
  GW_ASSIGN_OR_RETURN(const auto archive, MappedArchive::open(solve.archive));
  GW_ASSIGN_OR_RETURN(const FrameStack stack, whole_stack(archive));
  const bool watched = ::isatty(STDERR_FILENO) != 0;
  GW_ASSIGN_OR_RETURN(const Matte matte, solve_in_bands(*method, stack, solve.threads, {}, [&](double part) {
                        if (watched) std::cerr << fmt::format("\rsolved {:3.0f} %", 100.0 * part);
                      }));
  if (watched) std::cerr << "\n";
  GW_ASSIGN_OR_RETURN(const std::string bytes, encode_matte(matte));
  return write_file_durably(solve.matte, bytes);
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  using namespace glasswing;
  CLI::App app("Glasswing's solver: turns frames into tiles of a matte, for as long as the server has any.");
  app.footer(
      "Examples:\n  glasswing-solver --server 127.0.0.1:7440 --name solver-1\n"
      "  glasswing-solver solve out/archives/crystal crystal.exr --set modes=2");
  Work work;
  std::string level = "info";
  app.add_option("--server", work.server, "host:port of glasswing-server")->capture_default_str();
  app.add_option("--name", work.name, "this node's name in the rig")->capture_default_str();
  app.add_option("--threads", work.threads, "that solve; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_option("--log-level", level, "debug, info, warn or error")
      ->check(CLI::IsMember({"debug", "info", "warn", "error"}))
      ->capture_default_str();
  app.set_version_flag("--version", kVersion);
  Solve here;
  CLI::App* solve_command = app.add_subcommand("solve", "Solve an archive on this machine, without a server");
  solve_command->add_option("archive", here.archive, "folder with manifest.json")->required();
  solve_command->add_option("matte", here.matte, "EXR file to write")->required();
  solve_command->add_option("--method", here.method)->capture_default_str();
  solve_command->add_option("--set", here.settings, "NAME=VALUE, an option of the method");
  solve_command->add_option("--threads", here.threads, "0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  absl::Status status;
  if (solve_command->parsed()) {
    status = solve(here);
  } else {
    block_signals();
    start_logging("glasswing-solver", level);
    status = serve(work);
  }
  if (!status.ok()) std::cerr << "glasswing-solver: " << status.message() << "\n";
  return status.ok() ? 0 : 1;
}
