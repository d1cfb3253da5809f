#include "server/dispatch/drafts.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <set>
#include <utility>

#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/file/file.h"
#include "core/file/mapped_file.h"
#include "core/image/mosaic.h"
#include "core/matte/matte_file.h"
#include "core/process/pause.h"
#include "server/archives/session_archive.h"
#include "server/mattes/join_tiles.h"
#include "server/sessions/views.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kDraftPause(500);
constexpr const char* kDraft = "draft";  // what each of its jobs computes
// Nothing is known about the cost of rows, and a draft is not surveyed.
constexpr int kDraftTiles = 48, kMinDraftRows = 2;
constexpr std::int64_t kMaxDraftTileBytes = 256 << 20;  // of frames' samples
constexpr std::chrono::seconds kBreak(
    5);  // between a capture's reports: it was paused, or a node did not answer
constexpr double kFewPixels = 60'000;
constexpr double kFirstPixels = 2'500, kWaited_s = 4.0;  // of a draft that a capture waits for
constexpr int kFirstStep = 5;
constexpr double kPartOfRest = 0.7;  // of the capture
constexpr double kNearlyAll = 0.95;  // of a stage's steps

std::vector<TileRange> draft_tiles(const v1::CaptureManifest& manifest, int frame_count, int pixel_step) {
  const FrameShape shape = shape_of(manifest.camera());
  const std::int64_t row_bytes = 2 * static_cast<std::int64_t>(shape.row_samples()) * frame_count;
  const auto fitting =
      static_cast<int>(std::clamp<std::int64_t>(kMaxDraftTileBytes / row_bytes, 1, shape.height_px));
  int rows = std::min(fitting, std::max(kMinDraftRows, (shape.height_px + kDraftTiles - 1) / kDraftTiles));
  rows = std::max(rows / pixel_step, 1) * pixel_step;
  std::vector<TileRange> tiles;
  for (int y = 0; y < shape.height_px; y += rows)
    tiles.push_back({.first = y, .count = std::min(rows, shape.height_px - y)});
  return tiles;
}

absl::Status void_attempt(const v1::TileLease& lease) {
  return absl::AbortedError(fmt::format("tile {} of the draft of session \"{}\" is no longer wanted",
                                        lease.tile(), lease.session()));
}

TileAttempt attempt_of(std::int64_t job, const v1::TileLease& lease) {
  return {.job = job, .tile = lease.tile(), .attempt = lease.attempt()};
}

}  // namespace

int pixel_step_of(const v1::Camera& camera, int image_count, double unit_seconds, double seconds_left) {
  const double pixels = static_cast<double>(camera.width_px()) * camera.height_px();
  // The colours of a mosaic's pixel come from its neighbours.
  if (pixels <= kFewPixels || !camera.mosaic().empty()) return 1;
  const double of_all = unit_seconds * pixels * image_count;
  for (const int step : {1, 3}) {
    if (unit_seconds > 0.0 && of_all / (step * step) <= kPartOfRest * seconds_left) return step;
  }
  return kFirstStep;
}

int pixel_step_while_waiting(const v1::Camera& camera, int image_count, double unit_seconds) {
  if (!camera.mosaic().empty()) return 1;
  const double pixels = static_cast<double>(camera.width_px()) * camera.height_px();
  const double affordable = unit_seconds > 0.0 ? kWaited_s / (unit_seconds * image_count) : kFirstPixels;
  int step = 1;
  while (pixels / (step * step) > std::max(affordable, 0.25 * kFirstPixels)) step += 2;
  return step;
}

std::optional<std::vector<int>> reached(const DraftStage& stage, const std::vector<int>& shown,
                                        const v1::CaptureManifest& manifest) {
  std::set<int> stored;
  for (const v1::Frame& frame : manifest.frames()) stored.insert(frame.step());
  const auto end = shown.begin() + stage.step_count;
  std::vector<int> steps;
  std::ranges::copy_if(shown.begin(), end, std::back_inserter(steps),
                       [&](int step) { return stored.contains(step); });
  std::ranges::sort(steps);
  const bool all = std::ssize(steps) == stage.step_count;
  const bool gone_on = std::any_of(end, shown.end(), [&](int step) { return stored.contains(step); });
  if (all || (gone_on && static_cast<double>(steps.size()) >= kNearlyAll * stage.step_count)) return steps;
  return std::nullopt;
}

Drafts::Drafts(SessionStore& sessions, const MatteFiles& mattes, JobStore& tiles)
    : sessions_(sessions),
      mattes_(mattes),
      tiles_(tiles),
      thread_([this](std::stop_token stop) { run(stop); }) {}

void Drafts::take_up() {
  const std::lock_guard lock(mutex_);
  for (const auto& [session, path] : mattes_.drafts()) {
    std::error_code error;
    const std::uintmax_t size = fs::file_size(path, error);
    if (error) continue;
    const absl::StatusOr<std::shared_ptr<const MappedFile>> file = MappedFile::open(path, size);
    if (!file.ok()) continue;
    const absl::StatusOr<MatteOutline> outline = outline_of((*file)->bytes());
    if (outline.ok() && (*file)->intact()) made_[session] = outline->metadata.draft();
  }
}

void Drafts::note(const v1::Session& session) {
  if (!session.solve_follows()) return;
  if (session.state() == v1::SESSION_STATE_CAPTURING) return to_look_at_.add(session.name());
  if (session.state() == v1::SESSION_STATE_PAUSED) return;
  const std::lock_guard lock(mutex_);
  if (running_ && running_->session.name() == session.name()) end();
}

void Drafts::forget(const std::string& session) {
  const std::lock_guard lock(mutex_);
  if (running_ && running_->session.name() == session) end();
  made_.erase(session);
  failed_.erase(session);
}

std::optional<v1::Draft> Drafts::of(const v1::Session& session) {
  const std::lock_guard lock(mutex_);
  const auto made = made_.find(session.name());
  if (made == made_.end()) return std::nullopt;
  if (!session.matte_ready()) return made->second;
  made_.erase(made);
  return std::nullopt;
}

absl::Status Drafts::failure(const std::string& session, int image_count) {
  const std::lock_guard lock(mutex_);
  const auto failed = failed_.find(session);
  if (failed == failed_.end() || failed->second.image_count != image_count) return absl::OkStatus();
  return failed->second.status;
}

void Drafts::run(std::stop_token stop) {
  while (!stop.stop_requested()) {
    for (const std::string& name : to_look_at_.take(stop)) {
      const absl::Status looked = look(name);
      // An unreachable node is named by the capture itself.
      if (!looked.ok() && !absl::IsUnavailable(looked))
        spdlog::warn("no draft session={} error=\"{}\"", name, std::string(looked.message()));
    }
    pause(stop, kDraftPause);
  }
}

absl::StatusOr<Drafts::Plan*> Drafts::plan_of(const v1::Session& session) {
  const auto known = plans_.find(session.name());
  if (known != plans_.end() && known->second.rounds == session.plan().rounds_size()) return &known->second;
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, SessionArchive(session).manifest());
  GW_ASSIGN_OR_RETURN(const std::vector<Step> steps,
                      expand(session.plan(), {manifest.monitors().begin(), manifest.monitors().end()}));
  const std::vector<Step> shown = in_order_of_showing(steps);
  Plan plan = known == plans_.end() ? Plan{} : std::move(known->second);
  plan.capture = capture_name(session);
  plan.rounds = session.plan().rounds_size();
  plan.steps.clear();
  plan.stages = draft_stages(session.plan(), shown);
  plan.sweep_count = session.plan().has_adapt() ? 0 : count_sweeps(steps);
  for (const Step& step : shown) plan.steps.push_back(step.number);
  // A server captures one session at a time, or the views of one.
  std::erase_if(plans_, [&](const auto& other) { return other.second.capture != plan.capture; });
  return &plans_.insert_or_assign(session.name(), std::move(plan)).first->second;
}

absl::Status Drafts::look(const std::string& name) {
  const absl::StatusOr<v1::Session> session = sessions_.find(name);
  if (!session.ok() || session->state() != v1::SESSION_STATE_CAPTURING || !session->solve_follows() ||
      session->archive_address().empty())
    return absl::OkStatus();
  GW_ASSIGN_OR_RETURN(Plan* const plan, plan_of(*session));
  const nanoseconds now = monotonic_now();
  if (now - plan->looked > kBreak) {
    plan->since = now;
    plan->since_proven = session->proven_count();
  }
  plan->looked = now;
  {
    const std::lock_guard lock(mutex_);
    // Looked at again once it is done.
    const bool of_other_view =
        running_ && running_->session.name() != name && capture_name(running_->session) == plan->capture;
    if (of_other_view || (running_ && running_->began)) return absl::OkStatus();
  }
  const auto may_be_reached = [&](const DraftStage& stage) {
    return stage.step_count > plan->begun && session->proven_count() >= kNearlyAll * stage.step_count;
  };
  if (std::ranges::none_of(plan->stages, may_be_reached)) return absl::OkStatus();
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, SessionArchive(*session).manifest());
  for (auto stage = plan->stages.rbegin(); stage != plan->stages.rend(); ++stage) {
    if (!may_be_reached(*stage)) continue;
    std::optional<std::vector<int>> steps = reached(*stage, plan->steps, manifest);
    if (!steps) continue;
    return begin(*session, *stage, *std::move(steps), manifest, *plan);
  }
  return absl::OkStatus();
}

absl::Status Drafts::begin(const v1::Session& session, const DraftStage& stage, std::vector<int> steps,
                           const v1::CaptureManifest& manifest, Plan& plan) {
  v1::Draft draft;
  draft.set_image_count(static_cast<int>(steps.size()));
  draft.set_planned_image_count(static_cast<int>(plan.steps.size()));
  draft.set_sweep_count(stage.sweep_count);
  draft.set_planned_sweep_count(plan.sweep_count);
  const std::lock_guard lock(mutex_);
  const std::chrono::duration<double> took = plan.looked - plan.since;
  const double seconds_left = took.count() * (session.step_count() - session.proven_count()) /
                              std::max(session.proven_count() - plan.since_proven, 1);
  const bool waited_for = session.plan().has_adapt();
  const int pixel_step =
      waited_for ? pixel_step_while_waiting(manifest.camera(), draft.image_count(), unit_seconds_)
                 : pixel_step_of(manifest.camera(), draft.image_count(), unit_seconds_, seconds_left);
  plan.begun = stage.step_count;
  // With few pixels, more sweeps do not improve a draft.
  if (!waited_for && plan.pixel_step > 1 && pixel_step >= plan.pixel_step) return absl::OkStatus();
  if (!waited_for && plan.pixel_step == 1 && pixel_step > 1) return absl::OkStatus();
  plan.pixel_step = pixel_step;
  // Solvers identify jobs by number, across restarts of the server.
  last_job_ = std::min(
      last_job_ - 1, -std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count());
  if (running_) end();
  GW_ASSIGN_OR_RETURN(const std::int64_t job,
                      tiles_.create({.session = session.name(), .computes = kDraft, .work = {}},
                                    draft_tiles(manifest, draft.image_count(), pixel_step)));
  running_ = {.lease_job = last_job_,
              .job = job,
              .session = session,
              .draft = draft,
              .steps = std::move(steps),
              .pixel_step = pixel_step};
  spdlog::info("draft begun session={} images={} of={} pixel_step={}", session.name(), draft.image_count(),
               draft.planned_image_count(), pixel_step);
  return absl::OkStatus();
}

v1::ClaimTileResponse Drafts::claim(const std::string& solver) {
  v1::ClaimTileResponse response;
  const std::lock_guard lock(mutex_);
  if (!running_) return response;
  const absl::StatusOr<std::optional<Lease>> claimed =
      tiles_.claim(solver, std::vector<std::string>{kDraft}, /*ahead=*/false);
  if (!claimed.ok() || !*claimed) {
    const absl::StatusOr<JobCounts> counts = tiles_.counts(running_->job);
    if (counts.ok() && counts->quarantined > 0) give_up("no solver that began one of its tiles answers");
    return response;
  }
  if (!running_->began) running_->began = monotonic_now();
  const TileAttempt& attempt = (*claimed)->id;
  v1::TileLease& lease = *response.mutable_lease();
  lease.set_session(running_->session.name());
  lease.set_job(running_->lease_job);
  lease.set_tile(attempt.tile);
  lease.set_attempt(attempt.attempt);
  response.set_lease_ms(kDraftLease.count());
  response.set_first_row((*claimed)->range.first);
  response.set_row_count((*claimed)->range.count);
  response.set_method(running_->session.plan().method());
  *response.mutable_options() = running_->session.options();
  response.set_archive_address(running_->session.archive_address());
  *response.mutable_draft() = running_->draft;
  response.set_draft_pixel_step(running_->pixel_step);
  response.mutable_draft_steps()->Add(running_->steps.begin(), running_->steps.end());
  return response;
}

Drafts::Running* Drafts::running(const v1::TileLease& lease) {
  return running_ && running_->lease_job == lease.job() ? &*running_ : nullptr;
}

void Drafts::end() {
  (void)tiles_.remove(running_->job);
  running_.reset();
}

void Drafts::give_up(const std::string& error) {
  const std::string session = running_->session.name();
  const int images = running_->draft.image_count();
  spdlog::warn("no draft session={} images={} error=\"{}\"", session, images, error);
  failed_[session] = {.image_count = images, .status = absl::FailedPreconditionError(error)};
  to_look_at_.add(session);
  end();
}

absl::Status Drafts::renew(const v1::TileLease& lease) {
  const std::lock_guard lock(mutex_);
  const Running* const draft = running(lease);
  return draft == nullptr ? void_attempt(lease) : tiles_.renew(attempt_of(draft->job, lease));
}

absl::Status Drafts::check(const v1::TileLease& lease) {
  const std::lock_guard lock(mutex_);
  return running(lease) == nullptr ? void_attempt(lease) : absl::OkStatus();
}

absl::Status Drafts::complete(const v1::CompleteTileRequest& header,
                              const absl::StatusOr<MatteOutline>& outline, ReceivedMatte& matte) {
  const v1::TileLease& lease = header.lease();
  v1::Session session;
  TileRange range;
  {
    const std::lock_guard lock(mutex_);
    const Running* const draft = running(lease);
    if (draft == nullptr) return void_attempt(lease);
    GW_ASSIGN_OR_RETURN(const TileState tile, tiles_.tile(attempt_of(draft->job, lease)));
    range = tile.range;
    session = draft->session;
  }
  GW_RETURN_IF_ERROR(outline.status());
  GW_RETURN_IF_ERROR(check_rows(*outline, range, session));
  GW_ASSIGN_OR_RETURN(const fs::path directory, mattes_.tiles(session.name()));
  const std::string file = tile_name(lease.job(), lease.tile(), lease.attempt(), matte.checksum());
  GW_RETURN_IF_ERROR(matte.place(directory / file));  // not flushed
  std::optional<Running> done;
  std::vector<TileState> tiles;
  {
    const std::lock_guard lock(mutex_);
    const Running* const draft = running(lease);
    if (draft == nullptr) return void_attempt(lease);
    GW_RETURN_IF_ERROR(tiles_.complete(attempt_of(draft->job, lease), {.result = file}));
    GW_ASSIGN_OR_RETURN(tiles, tiles_.tiles(draft->job));
    if (!std::ranges::all_of(tiles, &TileState::is_done)) return absl::OkStatus();
    done = *draft;
    end();
    const double solved = static_cast<double>(session.pixel_count()) / (done->pixel_step * done->pixel_step);
    const std::chrono::duration<double> took = monotonic_now() - *done->began;
    unit_seconds_ = took.count() / (solved * done->draft.image_count());
  }
  const absl::Status finished = finish(*done, tiles);
  if (!finished.ok()) {
    spdlog::warn("no draft session={} error=\"{}\"", session.name(), std::string(finished.message()));
    const std::lock_guard lock(mutex_);
    failed_[session.name()] = {.image_count = done->draft.image_count(), .status = finished};
  }
  to_look_at_.add(session.name());
  return absl::OkStatus();
}

absl::Status Drafts::finish(const Running& done, const std::vector<TileState>& tiles) {
  const std::string& name = done.session.name();
  GW_ASSIGN_OR_RETURN(const fs::path directory, mattes_.tiles(name));
  const fs::path unfinished = directory / "draft.tmp";
  {
    GW_ASSIGN_OR_RETURN(PositionedFile file, PositionedFile::create(unfinished));
    GW_RETURN_IF_ERROR(join_tiles(tiles, directory, file));
  }
  // Without an Edit, because captures wait for it.
  GW_RETURN_IF_ERROR(place_file_durably(unfinished, mattes_.draft(name)));
  std::error_code ignored;  // all go with the session's solve
  for (const TileState& tile : tiles) fs::remove(directory / tile.done.result, ignored);
  SessionStore::Edit edit = sessions_.edit();
  if (const absl::Status there = edit.find(name).status(); !there.ok()) {  // deleted meanwhile
    fs::remove(mattes_.draft(name), ignored);
    return there;
  }
  {
    const std::lock_guard lock(mutex_);
    made_[name] = done.draft;
  }
  edit.announce();
  spdlog::info("draft made session={} images={} of={}", name, done.draft.image_count(),
               done.draft.planned_image_count());
  return absl::OkStatus();
}

void Drafts::fail(const v1::FailTileRequest& request) {
  const std::lock_guard lock(mutex_);
  const Running* const draft = running(request.lease());
  if (draft == nullptr) return;
  const TileAttempt attempt = attempt_of(draft->job, request.lease());
  if (request.handed_back()) {
    (void)tiles_.hand_back(attempt);
    return;
  }
  const absl::StatusOr<bool> quarantined = tiles_.fail(attempt, request.error(), request.permanent());
  if (quarantined.ok() && *quarantined) give_up(request.error());
}

}  // namespace glasswing
