#include "server/dispatch/adaptive_rounds.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <cmath>
#include <vector>

#include "core/base/status.h"
#include "core/file/positioned_file.h"
#include "core/frame/archive.h"
#include "core/matte/packed_matte.h"
#include "core/process/pause.h"
#include "server/archives/session_archive.h"

namespace glasswing {
namespace {

constexpr std::chrono::milliseconds kPoll(50);
constexpr int kLooked = 20'000;  // pixels of the draft, from which the object's are taken

// The object's, evenly.
absl::StatusOr<std::vector<JudgedPixel>> read_pixels(const std::filesystem::path& path, size_t monitors) {
  GW_ASSIGN_OR_RETURN(const PositionedFile file, PositionedFile::open(path));
  GW_ASSIGN_OR_RETURN(const PackedMatteReader reader, PackedMatteReader::open(file));
  const int width = reader.outline().width_px, height = reader.outline().height_px;
  const int step = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(width) * height / kLooked)));
  std::vector<JudgedPixel> pixels;
  GW_RETURN_IF_ERROR(reader.for_rows(
      step / 2, (height - step / 2 + step - 1) / step,
      [&](const Matte& rows) {
        add_pixels_of_object(rows, step / 2, step, monitors, pixels);
        return absl::OkStatus();
      },
      step));
  return pixels;
}

}  // namespace

absl::Status AdaptiveRounds::wait_for_draft(const v1::Session& session, std::stop_token stop) {
  for (int polls = 0;; ++polls) {
    const std::optional<v1::Draft> draft = drafts_.of(session);
    if (draft && draft->image_count() == session.step_count()) return absl::OkStatus();
    GW_RETURN_IF_ERROR(drafts_.failure(session.name(), session.step_count()));
    // A node that did not answer is asked again.
    if (polls % 20 == 0) drafts_.look_at(session.name());
    if (!pause(stop, kPoll)) return absl::CancelledError("stopped");
  }
}

absl::StatusOr<AdaptiveRounds::Drafted> AdaptiveRounds::drafted(const v1::Session& session,
                                                                std::stop_token stop) {
  GW_RETURN_IF_ERROR(wait_for_draft(session, std::move(stop)));
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, SessionArchive(session).manifest());
  Drafted drafted{.view = {.pixels = {}, .camera = manifest.camera()},
                  .monitors = {manifest.monitors().begin(), manifest.monitors().end()}};
  GW_ASSIGN_OR_RETURN(drafted.view.pixels,
                      read_pixels(mattes_.draft(session.name()), drafted.monitors.size()));
  if (drafted.view.pixels.empty())
    return absl::FailedPreconditionError(
        "the draft shows no object, so there is nothing to decide what to show next");
  return drafted;
}

absl::StatusOr<std::vector<v1::Session>> AdaptiveRounds::grow(std::vector<v1::Session> sessions,
                                                              std::stop_token stop) {
  std::vector<JudgedView> views;
  std::vector<v1::Session*> judged;  // of `views`
  std::vector<v1::Monitor> monitors;
  absl::Status unjudged;
  for (v1::Session& session : sessions) {
    absl::StatusOr<Drafted> draft = drafted(session, stop);
    if (!draft.ok() && !absl::IsFailedPrecondition(draft.status())) return draft.status();
    if (!draft.ok()) {
      unjudged = draft.status();
      const std::string warning = "it chose no images: " + std::string(unjudged.message());
      if (session.warning().find(warning) == std::string::npos)
        session.set_warning(session.warning().empty() ? warning : session.warning() + "; " + warning);
      continue;
    }
    views.push_back(std::move(draft->view));
    judged.push_back(&session);
    monitors = std::move(draft->monitors);
  }
  if (views.empty()) return unjudged;
  GW_ASSIGN_OR_RETURN(const Adaptation adaptation, adapt(std::move(views), judged.front()->plan(), monitors));
  for (size_t v = 0; v < judged.size(); ++v) {
    v1::Session& session = *judged[v];
    const v1::AdaptedRound& found = adaptation.found[v];
    spdlog::info("adapted session={} images={} known={:.3f} error_db={:.1f} error_px={:.3f}", session.name(),
                 found.image_count(), found.known_share(), found.error_db(), found.error_px());
    // Judged before, and then interrupted.
    const bool again =
        !session.adapted().empty() && session.adapted().rbegin()->image_count() == found.image_count();
    (again ? *session.mutable_adapted()->rbegin() : *session.add_adapted()) = found;
  }
  if (adaptation.next) {
    for (v1::Session& session : sessions) *session.mutable_plan()->add_rounds() = *adaptation.next;
  }
  return sessions;
}

}  // namespace glasswing
