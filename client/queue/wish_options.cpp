#include "client/queue/wish_options.h"

#include <fmt/format.h>

#include "client/capture/rail_positions.h"
#include "client/capture/upload.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

// "--solve,!--no-solve": absent, true or false.
void add_choice(CLI::App& command, const std::string& names, std::optional<bool>& value,
                const std::string& help) {
  command.add_flag_function(
      names, [&value](std::int64_t count) { value = count > 0; }, help);
}

absl::Status enter_background(const Client& client, const std::vector<std::string>& pictures,
                              v1::QueueWish& wish) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  std::map<std::string, std::string> background;
  for (const std::string& text : pictures) {
    const size_t equals = text.find('=');
    const std::string monitor = equals == std::string::npos ? "" : text.substr(0, equals);
    const auto [named, is_new] = background.try_emplace(monitor);
    if (!is_new) {
      return absl::InvalidArgumentError(fmt::format("--background names {} twice; each takes one picture",
                                                    monitor.empty() ? "the first monitor" : monitor));
    }
    GW_ASSIGN_OR_RETURN(named->second, upload_background(server, text.substr(equals + 1)));
  }
  wish.mutable_background()->clear();
  wish.mutable_background()->insert(background.begin(), background.end());
  return absl::OkStatus();
}

}  // namespace

void add_wish_options(CLI::App& command, const std::shared_ptr<WishOptions>& options) {
  WishOptions& wish = *options;
  command.add_option(
      "--session", wish.session,
      "the session's name; {item} becomes the item's number, {date} and {time} those of its start");
  add_choice(command, "--solve,!--no-solve", wish.solve, "solve it as soon as it is captured");
  command
      .add_option(
          "--background", wish.background,
          "also composite the solved matte over this picture, as glasswing composite; may be repeated "
          "for several monitors; fetch SESSION --composite has the result")
      ->allow_extra_args(false)
      ->type_name("[MONITOR=]IMAGE");
  command
      .add_option("--deadline", wish.deadline, "when the solve should be done, as glasswing solve --deadline")
      ->type_name("TIME");
  command.add_option("--tag", wish.tags, "a tag of the session; may be repeated")->allow_extra_args(false);
  command.add_option("--note", wish.note, "a note of the session");
  command
      .add_option("--exposure-ms", wish.exposure_ms,
                  "exposure times instead of the plan's, divided by commas")
      ->delimiter(',')
      ->type_name("MS,MS");
  command
      .add_option("--rail-mm", wish.rail_mm,
                  "where a monitor shall stand: its rail moves it there; may be repeated")
      ->allow_extra_args(false)
      ->type_name("MONITOR:MM");
  command
      .add_option("--retries", wish.retries, "how often a capture that broke off is tried again; default: 3")
      ->check(CLI::Range(0, 100));
  command.add_option("--retry-wait", wish.retry_wait_s, "seconds before it is tried again; default: 60")
      ->check(CLI::Range(0.0, 86400.0));
  add_choice(command, "--approval,!--no-approval", wish.approval,
             "wait until somebody has approved it: glasswing queue approve ITEM");
  add_choice(command, "--steady,!--no-steady", wish.steady,
             "wait for an approval where the capture before saw the rig drift, or touched");
  add_choice(command, "--doctor,!--no-doctor", wish.doctor,
             "test the rig before it, as glasswing doctor; a problem counts as a capture that broke off");
  add_choice(command, "--no-warnings,!--allow-warnings", wish.no_warnings,
             "the same of whatever capture --dry-run would warn of");
  command.add_option("--not-before", wish.not_before, "wait until this time: 2026-11-01T20:00:00+01:00")
      ->type_name("TIME");
  command
      .add_option("--warm-up", wish.warm_up_s,
                  "seconds for which the plan's monitors are white just before the capture")
      ->check(CLI::Range(0.0, 86400.0));
  command
      .add_option("--give-up", wish.give_up_s,
                  "seconds to wait for people; then the next item runs; 0: for ever")
      ->check(CLI::Range(0.0, 1e7));
  add_choice(command, "--retake-unusual,!--keep-unusual", wish.retake_unusual,
             "when no other item is left, capture it once more if its figures are unusual for its series");
  add_choice(command, "--pause-after,!--no-pause-after", wish.pause_after, "pause the queue after it");
}

absl::Status enter_wish(const Client& client, const WishOptions& options, v1::QueueWish& wish) {
  if (options.session) wish.set_session(*options.session);
  if (options.note) wish.set_note(*options.note);
  if (options.deadline) wish.set_deadline(*options.deadline);
  if (options.not_before) wish.set_not_before(*options.not_before);
  if (!options.tags.empty()) wish.mutable_tags()->Assign(options.tags.begin(), options.tags.end());
  if (!options.exposure_ms.empty())
    wish.mutable_plan()->mutable_exposure_ms()->Assign(options.exposure_ms.begin(),
                                                       options.exposure_ms.end());
  for (const std::string& text : options.rail_mm) {
    GW_ASSIGN_OR_RETURN(const RailPositions at, parse_rail_positions("--rail-mm", text));
    if (at.monitor.empty() || at.mm.size() != 1) {
      return absl::InvalidArgumentError(
          fmt::format("--rail-mm is \"{}\"; it must be one position of a monitor, as back:200", text));
    }
    (*wish.mutable_rail_mm())[at.monitor] = at.mm.front();
  }
  if (options.solve) wish.set_solve(*options.solve);
  if (!wish.solve()) wish.clear_background();
  if (!options.background.empty()) GW_RETURN_IF_ERROR(enter_background(client, options.background, wish));
  if (options.retries) wish.set_retries(*options.retries);
  if (options.retry_wait_s) wish.set_retry_wait_s(*options.retry_wait_s);
  if (options.approval) wish.set_approval(*options.approval);
  if (options.steady) wish.set_steady(*options.steady);
  if (options.doctor) wish.set_doctor(*options.doctor);
  if (options.no_warnings) wish.set_no_warnings(*options.no_warnings);
  if (options.warm_up_s) wish.set_warm_up_s(*options.warm_up_s);
  if (options.give_up_s) wish.set_give_up_s(*options.give_up_s);
  if (options.retake_unusual) wish.set_retake_unusual(*options.retake_unusual);
  if (options.pause_after) wish.set_pause_after(*options.pause_after);
  return absl::OkStatus();
}

}  // namespace glasswing
