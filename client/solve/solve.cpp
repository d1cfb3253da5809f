#include <absl/time/clock.h>
#include <absl/time/time.h>
#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "client/capture/watch.h"
#include "client/cli/camera_argument.h"
#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "client/cli/settings.h"
#include "client/solve/commands.h"
#include "client/solve/put_parts.h"
#include "client/solve/slurm.h"
#include "core/base/status.h"
#include "core/cli/help.h"
#include "core/cli/output.h"
#include "core/cli/output_file.h"
#include "core/method/methods.h"
#include "core/pattern/plan.h"
#include "glasswing/v1/job_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

struct SolveArguments {
  std::string session, camera;
  std::string method;
  std::vector<std::string> options;
  bool watch = false;
  std::string priority;            // empty: normal
  std::string deadline;            // empty: none
  std::string on;                  // a cluster; empty: the server's solvers
  SlurmSolve slurm;                // what its options say
  std::vector<std::string> parts;  // solved elsewhere
};

absl::Status take_parts(const Client& client, const SolveArguments& arguments) {
  const UnfinishedFile matte("-");  // never finished
  GW_ASSIGN_OR_RETURN(const v1::Session session,
                      put_parts(client, arguments.session, {arguments.parts.begin(), arguments.parts.end()},
                                matte.path(), 0.0));
  print_session(session, client.json);
  return absl::OkStatus();
}

const std::map<std::string, v1::JobPriority> kPriorities{{"batch", v1::JOB_PRIORITY_BATCH},
                                                         {"normal", v1::JOB_PRIORITY_NORMAL},
                                                         {"interactive", v1::JOB_PRIORITY_INTERACTIVE}};

absl::Status set_priority(const Client& client, const std::string& session, const std::string& priority) {
  v1::SetJobPriorityRequest request;
  request.set_session(session);
  request.set_priority(kPriorities.at(priority));
  const Peer<v1::JobService> server(client.server_title(), client.server);
  return call(server, &v1::JobService::Stub::SetJobPriority, request).status();
}

absl::Status set_job_deadline(const Client& client, const std::string& session, const std::string& deadline) {
  v1::SetJobDeadlineRequest request;
  request.set_session(session);
  request.set_deadline(deadline);
  const Peer<v1::JobService> server(client.server_title(), client.server);
  return call(server, &v1::JobService::Stub::SetJobDeadline, request).status();
}

absl::Status solve(const Client& client, SolveArguments arguments) {
  absl::Time deadline;
  if (!arguments.deadline.empty() &&
      (!absl::ParseTime(absl::RFC3339_full, arguments.deadline, &deadline, nullptr) ||
       deadline <= absl::Now())) {
    return absl::InvalidArgumentError(fmt::format(
        "--deadline is \"{}\"; it must be a time in the future, such as 2026-11-01T20:00:00+01:00",
        arguments.deadline));
  }
  GW_ASSIGN_OR_RETURN(arguments.session, session_name_of(client, arguments.session, arguments.camera));
  if (!arguments.parts.empty()) return take_parts(client, arguments);
  GW_ASSIGN_OR_RETURN(const auto options, parse_settings(arguments.options));
  if (!arguments.on.empty()) {
    SlurmSolve on_slurm = arguments.slurm;
    on_slurm.session = arguments.session;
    on_slurm.method = arguments.method;
    on_slurm.options = options;
    return solve_on_slurm(client, on_slurm);
  }
  v1::SolveSessionRequest request;
  request.set_name(arguments.session);
  request.set_method(arguments.method);
  request.mutable_options()->insert(options.begin(), options.end());
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  GW_ASSIGN_OR_RETURN(const v1::SolveSessionResponse started,
                      call(server, &v1::SessionService::Stub::SolveSession, request, kLongCallTimeout));
  if (!arguments.priority.empty())
    GW_RETURN_IF_ERROR(set_priority(client, arguments.session, arguments.priority));
  if (!arguments.deadline.empty())
    GW_RETURN_IF_ERROR(set_job_deadline(client, arguments.session, arguments.deadline));
  if (arguments.watch) return follow_to_outcome(client, arguments.session, Goal::kDone);
  print_session(started.session(), client.json);
  return absl::OkStatus();
}

// The options of the method that the command line names, including `solve --help gaussian`; otherwise all
// names.
std::string options_text(const SolveArguments& arguments) {
  const std::string& method = arguments.method.empty() ? arguments.session : arguments.method;
  std::string text;
  if (options_of(method).empty()) {
    text = "The methods' options, for --set; glasswing solve --help METHOD explains them:\n\n";
    for (const SolvingMethod& known : solving_methods()) {
      std::string names;
      for (const MethodOption& option : known.options)
        names += fmt::format("{}{}", names.empty() ? "" : ", ", option.name);
      text += help_entry(std::string(known.name), names);
    }
  } else {
    text = fmt::format("Options of method {}, for --set:\n\n", method);
    for (const MethodOption& option : options_of(method))
      text += help_entry(std::string(option.name), description_of(option));
  }
  return text;
}

// For solves outside the server's solvers.
void add_cluster_options(CLI::App& command, SolveArguments& arguments) {
  CLI::Option* on =
      command.add_option("--on", arguments.on, "solve in parts of rows, with a job array on this cluster")
          ->check(CLI::IsMember({"slurm"}));
  SlurmSolve& slurm = arguments.slurm;
  command.add_option("--parts", slurm.parts, "jobs in the array")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str()
      ->needs(on);
  command
      .add_option(
          "--directory", slurm.directory,
          "directory for parts and logs, on a disk shared by all machines; default: glasswing-SESSION "
          "here")
      ->check(output_directory())
      ->needs(on);
  command
      .add_option("--archive", slurm.archive,
                  "the session's archive on such a disk; default: it is exported into the directory")
      ->check(CLI::ExistingDirectory)
      ->needs(on);
  command.add_option("--sbatch", slurm.sbatch, "an option of sbatch; may be repeated")
      ->type_name("OPTION")
      ->allow_extra_args(false)
      ->needs(on);
  command
      .add_option("--from", arguments.parts,
                  "use the matte of these parts, which glasswing-solver solve --rows wrote on any cluster")
      ->type_name("FILE")
      ->excludes(on)
      ->excludes("--method")
      ->excludes("--set");
}

}  // namespace

void add_priority_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand("priority", "Say which of the solves under way go first.");
  command.footer(
      "Tiles of a higher priority go first; within one, owners take turns. No tile is taken from a "
      "solver.\n\n"
      "Examples:\n  glasswing priority vase interactive\n  glasswing priority film batch");
  auto session = std::make_shared<std::string>(), priority = std::make_shared<std::string>();
  command.add_option("session", *session, "the session's name")->required();
  command.add_option("priority", *priority, "interactive, normal or batch")
      ->required()
      ->check(CLI::IsMember({"batch", "normal", "interactive"}));
  command.callback([&client, session, priority] {
    client.run = [&client, session, priority] { return set_priority(client, *session, *priority); };
  });
}

void add_solve_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand("solve", "Solve a captured session.");
  command.footer(
      "Examples:\n  glasswing solve vase --watch\n"
      "  glasswing solve vase --method gaussian --set images=100\n"
      "  glasswing solve vase --method fringe --set modes=2\n"
      "  glasswing solve vase --priority interactive --watch\n"
      "  glasswing solve vase --deadline \"$(date -d 18:00 +%FT%T%:z)\"\n"
      "  glasswing solve vase --camera left --watch\n"
      "  glasswing solve vase --on slurm --parts 32 --sbatch=--partition=lab\n"
      "  glasswing solve vase --from parts/part-*.exr\n"
      "  glasswing solve --help gaussian");
  auto arguments = std::make_shared<SolveArguments>();
  command.add_option("session", arguments->session, "the session's name")->required();
  add_view_option(command, arguments->camera);
  command.add_option("--method", arguments->method, "the method; default: the plan's")
      ->check(CLI::IsMember(method_names()));
  command.footer([arguments] { return options_text(*arguments); });
  command.add_option("--set", arguments->options, "an option of the method; may be repeated")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  command.add_flag("--watch", arguments->watch, "wait until it is done; any other outcome is a failure");
  add_cluster_options(command, *arguments);
  command
      .add_option("--priority", arguments->priority,
                  "whose tiles go first: interactive, normal or batch; default: normal")
      ->check(CLI::IsMember({"batch", "normal", "interactive"}))
      ->excludes("--on")
      ->excludes("--from");
  command
      .add_option(
          "--deadline", arguments->deadline,
          "when it should be done: its tiles go first while it would be late otherwise; glasswing fleet "
          "says whether it will be")
      ->type_name("TIME")
      ->excludes("--on")
      ->excludes("--from");
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return solve(client, *arguments); }; });
}

}  // namespace glasswing
