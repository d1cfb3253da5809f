#include <fmt/format.h>

#include <iostream>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/rpc.h"
#include "core/base/status.h"
#include "core/pattern/plan.h"
#include "glasswing/v1/rig_service.grpc.pb.h"

namespace glasswing {
namespace {

constexpr std::chrono::minutes kDoctorTimeout(5);

const char* level_name(v1::FindingLevel level) {
  switch (level) {
    case v1::FINDING_LEVEL_OK:
      return "ok";
    case v1::FINDING_LEVEL_WARNING:
      return "warning";
    case v1::FINDING_LEVEL_PROBLEM:
      return "problem";
    default:
      return "unknown";
  }
}

absl::Status check_rig(const Client& client, const std::string& plan) {
  v1::CheckRigRequest request;
  if (!plan.empty()) {
    GW_ASSIGN_OR_RETURN(*request.mutable_plan(), read_plan(plan));
  }
  const Peer<v1::RigService> server(client.server_title(), client.server);
  grpc::ClientContext context;
  set_deadline(context, kDoctorTimeout);
  const auto reader = server.stub->CheckRig(&context, request);
  int problems = 0;
  nlohmann::ordered_json findings = nlohmann::ordered_json::array();
  for (v1::CheckRigResponse response; reader->Read(&response);) {
    const v1::Finding& finding = response.finding();
    if (finding.level() == v1::FINDING_LEVEL_PROBLEM) ++problems;
    if (client.json) {
      findings.push_back({{"level", level_name(finding.level())},
                          {"subject", finding.subject()},
                          {"text", finding.text()},
                          {"advice", finding.advice()}});
      continue;
    }
    std::cout << fmt::format("{:8} {:9} {}\n", level_name(finding.level()), finding.subject(),
                             finding.text());
    if (!finding.advice().empty()) std::cout << fmt::format("{:18} -> {}\n", "", finding.advice());
    std::cout.flush();
  }
  const grpc::Status status = reader->Finish();
  if (client.json && status.ok()) std::cout << findings.dump(1) << "\n";
  if (!status.ok()) return status_from(status, server.title);
  if (problems > 0) {
    return absl::FailedPreconditionError(
        fmt::format("the rig has {} problem{}; mend what is said above", problems, problems == 1 ? "" : "s"));
  }
  return absl::OkStatus();
}

}  // namespace

void add_doctor_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand(
      "doctor", "Try the rig out before a session, and say what is wrong; success only without a problem.");
  command.footer("Example:\n  glasswing doctor --plan deploy/plans/crystal.txtpb");
  auto plan = std::make_shared<std::string>();
  command.add_option("--plan", *plan, "check for this plan's monitors, exposures and hold_refreshes");
  command.callback([&client, plan] { client.run = [&client, plan] { return check_rig(client, *plan); }; });
}

}  // namespace glasswing
