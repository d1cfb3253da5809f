#include "core/sim/emission_timeline.h"

#include <algorithm>

namespace glasswing {
namespace {

size_t bytes_of(const EmittedPicture& picture) {
  return picture.image->samples.size() * sizeof(picture.image->samples[0]);
}

}  // namespace

void EmissionTimeline::Track::forget_first() {
  bytes -= bytes_of(pictures.front());
  pictures.pop_front();
  complete = false;
}

EmissionMonitor EmissionTimeline::Track::at(nanoseconds time) const {
  EmissionMonitor there = monitor;
  for (const auto& [since, pose] : poses) {
    if (since <= time) there.pose = pose;
  }
  return there;
}

void EmissionTimeline::add_monitor(const EmissionMonitor& monitor) {
  const std::lock_guard lock(mutex_);
  for (Track& track : tracks_) {
    if (track.monitor.name != monitor.name) continue;
    track = {.monitor = monitor, .pictures = {}, .poses = {}, .bytes = 0, .complete = true, .horizon = {}};
    return;
  }
  tracks_.push_back(
      {.monitor = monitor, .pictures = {}, .poses = {}, .bytes = 0, .complete = true, .horizon = {}});
}

void EmissionTimeline::add_picture(const std::string& monitor, EmittedPicture picture) {
  const std::lock_guard lock(mutex_);
  for (Track& track : tracks_) {
    if (track.monitor.name != monitor) continue;
    // Keeps the picture that is visible at the start of the kept time.
    const nanoseconds oldest = picture.scanout_start - kept_;
    while (track.pictures.size() > 1 && track.pictures[1].scanout_start < oldest) track.forget_first();
    track.bytes += bytes_of(picture);
    track.pictures.push_back(std::move(picture));
    while (track.bytes > max_bytes_ && track.pictures.size() > 2) track.forget_first();
    break;
  }
  changed_.notify_all();
}

void EmissionTimeline::set_pose(const std::string& monitor, nanoseconds since, const PanelPose& pose) {
  const std::lock_guard lock(mutex_);
  for (Track& track : tracks_) {
    if (track.monitor.name != monitor) continue;
    // Keeps the pose at the start of the kept time.
    while (track.poses.size() > 1 && track.poses[1].first < since - kept_) track.poses.pop_front();
    track.poses.emplace_back(since, pose);
  }
}

void EmissionTimeline::set_horizon(const std::string& monitor, nanoseconds until) {
  const std::lock_guard lock(mutex_);
  for (Track& track : tracks_) {
    if (track.monitor.name == monitor) track.horizon = std::max(track.horizon, until);
  }
  changed_.notify_all();
}

void EmissionTimeline::clear() {
  const std::lock_guard lock(mutex_);
  tracks_.clear();
  changed_.notify_all();
}

std::vector<EmissionMonitor> EmissionTimeline::monitors() const {
  const std::lock_guard lock(mutex_);
  std::vector<EmissionMonitor> monitors;
  for (const Track& track : tracks_) monitors.push_back(track.at(nanoseconds::max()));
  return monitors;
}

bool EmissionTimeline::wait_known_until(nanoseconds until, nanoseconds timeout) const {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, timeout, [&] {
    return !tracks_.empty() && std::all_of(tracks_.begin(), tracks_.end(), [&](const Track& track) {
      return track.horizon + track.monitor.lag >= until;
    });
  });
}

std::optional<std::vector<MonitorEmission>> EmissionTimeline::between(nanoseconds from,
                                                                      nanoseconds until) const {
  const std::lock_guard lock(mutex_);
  std::vector<MonitorEmission> emissions;
  for (const Track& track : tracks_) {
    MonitorEmission emission{.monitor = track.at(from + (until - from) / 2), .pictures = {}};
    if (!track.complete && from < track.pictures.front().scanout_start + track.monitor.lag +
                                      track.monitor.scanout + track.monitor.settle)
      return std::nullopt;
    for (size_t i = 0; i < track.pictures.size(); ++i) {
      const EmittedPicture& picture = track.pictures[i];
      const nanoseconds begins = picture.scanout_start + track.monitor.lag;
      const bool over = i + 1 < track.pictures.size() && track.pictures[i + 1].scanout_start +
                                                                 track.monitor.lag + track.monitor.scanout +
                                                                 track.monitor.settle <=
                                                             from;
      if (!over && begins < until) emission.pictures.push_back(picture);
    }
    emissions.push_back(std::move(emission));
  }
  return emissions;
}

}  // namespace glasswing
