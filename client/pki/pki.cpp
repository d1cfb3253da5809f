#include <absl/time/time.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iostream>
#include <nlohmann/json.hpp>

#include "client/pki/certificate_authority.h"
#include "client/pki/commands.h"
#include "core/base/status.h"
#include "core/cli/output.h"

namespace glasswing {
namespace {

struct PkiArguments {
  std::string directory;
  std::string name = "Glasswing lab";
  std::vector<std::string> requests, names;
  int days = 365, within_days = 30;
};

std::string text_of(std::chrono::sys_seconds time, const char* format) {
  return absl::FormatTime(format, absl::FromUnixSeconds(time.time_since_epoch().count()),
                          absl::UTCTimeZone());
}

int days_left(std::chrono::sys_seconds end) {
  return static_cast<int>(
      std::chrono::floor<std::chrono::days>(end - std::chrono::system_clock::now()).count());
}

// Includes the authority if it is given.
void print_certificates(const Client& client, const std::vector<IssuedCertificate>& certificates,
                        const CertificateAuthority* authority = nullptr) {
  const auto list = [](const std::vector<std::string>& words, const char* between) {
    return words.empty() ? "-" : fmt::format("{}", fmt::join(words, between));
  };
  if (client.json) {
    nlohmann::ordered_json answer = nlohmann::ordered_json::object();
    constexpr const char* kRfc3339 = "%Y-%m-%dT%H:%M:%SZ";
    if (authority != nullptr)
      answer["authority"] = {{"name", authority->name()},
                             {"expires", text_of(authority->valid_until(), kRfc3339)}};
    answer["certificates"] = nlohmann::ordered_json::array();
    for (const IssuedCertificate& each : certificates) {
      answer["certificates"].push_back({{"name", each.of.name},
                                        {"roles", each.of.roles},
                                        {"hosts", each.of.hosts},
                                        {"expires", text_of(each.valid_until, kRfc3339)}});
    }
    std::cout << answer.dump(1) << "\n";
    return;
  }
  std::vector<std::vector<std::string>> rows;
  const auto add = [&](const std::string& name, const std::string& roles, const std::string& hosts,
                       std::chrono::sys_seconds end) {
    rows.push_back({name, roles, hosts, text_of(end, "%Y-%m-%d"), std::to_string(days_left(end))});
  };
  if (authority != nullptr) add("ca", "authority", "-", authority->valid_until());
  for (const IssuedCertificate& each : certificates)
    add(each.of.name, list(each.of.roles, "+"), list(each.of.hosts, ","), each.valid_until);
  print_table(client, {{"NAME"}, {"ROLES"}, {"HOSTS"}, {"EXPIRES"}, {"DAYS LEFT", true}}, rows);
}

absl::Status init(const Client& client, const PkiArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const CertificateAuthority authority,
                      CertificateAuthority::init(arguments.directory, arguments.name));
  print_certificates(client, {}, &authority);
  return absl::OkStatus();
}

absl::Status issue(const Client& client, const PkiArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const CertificateAuthority authority, CertificateAuthority::open(arguments.directory));
  std::vector<CertificateRequest> requests;
  for (const std::string& text : arguments.requests) {
    GW_ASSIGN_OR_RETURN(const CertificateRequest request, parse_certificate_request(text));
    GW_RETURN_IF_ERROR(authority.check_free(request.name));
    requests.push_back(request);
  }
  std::vector<IssuedCertificate> issued;
  for (const CertificateRequest& request : requests) {
    GW_ASSIGN_OR_RETURN(issued.emplace_back(), authority.issue(request, arguments.days));
  }
  print_certificates(client, issued);
  return absl::OkStatus();
}

absl::Status renew(const Client& client, const PkiArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const CertificateAuthority authority, CertificateAuthority::open(arguments.directory));
  std::vector<std::string> names = arguments.names;
  if (names.empty()) {
    GW_ASSIGN_OR_RETURN(const std::vector<IssuedCertificate> all, authority.issued());
    for (const IssuedCertificate& each : all) {
      if (days_left(each.valid_until) < arguments.within_days) names.push_back(each.of.name);
    }
    if (names.empty() && !client.json && !client.tsv) {
      std::cout << fmt::format("No certificate expires within {} days.\n", arguments.within_days);
      return absl::OkStatus();
    }
  }
  std::vector<IssuedCertificate> renewed;
  for (const std::string& name : names) {
    GW_ASSIGN_OR_RETURN(renewed.emplace_back(), authority.renew(name, arguments.days));
  }
  print_certificates(client, renewed);
  return absl::OkStatus();
}

absl::Status list(const Client& client, const PkiArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const CertificateAuthority authority, CertificateAuthority::open(arguments.directory));
  GW_ASSIGN_OR_RETURN(const std::vector<IssuedCertificate> all, authority.issued());
  print_certificates(client, all, &authority);
  return absl::OkStatus();
}

void add_days(CLI::App& command, PkiArguments& arguments) {
  command.add_option("--days", arguments.days, "validity of the certificates, days")
      ->check(CLI::Range(1, CertificateAuthority::kMaxDays))
      ->capture_default_str();
}

void add_issue_options(CLI::App& command, PkiArguments& arguments) {
  command
      .add_option("requests", arguments.requests,
                  "ROLE[+ROLE...]:NAME[=HOST,HOST...]; makes NAME.pem and NAME.key")
      ->required()
      ->type_name("REQUEST");
  add_days(command, arguments);
  command.footer(
      "ROLE determines what its owner may do: operator (runs sessions) or viewer (views them) for people; "
      "server, display, camera\nor solver for programs, several for a machine that runs several; console for "
      "the console's own certificate. HOST is a name or address under which others call the\nmachine; "
      "default: NAME. Existing files are not replaced.\n\n"
      "Examples:\n"
      "  glasswing pki issue certificates server+display+camera:rig=rig.lab,10.0.0.5\n"
      "  glasswing pki issue certificates console:console=rig.lab,localhost,127.0.0.1\n"
      "  glasswing pki issue certificates solver:solver-1=solver-1.lab operator:me viewer:guest --days 90");
}

void add_renew_options(CLI::App& command, PkiArguments& arguments) {
  command.add_option("names", arguments.names, "names of the certificates; default: all that expire soon");
  command.add_option("--within", arguments.within_days, "days until expiry that count as soon")
      ->check(CLI::Range(0, CertificateAuthority::kMaxDays))
      ->capture_default_str();
  add_days(command, arguments);
  command.footer(
      "Programs load the new files once they replace the old ones.\n\n"
      "Examples:\n  glasswing pki renew certificates\n"
      "  glasswing pki renew certificates rig solver-1\n"
      "  glasswing pki renew certificates --within 90");
}

}  // namespace

void add_pki_commands(CLI::App& app, Client& client) {
  CLI::App& pki = *app.add_subcommand(
      "pki", "Make a lab's certificates: an authority and the certificates that it issues.");
  pki.require_subcommand(1);
  pki.footer(
      "Everything is in one directory, on a machine outside the rig. Copy to each machine ca.pem and its own "
      "NAME.pem and NAME.key.\nNever copy ca.key: whoever has it can issue certificates.\n"
      "A certificate's name owns the names of the displays and cameras that it registers; glasswing nodes "
      "release frees one.\n\n"
      "Examples:\n"
      "  glasswing pki init certificates\n"
      "  glasswing pki issue certificates server+display+camera:rig=rig.lab,10.0.0.5 operator:me\n"
      "  glasswing pki list certificates\n"
      "  glasswing pki renew certificates");
  auto arguments = std::make_shared<PkiArguments>();
  using Run = absl::Status (*)(const Client&, const PkiArguments&);
  const auto add = [&](const char* name, const char* description, Run run) -> CLI::App& {
    CLI::App& command = *pki.add_subcommand(name, description);
    command
        .add_option("directory", arguments->directory,
                    "the authority's directory, with ca.pem and all issued files")
        ->required()
        ->type_name("DIR");
    command.callback([&client, arguments, run] {
      client.run = [&client, arguments, run] { return run(client, *arguments); };
    });
    return command;
  };

  CLI::App& init_command = add("init", "Make an authority: ca.pem, valid for ten years, and ca.key.", init);
  init_command.add_option("--name", arguments->name, "name in the authority's certificate")
      ->capture_default_str();
  init_command.footer("Example:\n  glasswing pki init certificates --name \"Lab 3\"");

  add_issue_options(add("issue", "Make a certificate and a key for each name.", issue), *arguments);
  add_renew_options(add("renew", "Renew certificates for the same roles and hosts, with new keys.", renew),
                    *arguments);
  add("list", "List the issued certificates and when they expire.", list)
      .footer("Example:\n  glasswing pki list certificates");
}

}  // namespace glasswing
