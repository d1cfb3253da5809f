#include "server/capture/capture_progress.h"

#include <algorithm>

#include "core/pattern/describe_step.h"
#include "server/metrics/server_metrics.h"
#include "server/rig/embed_calibrations.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

constexpr int kMaxUnproven = 1000;  // listed in a session, which is sent as one message

}  // namespace

CaptureProgress::CaptureProgress(v1::Session session, StepLog& log,
                                 std::function<void(const v1::Session&)> report)
    : session_(std::move(session)), log_(log), report_(std::move(report)) {
  session_.clear_reason();
  rig_changes_before_ = session_.rig_changes_size();
}

void CaptureProgress::note_waiting(const std::string& why) {
  session_.set_reason(why);
  report();
}

void CaptureProgress::resume(const v1::CaptureManifest& manifest, int step_count) {
  session_.set_patch_proven_count(0);
  session_.set_time_proven_count(0);
  session_.set_archive_bytes(0);
  session_.set_warning(uncalibrated_warning(manifest));
  for (const v1::Frame& frame : manifest.frames()) count_proven(frame);
  for (v1::StepEvent& event : proven_steps(manifest)) log_.add(session_.name(), std::move(event));
  session_.set_step_count(step_count);
  session_.set_proven_count(static_cast<int>(proven_.size()));
}

void CaptureProgress::grow(const v1::Session& session, int step_count) {
  *session_.mutable_plan() = session.plan();
  *session_.mutable_adapted() = session.adapted();
  session_.set_warning(session.warning());
  session_.set_step_count(step_count);
  report();
}

void CaptureProgress::begin_group() {
  group_began_ = monotonic_now();
  seconds_before_ = session_.capture_seconds();
}

double CaptureProgress::seconds() const {
  if (!group_began_) return session_.capture_seconds();
  return seconds_before_ + std::chrono::duration<double>(monotonic_now() - *group_began_).count();
}

void CaptureProgress::note_shown(int step, bool again) {
  log_outcome(step, v1::STEP_OUTCOME_SHOWN);
  if (!again) return;
  session_.set_retaken_count(session_.retaken_count() + 1);
  server_metrics().steps_retaken.Increment();
}

void CaptureProgress::note_kept(const google::protobuf::RepeatedPtrField<v1::Frame>& frames, int refused) {
  const bool waited =
      session_.reason().starts_with(kStalled) || session_.reason().starts_with(kWaitsForPicture);
  if (!frames.empty() && waited) session_.clear_reason();
  for (const v1::Frame& frame : frames) {
    count_proven(frame);
    log_.add(session_.name(), proof_of(frame, seconds()));
  }
  session_.set_refused_count(session_.refused_count() + refused);
  update_seconds();
  report();
}

void CaptureProgress::note_retaken(int step, v1::RetakeCause cause) {
  log_outcome(step, v1::STEP_OUTCOME_RETAKEN, std::string(describe(cause)));
  retakes_counter(describe(cause)).Increment();
  auto& counts = *session_.mutable_retakes();
  auto count = std::ranges::find(counts, cause, &v1::RetakeCount::cause);
  if (count == counts.end()) {
    v1::RetakeCount& first = *counts.Add();
    first.set_cause(cause);
    first.set_count(1);
  } else {
    count->set_count(count->count() + 1);
  }
}

void CaptureProgress::note_unproven(const std::vector<Step>& steps) {
  for (const Step& step : steps) {
    if (session_.unproven_size() == kMaxUnproven) break;
    v1::UnprovenStep& unproven = *session_.add_unproven();
    unproven.set_step(step.number);
    unproven.set_what(describe(step));
  }
  report();
}

void CaptureProgress::note_lost(std::span<const int> indices, const std::vector<int>& video_steps) {
  session_.clear_lost_frames();
  for (const int index : indices) {
    session_.add_lost_frames(index);
    log_outcome(video_steps.at(static_cast<size_t>(index)), v1::STEP_OUTCOME_LOST);
  }
}

void CaptureProgress::warn(const std::string& warning) {
  session_.set_warning(session_.warning().empty() ? warning : session_.warning() + "; " + warning);
  report();
}

void CaptureProgress::note_rig_changes(const std::vector<v1::RigChange>& changes) {
  auto& noted = *session_.mutable_rig_changes();
  noted.DeleteSubrange(rig_changes_before_, noted.size() - rig_changes_before_);
  noted.Add(changes.begin(), changes.end());
  report();
}

void CaptureProgress::note_dropped() {
  const auto is_retaken = [this](const v1::StepRange& lost) {
    return std::ranges::any_of(session_.retaking(), [&](const v1::StepRange& retaken) {
      return retaken.first() <= lost.first() && lost.last() <= retaken.last();
    });
  };
  auto& changes = *session_.mutable_rig_changes();
  for (int i = changes.size() - 1; i >= 0; --i) {
    const auto& lost = changes[i].lost();
    if (!lost.empty() && std::ranges::all_of(lost, is_retaken)) changes.DeleteSubrange(i, 1);
  }
  rig_changes_before_ = changes.size();
  session_.clear_retaking();
}

void CaptureProgress::log_outcome(int step, v1::StepOutcome outcome, const std::string& why) {
  v1::StepEvent event;
  event.set_step(step);
  event.set_outcome(outcome);
  event.set_why(why);
  event.set_seconds(seconds());
  log_.add(session_.name(), std::move(event));
}

void CaptureProgress::count_proven(const v1::Frame& frame) {
  if (!proven_.insert(frame.step()).second) return;
  server_metrics().steps_proven.Increment();
  session_.set_archive_bytes(session_.archive_bytes() + frame.size_bytes());
  session_.set_proven_count(static_cast<int>(proven_.size()));
  if (frame.proof() == v1::PROOF_TIME_AND_PATCH)
    session_.set_patch_proven_count(session_.patch_proven_count() + 1);
  else
    session_.set_time_proven_count(session_.time_proven_count() + 1);
}

}  // namespace glasswing
