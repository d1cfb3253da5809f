#include "client/solve/slurm.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_replace.h>
#include <absl/strings/str_split.h>
#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <iostream>
#include <thread>

#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "client/exchange/export.h"
#include "client/solve/put_parts.h"
#include "core/base/status.h"
#include "core/cli/interrupt.h"
#include "core/cli/output.h"
#include "core/cli/progress.h"
#include "core/file/file.h"
#include "core/import/foreign_manifest.h"
#include "core/matte/row_part.h"
#include "core/method/methods.h"
#include "core/pattern/plan.h"
#include "core/process/run_program.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kAskEvery(2);
constexpr std::chrono::milliseconds kLookEvery(200);
constexpr std::chrono::minutes kSilence(10);  // of Slurm, until the array is given up
constexpr char kNoSuchJob[] = "Invalid job id";

std::string quoted(const std::string& word) {
  return "'" + absl::StrReplaceAll(word, {{"'", "'\\''"}}) + "'";
}

// "1,3-5" in Slurm's words.
std::string array_of(const std::vector<int>& rising) {
  std::vector<std::string> runs;
  for (size_t i = 0; i < rising.size();) {
    size_t end = i + 1;
    while (end < rising.size() && rising[end] == rising[end - 1] + 1) ++end;
    runs.push_back(end - i == 1 ? fmt::format("{}", rising[i])
                                : fmt::format("{}-{}", rising[i], rising[end - 1]));
    i = end;
  }
  return absl::StrJoin(runs, ",");
}

// The directory of a solve: archive, script, parts, logs, and the array's number.
class Desk {
 public:
  explicit Desk(const SlurmSolve& solve)
      : directory_(fs::absolute(solve.directory.empty() ? "glasswing-" + solve.session : solve.directory)
                       .lexically_normal()),
        parts_(solve.parts) {}

  const fs::path& directory() const { return directory_; }
  fs::path archive() const { return directory_ / "archive"; }
  fs::path script() const { return directory_ / "part.sbatch"; }
  fs::path job() const { return directory_ / "job"; }
  fs::path matte() const { return directory_ / "matte.exr"; }
  fs::path part(std::string_view number) const { return directory_ / fmt::format("part-{}.exr", number); }
  std::string log(std::string_view number) const {
    return (directory_ / fmt::format("part-{}.log", number)).string();
  }
  std::vector<fs::path> all_parts() const {
    std::vector<fs::path> files;
    for (int number = 1; number <= parts_; ++number) files.push_back(part(fmt::to_string(number)));
    return files;
  }
  std::vector<int> missing() const {
    std::vector<int> numbers;
    std::error_code ignored;
    for (int number = 1; number <= parts_; ++number) {
      if (!fs::exists(part(fmt::to_string(number)), ignored)) numbers.push_back(number);
    }
    return numbers;
  }
  // Files made by the solve; other files there are kept.
  void clear() const {
    std::error_code ignored;
    for (int number = 1; number <= parts_; ++number) fs::remove(log(fmt::to_string(number)), ignored);
    for (const fs::path& part : all_parts()) fs::remove(part, ignored);
    for (const fs::path& file : {script(), job(), matte()}) fs::remove(file, ignored);
    fs::remove_all(archive(), ignored);
    fs::remove(directory_, ignored);  // if it is empty
  }

 private:
  const fs::path directory_;
  const int parts_;
};

std::string script_of(const SlurmSolve& solve, const Desk& desk, const fs::path& archive) {
  std::string options = " --method " + quoted(solve.method);
  for (const auto& [name, value] : solve.options) options += " --set " + quoted(name + "=" + value);
  return fmt::format(
      "#!/bin/bash\n"
      "# One part of the matte of session {0}; Slurm gives its number.\n"
      "set -eu\n"
      "k=$SLURM_ARRAY_TASK_ID\n"
      "exec \"${{GLASSWING_BIN:+$GLASSWING_BIN/}}glasswing-solver\" solve {1} --rows \"$k/{2}\" "
      "-o {3}/part-\"$k\".exr \\\n"
      "  --threads \"${{SLURM_CPUS_PER_TASK:-${{SLURM_CPUS_ON_NODE:-1}}}}\"{4}\n",
      solve.session, quoted(archive.string()), solve.parts, quoted(desk.directory().string()), options);
}

absl::StatusOr<ProgramEnd> run_slurm(const std::vector<std::string>& words) {
  absl::StatusOr<ProgramEnd> end =
      run_program(words, {.limit = std::chrono::seconds(60), .keep_output = true});
  if (absl::IsFailedPrecondition(end.status()))
    return absl::FailedPreconditionError(fmt::format("{}; --on slurm needs Slurm's client programs here",
                                                     std::string(end.status().message())));
  return end;
}

absl::StatusOr<std::string> submit(const SlurmSolve& solve, const Desk& desk, const fs::path& archive) {
  GW_RETURN_IF_ERROR(write_file_durably(desk.script(), script_of(solve, desk, archive)));
  std::vector<std::string> words = {"sbatch",
                                    "--parsable",
                                    "--job-name=glasswing-" + solve.session,
                                    "--array=" + array_of(desk.missing()),
                                    "--requeue",
                                    "--open-mode=append",
                                    "--output=" + desk.log("%a")};
  words.insert(words.end(), solve.sbatch.begin(), solve.sbatch.end());
  words.push_back(desk.script().string());
  GW_ASSIGN_OR_RETURN(const ProgramEnd end, run_slurm(words));
  const std::string job = std::string(
      absl::StripAsciiWhitespace(end.output.substr(0, end.output.find(';'))));  // "117" or "117;cluster"
  if (end.status != 0 || job.empty() || job.find_first_not_of("0123456789") != std::string::npos)
    return absl::FailedPreconditionError(
        fmt::format("sbatch failed with exit status {}: {}", end.status, end.error));
  GW_RETURN_IF_ERROR(write_file_durably(desk.job(), job));
  std::cerr << fmt::format("solving: submitted {} of {} parts as job {}\n", desk.missing().size(),
                           solve.parts, job);
  return job;
}

struct Queue {
  int running = 0, waiting = 0;
};

// UNAVAILABLE: Slurm does not answer.
absl::StatusOr<Queue> queue_of(const std::string& job) {
  GW_ASSIGN_OR_RETURN(const ProgramEnd end,
                      run_slurm({"squeue", "--noheader", "--array", "--jobs=" + job, "--format=%T"}));
  Queue queue;
  if (end.status != 0) {
    if (end.error.find(kNoSuchJob) != std::string::npos) return queue;
    return absl::UnavailableError(end.error);
  }
  const std::vector<std::string> states = absl::StrSplit(end.output, '\n', absl::SkipWhitespace());
  for (const std::string& state : states) ++(state.starts_with("RUNNING") ? queue.running : queue.waiting);
  return queue;
}

// Until all parts are there.
absl::Status follow(const std::string& job, const SlurmSolve& solve, const Desk& desk) {
  Progress progress("solving");
  const Interruptible ctrl_c;
  Queue queue;
  bool ended = false;
  Clock::time_point asked{}, answered = Clock::now();
  while (true) {
    const std::vector<int> missing = desk.missing();
    const int there = solve.parts - static_cast<int>(missing.size());
    progress.update(static_cast<double>(there) / solve.parts,
                    fmt::format("{} of {} parts, {} running, {} waiting", there, solve.parts, queue.running,
                                queue.waiting));
    if (missing.empty()) return absl::OkStatus();
    if (ended) {
      return absl::FailedPreconditionError(
          fmt::format("parts {} of job {} ended without a result; see {}. The same command solves them again",
                      array_of(missing), job, desk.log(fmt::to_string(missing.front()))));
    }
    if (interrupted()) {
      return absl::CancelledError(fmt::format(
          "job {0} continues; the same command fetches its result, and scancel {0} ends it", job));
    }
    if (Clock::now() - asked >= kAskEvery) {
      asked = Clock::now();
      const absl::StatusOr<Queue> now = queue_of(job);
      if (now.ok()) {
        queue = *now;
        answered = asked;
        // Its last files may appear slightly later.
        ended = queue.running + queue.waiting == 0;
        if (ended) std::this_thread::sleep_for(kAskEvery);
        continue;
      }
      if (!absl::IsUnavailable(now.status()) || asked - answered > kSilence) return now.status();
    }
    std::this_thread::sleep_for(kLookEvery);
  }
}

// FAILED_PRECONDITION: its frames differ from the session's current ones.
absl::Status check_archive(const fs::path& archive, const v1::Session& session) {
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, read_any_manifest(archive));
  const Peer<v1::ArchiveService> node("camera node at " + session.archive_address(),
                                      session.archive_address());
  v1::GetManifestRequest request;
  request.set_session(session.name());
  GW_ASSIGN_OR_RETURN(const v1::GetManifestResponse own,
                      call(node, &v1::ArchiveService::Stub::GetManifest, request, kLongCallTimeout));
  if (archive_digest(manifest) == archive_digest(own.manifest())) return absl::OkStatus();
  return absl::FailedPreconditionError(
      fmt::format("{} is not the current archive of session {}; remove it, or name another one",
                  archive.string(), session.name()));
}

// The array that an earlier call left running, otherwise a new one.
absl::Status solve_parts(const SlurmSolve& solve, const Desk& desk, const fs::path& archive) {
  const absl::StatusOr<std::string> script = read_file(desk.script());
  if (script.ok() && *script != script_of(solve, desk, archive)) {
    return absl::FailedPreconditionError(
        fmt::format("{} contains parts of another solve; remove it, or name another --directory",
                    desk.directory().string()));
  }
  if (desk.missing().empty()) return absl::OkStatus();
  if (const absl::StatusOr<std::string> before = read_file(desk.job()); before.ok()) {
    GW_ASSIGN_OR_RETURN(const Queue queue, queue_of(*before));
    if (queue.running + queue.waiting > 0) return follow(*before, solve, desk);
  }
  GW_ASSIGN_OR_RETURN(const std::string job, submit(solve, desk, archive));
  return follow(job, solve, desk);
}

absl::StatusOr<v1::Session> session_to_solve(const Client& client, SlurmSolve& solve) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  v1::GetSessionRequest request;
  request.set_name(solve.session);
  GW_ASSIGN_OR_RETURN(v1::GetSessionResponse found,
                      call(server, &v1::SessionService::Stub::GetSession, request));
  v1::Session& session = *found.mutable_session();
  if (!allows(session, v1::SESSION_ACTION_SOLVE)) {
    return absl::FailedPreconditionError(
        fmt::format("session {} is {}; it must be captured before it is solved", session.name(),
                    state_name(session.state())));
  }
  if (solve.method.empty())
    solve.method = session.plan().method().empty() ? session.method() : session.plan().method();
  if (solve.method == kRampMethod) {
    return absl::InvalidArgumentError(
        "--on slurm solves stills; solve a video's frames with the server's solvers, without --on");
  }
  return std::move(session);
}

}  // namespace

absl::Status solve_on_slurm(const Client& client, const SlurmSolve& wanted) {
  SlurmSolve solve = wanted;
  GW_ASSIGN_OR_RETURN(v1::Session session, session_to_solve(client, solve));
  const Desk desk(solve);
  GW_RETURN_IF_ERROR(make_directory_durably(desk.directory()));
  const fs::path archive = solve.archive.empty() ? desk.archive() : fs::absolute(solve.archive);
  std::error_code ignored;
  if (solve.archive.empty() && !fs::exists(archive, ignored)) {
    GW_RETURN_IF_ERROR(export_archive(session, archive.string()).status());
  } else {
    GW_RETURN_IF_ERROR(check_archive(archive, session));
  }
  const Clock::time_point begun = Clock::now();
  GW_RETURN_IF_ERROR(solve_parts(solve, desk, archive));
  const std::chrono::duration<double> took = Clock::now() - begun;
  GW_ASSIGN_OR_RETURN(session,
                      put_parts(client, solve.session, desk.all_parts(), desk.matte(), took.count()));
  desk.clear();
  print_session(session, client.json);
  return absl::OkStatus();
}

}  // namespace glasswing
