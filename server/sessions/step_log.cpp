#include "server/sessions/step_log.h"

#include <algorithm>

namespace glasswing {

void StepLog::add(const std::string& session, v1::StepEvent event) {
  const std::lock_guard lock(mutex_);
  auto entry = std::ranges::find(entries_, session, &Entry::session);
  if (entry == entries_.end()) {
    if (entries_.size() == kMaxSessions) entries_.pop_front();
    entries_.push_back({.session = session, .events = {}, .proven = {}});
    entry = std::prev(entries_.end());
  }
  const bool is_proof = event.outcome() == v1::STEP_OUTCOME_PROVEN;
  if (entry->proven.contains(event.step()) || (!is_proof && entry->events.size() >= kMaxEvents)) return;
  if (is_proof) entry->proven.insert(event.step());
  entry->events.push_back(std::move(event));
}

std::optional<std::vector<v1::StepEvent>> StepLog::events(const std::string& session, size_t first) const {
  const std::lock_guard lock(mutex_);
  const auto entry = std::ranges::find(entries_, session, &Entry::session);
  if (entry == entries_.end()) return std::nullopt;
  const size_t from = std::min(first, entry->events.size());
  return std::vector(entry->events.begin() + from, entry->events.end());
}

v1::StepEvent proof_of(const v1::Frame& frame, double seconds) {
  v1::StepEvent event;
  event.set_step(frame.step());
  event.set_outcome(v1::STEP_OUTCOME_PROVEN);
  event.set_seconds(seconds);
  event.set_file(frame.file());
  event.set_proof(frame.proof());
  return event;
}

std::vector<v1::StepEvent> proven_steps(const v1::CaptureManifest& manifest) {
  std::vector<const v1::Frame*> frames;
  for (const v1::Frame& frame : manifest.frames()) {
    if (frame.step() >= 0) frames.push_back(&frame);
  }
  std::ranges::stable_sort(frames, {}, &v1::Frame::exposure_start_ns);
  std::vector<v1::StepEvent> events;
  for (const v1::Frame* frame : frames) {
    const std::int64_t since_first_ns = frame->exposure_start_ns() - frames.front()->exposure_start_ns();
    events.push_back(proof_of(*frame, 1e-9 * static_cast<double>(since_first_ns)));
  }
  return events;
}

}  // namespace glasswing
