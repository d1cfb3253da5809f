#include "core/archive/fsck_command.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/base/status.h"
#include "core/cli/amount.h"

namespace glasswing {
namespace {

constexpr double kProgressStep = 1e-3;  // between two lines

int count_if(const CheckReport& report, bool damage, bool repaired) {
  return static_cast<int>(std::ranges::count_if(report.findings, [&](const Finding& finding) {
    return finding.is_damage == damage && finding.repaired == repaired;
  }));
}

nlohmann::ordered_json json_of(const CheckReport& report, const FsckArguments& arguments) {
  nlohmann::ordered_json findings = nlohmann::ordered_json::array();
  for (const Finding& finding : report.findings) {
    findings.push_back({{"file", finding.file},
                        {"what", finding.what},
                        {"meaning", finding.meaning},
                        {"repair", finding.repair},
                        {"damage", finding.is_damage},
                        {"repaired", finding.repaired},
                        {"error", finding.error}});
  }
  return {{"path", arguments.path},         {"kind", report.kind},
          {"files", report.file_count},     {"bytes", report.byte_count},
          {"in_use", report.in_use},        {"damage_left", count_if(report, true, false)},
          {"findings", std::move(findings)}};
}

void print(const CheckReport& report, const FsckArguments& arguments) {
  for (const Finding& finding : report.findings) {
    std::cout << fmt::format("{}: {}\n  {}\n", finding.file, finding.what, finding.meaning);
    const char* when = finding.repaired ? "repaired" : "--repair";
    if (finding.repair.empty() && report.kind != "rig") std::cout << "  it cannot be repaired here\n";
    if (!finding.repair.empty()) std::cout << fmt::format("  {}: {}\n", when, finding.repair);
    if (!finding.error.empty()) std::cout << fmt::format("  not repaired: {}\n", finding.error);
  }
  if (report.in_use)
    std::cout << "a daemon is using it: some of these may be writes in progress; stop it to be sure\n";
  std::string verdict = "everything is intact";
  if (report.kind == "rig") {
    if (!report.findings.empty())
      verdict = fmt::format("{} missing or damaged, {} without a session", count_if(report, true, false),
                            count_if(report, false, false));
    std::cout << fmt::format("{}: {}, {} archives and mattes: {}\n", arguments.path, report.kind,
                             report.file_count, verdict);
    return;
  }
  if (!report.findings.empty()) {
    verdict = fmt::format(
        "{} damaged, {} of them repaired; {} left over from interrupted writes, {} of them removed",
        count_if(report, true, false) + count_if(report, true, true), count_if(report, true, true),
        count_if(report, false, false) + count_if(report, false, true), count_if(report, false, true));
  }
  std::cout << fmt::format("{}: {}, {} files, {}: {}\n", arguments.path, report.kind, report.file_count,
                           bytes_text(static_cast<double>(report.byte_count)), verdict);
}

absl::StatusOr<int> check(const FsckArguments& arguments, const FsckOptions& options) {
  GW_RETURN_IF_ERROR(become_owner(arguments.path));
  GW_ASSIGN_OR_RETURN(const CheckReport report, fsck(arguments.path, options));
  return print_report(report, arguments);
}

}  // namespace

void add_fsck_arguments(CLI::App& command, FsckArguments& arguments, const std::string& examples) {
  command.footer(
      "Reads everything and verifies its checksums. A repair moves damaged files to damaged/ beside it: "
      "nothing that may hold data is removed. Stop the daemon first. The exit status is 0 if no damage is "
      "left, 3 if there is some.\n\nExamples:\n" +
      examples);
  command
      .add_option("directory", arguments.path,
                  "data of a server or a camera node, archives of a solver, one archive, or a matte's file")
      ->required();
  command.add_flag("--repair", arguments.repair, "repair what can be repaired without losing anything");
}

absl::Status become_owner(const std::string& path) {
  struct stat info {};
  if (::geteuid() != 0 || ::stat(path.c_str(), &info) != 0 || info.st_uid == 0) return absl::OkStatus();
  if (::setegid(info.st_gid) == 0 && ::seteuid(info.st_uid) == 0) return absl::OkStatus();
  return absl::ErrnoToStatus(errno, fmt::format("cannot act as user {}, who owns {}", info.st_uid, path));
}

int print_report(const CheckReport& report, const FsckArguments& arguments) {
  if (arguments.json) {
    std::cout << json_of(report, arguments).dump(1) << "\n";
  } else {
    print(report, arguments);
  }
  return count_if(report, true, false) > 0 ? kDamage : 0;
}

void add_fsck_command(CLI::App& app, DaemonOptions& options, const std::string& example,
                      decltype(FsckOptions::check_server) check_server) {
  const auto arguments = std::make_shared<FsckArguments>();
  const auto work = [arguments, check_server = std::move(check_server)]() -> absl::StatusOr<int> {
    FsckOptions how{.repair = arguments->repair, .tell = nullptr, .check_server = check_server};
    double written = 0.0;
    if (arguments->show_progress) {
      how.tell = [&written](double fraction) {
        if (fraction < written + kProgressStep) return;
        written = fraction;
        std::cerr << kProgressLine << fraction << "\n";
      };
    }
    return check(*arguments, how);
  };
  CLI::App& command = add_command(app, options, "fsck", kFsckDescription, work);
  add_fsck_arguments(command, *arguments, "  " + app.get_name() + " fsck " + example);
  command.add_flag("--json", arguments->json, "write the report as JSON");
  command.add_flag("--show-progress", arguments->show_progress)->group("");
}

}  // namespace glasswing
