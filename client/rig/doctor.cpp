#include <fmt/format.h>

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>

#include "client/cli/camera_argument.h"
#include "client/cli/rpc.h"
#include "client/rig/check_geometry.h"
#include "client/rig/commands.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/colour.h"
#include "core/cli/interrupt.h"
#include "core/cli/output.h"
#include "core/cli/progress.h"
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

void print_finding(const Client& client, const v1::Finding& finding) {
  const std::string level = level_name(finding.level());
  std::cout << painted(level, client.coloured ? paint_of(level) : Paint::kNone)
            << fmt::format("{:{}} {:9} {}\n", "", 8 - level.size(), printable(finding.subject()),
                           printable(finding.text()));
  if (!finding.advice().empty()) std::cout << fmt::format("{:18} -> {}\n", "", printable(finding.advice()));
  std::cout.flush();
}

// Prints all findings as JSON or tab-separated values.
void print_together(const Client& client, const std::vector<v1::Finding>& findings) {
  nlohmann::ordered_json array = nlohmann::ordered_json::array();
  std::vector<std::vector<std::string>> rows;
  for (const v1::Finding& finding : findings) {
    array.push_back({{"level", level_name(finding.level())},
                     {"subject", finding.subject()},
                     {"text", finding.text()},
                     {"advice", finding.advice()}});
    rows.push_back({level_name(finding.level()), finding.subject(), finding.text(), finding.advice()});
  }
  if (client.json) std::cout << array.dump(1) << "\n";
  if (client.tsv) print_table(client, {{"LEVEL"}, {"SUBJECT"}, {"TEXT"}, {"ADVICE"}}, rows);
}

std::vector<v1::Finding> read_findings(const Client& client,
                                       grpc::ClientReader<v1::CheckRigResponse>& reader) {
  Waiting waiting("checking the rig");
  std::vector<v1::Finding> findings;
  for (v1::CheckRigResponse response; reader.Read(&response);) {
    findings.push_back(response.finding());
    if (!client.json && !client.tsv) waiting.aside([&] { print_finding(client, findings.back()); });
  }
  return findings;
}

struct DoctorArguments {
  std::string plan, session;
  std::vector<std::string> cameras, geometries;
};

absl::Status check_rig(const Client& client, const DoctorArguments& arguments) {
  v1::CheckRigRequest request;
  if (!arguments.plan.empty()) {
    GW_ASSIGN_OR_RETURN(*request.mutable_plan(), read_plan(arguments.plan));
  }
  use_cameras(arguments.cameras, *request.mutable_plan());
  if (arguments.geometries.empty() && !arguments.session.empty())
    return absl::InvalidArgumentError("--session goes with --geometry");
  // Before the rig is busy, which takes longer.
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Finding> geometry,
                      check_rig_geometry(client, arguments.geometries, arguments.session));
  const Peer<v1::RigService> server(client.server_title(), client.server);
  grpc::ClientContext context;
  set_deadline(context, kDoctorTimeout);
  const auto reader = server.stub->CheckRig(&context, request);
  const Interruptible ctrl_c([&context] { context.TryCancel(); });
  std::vector<v1::Finding> findings = read_findings(client, *reader);
  const grpc::Status status = reader->Finish();
  if (interrupted())
    return absl::CancelledError("the check was interrupted; the rig is free again and unchanged");
  if (!status.ok()) return status_from(status, server.title);
  for (const v1::Finding& finding : geometry) {
    if (!client.json && !client.tsv) print_finding(client, finding);
    findings.push_back(finding);
  }
  print_together(client, findings);
  const auto problems = std::ranges::count(findings, v1::FINDING_LEVEL_PROBLEM, &v1::Finding::level);
  if (problems > 0) {
    return absl::FailedPreconditionError(fmt::format("the rig has {} problem{}; fix what is listed above",
                                                     problems, problems == 1 ? "" : "s"));
  }
  return absl::OkStatus();
}

}  // namespace

void add_doctor_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand(
      "doctor", "Test the rig before a session and report what is wrong; succeeds only without problems.");
  command.footer(
      "With --geometry it reports whether the monitors are still where they were calibrated, from the places "
      "seen by pixels beside the object of a solved session (docs/rays.md).\n\n"
      "Examples:\n"
      "  glasswing doctor --plan deploy/plans/crystal.txtpb\n"
      "  glasswing doctor --camera left --camera right\n"
      "  glasswing doctor --geometry rig.txtpb --session vase-200\n"
      "  glasswing doctor --camera left --camera right --geometry left=left.txtpb --geometry "
      "right=right.txtpb");
  auto arguments = std::make_shared<DoctorArguments>();
  command.add_option("--plan", arguments->plan,
                     "check for this plan's monitors, exposures and hold_refreshes");
  add_cameras_option(command, arguments->cameras);
  command
      .add_option(
          "--geometry", arguments->geometries,
          "check that nothing has moved since glasswing calibrate geometry wrote this file; of several "
          "cameras CAMERA=FILE, repeated")
      ->type_name("FILE")
      ->allow_extra_args(false);
  command
      .add_option(
          "--session", arguments->session,
          "with --geometry: the session, or matte file, that shows where the monitors are now; default: the "
          "newest solved one")
      ->type_name("SESSION");
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return check_rig(client, *arguments); }; });
}

}  // namespace glasswing
