#include "server/queue/composites.h"

#include "core/base/status.h"
#include "core/process/low_priority.h"
#include "core/process/module.h"
#include "core/process/run_program.h"

namespace glasswing {
namespace {

constexpr char kProgram[] = "glasswing-compositing";
constexpr std::chrono::hours kLimit(1);

}  // namespace

Composites::~Composites() {
  stop_.request_stop();
}

absl::Status Composites::check_installed() {
  return find_program(kProgram).status();
}

std::optional<absl::Status> Composites::outcome(const std::vector<std::string>& sessions,
                                                const std::map<std::string, std::string>& background) {
  if (running_.valid()) {
    if (running_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return std::nullopt;
    absl::Status made = running_.get();
    if (made_ == sessions) return made;  // else nobody asks any more
  }
  made_ = sessions;
  running_ = std::async(std::launch::async, [this, sessions, background] {
    absl::Status made;
    run_at_low_priority([&] {
      for (const std::string& session : sessions) made.Update(make(session, background));
    });
    return made;
  });
  return std::nullopt;
}

absl::Status Composites::make(const std::string& session,
                              const std::map<std::string, std::string>& background) const {
  GW_ASSIGN_OR_RETURN(const std::filesystem::path program, find_program(kProgram));
  std::vector<std::string> words = {program.string(), "composite", mattes_.finished(session).string(),
                                    "--linear",       "--output",  mattes_.composite(session).string()};
  for (const auto& [monitor, image] : background) {
    words.emplace_back("--background");
    words.push_back((monitor.empty() ? "" : monitor + "=") + images_.path(image).string());
  }
  const absl::Status made =
      run_command(words, {.limit = kLimit, .stop = stop_.get_token(), .keep_output = true});
  std::error_code ignored;  // a session that was deleted meanwhile leaves nothing
  if (!std::filesystem::exists(mattes_.finished(session), ignored))
    std::filesystem::remove(mattes_.composite(session), ignored);
  return made;
}

}  // namespace glasswing
