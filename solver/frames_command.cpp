#include "solver/frames_command.h"

#include <fmt/format.h>

#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/import/mapped_archive.h"
#include "solver/methods.h"
#include "solver/worker/parallel_solve.h"

namespace glasswing {
namespace {

struct Frames {
  std::string archive, method = "gaussian";
  bool json = false;
};

absl::Status report(const Frames& arguments) {
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<Method> method, make_method(arguments.method, {}));
  GW_ASSIGN_OR_RETURN(const auto archive, MappedArchive::open(arguments.archive));
  GW_ASSIGN_OR_RETURN(const FrameFaults faults, faults_of_archive(*method, *archive));
  if (arguments.json) {
    nlohmann::ordered_json written{{"archive", arguments.archive},
                                   {"compared_pixels", faults.compared},
                                   {"corrected", faults.corrections != nullptr},
                                   {"bad_pixels", faults.bad_pixels.size()},
                                   {"warnings", faults.warnings}};
    std::cout << written.dump(2) << "\n";
    return absl::OkStatus();
  }
  for (const std::string& warning : faults.warnings) std::cout << fmt::format("{}\n", printable(warning));
  if (faults.compared == 0) {
    std::cout << "frames were not compared: too few pixels see the monitors beside the object\n";
  } else if (faults.warnings.empty()) {
    std::cout << fmt::format("no problems found: {} pixels beside the object agree\n", faults.compared);
  }
  return absl::OkStatus();
}

}  // namespace

void add_frames_command(CLI::App& app, DaemonOptions& daemon) {
  const auto arguments = std::make_shared<Frames>();
  CLI::App& command = add_command(app, daemon, "frames",
                                  "Report disturbances of the rig in an archive's "
                                  "frames",
                                  [arguments]() -> absl::StatusOr<int> {
                                    GW_RETURN_IF_ERROR(report(*arguments));
                                    return 0;
                                  });
  command.footer(
      "Nothing is solved: it takes seconds (docs/frames.md).\n\nExample:\n"
      "  glasswing-solver frames out/archives/crystal");
  command.add_option("archive", arguments->archive, "folder with manifest.json")->required();
  command.add_option("--method", arguments->method, "that would solve it")->capture_default_str();
  command.add_flag("--json", arguments->json, "print a JSON object");
}

}  // namespace glasswing
