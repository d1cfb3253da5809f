#include "core/storage/fsck.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>

#include "client/cli/output.h"
#include "client/cli/progress.h"
#include "client/sessions/commands.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr int kDamage = 3;  // exit status

struct Arguments {
  std::string path;
  bool repair = false;
};

// What root writes a daemon could not write to any more: root becomes whoever the data belong to.
absl::Status become_owner(const std::string& path) {
  struct stat info {};
  if (::geteuid() != 0 || ::stat(path.c_str(), &info) != 0 || info.st_uid == 0) return absl::OkStatus();
  if (::setegid(info.st_gid) == 0 && ::seteuid(info.st_uid) == 0) return absl::OkStatus();
  return absl::ErrnoToStatus(errno,
                             fmt::format("cannot act as user {}, whom {} belongs to", info.st_uid, path));
}

int count_if(const CheckReport& report, bool damage, bool repaired) {
  return static_cast<int>(std::ranges::count_if(report.findings, [&](const Finding& finding) {
    return finding.is_damage == damage && finding.repaired == repaired;
  }));
}

nlohmann::ordered_json json_of(const CheckReport& report, const Arguments& arguments) {
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

void print(const CheckReport& report, const Arguments& arguments) {
  for (const Finding& finding : report.findings) {
    std::cout << fmt::format("{}: {}\n  {}\n", finding.file, finding.what, finding.meaning);
    const char* when = finding.repaired ? "repaired" : "--repair";
    if (finding.repair.empty()) std::cout << "  it cannot be repaired here\n";
    if (!finding.repair.empty()) std::cout << fmt::format("  {}: {}\n", when, finding.repair);
    if (!finding.error.empty()) std::cout << fmt::format("  not repaired: {}\n", finding.error);
  }
  if (report.in_use)
    std::cout << "a daemon is using it: what it was just writing may be among this; stop it to be sure\n";
  std::string verdict = "all of it is good";
  if (!report.findings.empty()) {
    verdict = fmt::format(
        "{} damaged, {} of them repaired; {} left over from writes that broke off, {} of "
        "them cleared away",
        count_if(report, true, false) + count_if(report, true, true), count_if(report, true, true),
        count_if(report, false, false) + count_if(report, false, true), count_if(report, false, true));
  }
  std::cout << fmt::format("{}: {}, {} files, {}: {}\n", arguments.path, report.kind, report.file_count,
                           bytes_text(static_cast<double>(report.byte_count)), verdict);
}

absl::Status check(Client& client, const Arguments& arguments) {
  GW_RETURN_IF_ERROR(become_owner(arguments.path));
  absl::StatusOr<CheckReport> report;
  {
    Progress progress("checking");
    report = fsck(arguments.path,
                  {.repair = arguments.repair, .tell = [&](double fraction) { progress.update(fraction); }});
  }
  GW_RETURN_IF_ERROR(report.status());
  if (client.json) {
    std::cout << json_of(*report, arguments).dump(1) << "\n";
  } else {
    print(*report, arguments);
  }
  client.exit_status = count_if(*report, true, false) > 0 ? kDamage : 0;
  return absl::OkStatus();
}

}  // namespace

void add_fsck_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand("fsck", "Check what lies on a disk, and repair it.");
  command.footer(
      "Reads everything and holds it against its checksums. What a repair takes out of the way goes to "
      "damaged/ beside it: nothing that may hold data is removed. Stop the daemon first. The exit status is "
      "0 "
      "where no damage is left, 3 where there is some.\n\n"
      "Examples:\n  glasswing fsck /var/lib/glasswing\n  glasswing fsck /var/lib/glasswing-camera --repair\n"
      "  glasswing fsck vase.exr --json");
  auto arguments = std::make_shared<Arguments>();
  command
      .add_option("directory", arguments->path,
                  "data of a server or a camera node, archives of a solver, one archive, or a matte's file")
      ->required();
  command.add_flag("--repair", arguments->repair, "repair what can be repaired without losing anything");
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return check(client, *arguments); }; });
}

}  // namespace glasswing
