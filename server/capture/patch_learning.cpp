#include "server/capture/patch_learning.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace glasswing {

std::vector<Step> PatchLearning::begin_showing(const std::vector<Step>& pending) {
  due_.clear();
  queue_.clear();
  std::vector<Step> to_show;
  for (const Step& step : pending) {
    if (is_patch_learning_step(step)) due_.emplace(step.number, step.stimulus.panel());
    if (!is_held(step.number)) to_show.push_back(step);
  }
  return to_show;
}

std::vector<v1::Frame> PatchLearning::take_learning_frames(std::vector<v1::Frame> frames) {
  std::vector<v1::Frame> learning;
  for (v1::Frame& frame : frames) {
    if (kind_of(frame.stimulus()) != StimulusKind::kPatch) {
      queue_.push_back(std::move(frame));
    } else if (due_.contains(frame.step())) {
      learning.push_back(std::move(frame));
    }
  }
  return learning;
}

std::vector<std::string> PatchLearning::accepted_unseen() const {
  std::vector<std::string> monitors(given_up_.begin(), given_up_.end());
  for (const auto& [monitor, unseen] : unseen_) {
    if (unseen.count + 1 >= (unseen.dark ? kMaxDarkAttempts : kMaxAttempts)) monitors.push_back(monitor);
  }
  return monitors;
}

std::vector<std::string> PatchLearning::note_learned(const v1::LearnPatchesResponse& response) {
  const std::vector<std::string> accepted = accepted_unseen();
  for (const int step : response.waiting_steps()) {
    if (const auto due = due_.find(step); due != due_.end()) held_.insert(*due);
  }
  for (const v1::Frame& frame : response.frames()) due_.erase(frame.step());
  std::vector<std::string> warnings;
  if (!response.unseen_patches().empty()) ++unseen_showings_;
  for (const v1::UnseenPatch& unseen : response.unseen_patches()) {
    const std::string& monitor = unseen.monitor();
    std::erase_if(held_, [&](const auto& step) { return step.second == monitor; });
    ++unseen_[monitor].count;
    unseen_[monitor].dark = unseen.dark();
    if (std::ranges::find(accepted, monitor) == accepted.end() || !given_up_.insert(monitor).second) continue;
    warnings.push_back(
        fmt::format("monitor \"{}\": {}; its steps are proven by time alone", monitor, unseen.reason()));
  }
  return warnings;
}

std::optional<std::vector<v1::Frame>> PatchLearning::take_ready_frames() {
  if (due_.empty()) return std::exchange(queue_, {});
  if (queue_.empty()) return std::vector<v1::Frame>();
  return std::nullopt;
}

}  // namespace glasswing
