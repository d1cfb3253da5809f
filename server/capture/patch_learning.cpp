#include "server/capture/patch_learning.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace glasswing {

std::vector<Step> PatchLearning::begin_showing(const std::vector<Step>& pending) {
  due_.clear();
  learning_.clear();
  queue_.clear();
  std::vector<Step> to_show;
  for (const Step& step : pending) {
    if (is_patch_learning_step(step)) due_.emplace(step.number, step.stimulus.panel());
    if (!is_held(step.number)) to_show.push_back(step);
  }
  return to_show;
}

std::vector<v1::Frame> PatchLearning::take_learning_frames(std::vector<v1::Frame> frames,
                                                           const std::function<bool(int step)>& has_left) {
  for (v1::Frame& frame : frames) {
    if (kind_of(frame.stimulus()) != StimulusKind::kPatch) {
      queue_.push_back(std::move(frame));
    } else if (due_.contains(frame.step())) {
      learning_.push_back(std::move(frame));
    }
  }
  const auto stays = std::stable_partition(learning_.begin(), learning_.end(),
                                           [&](const v1::Frame& frame) { return !has_left(frame.step()); });
  std::vector<v1::Frame> taken(std::make_move_iterator(stays), std::make_move_iterator(learning_.end()));
  learning_.erase(stays, learning_.end());
  return taken;
}

std::vector<std::string> PatchLearning::accepted_unseen() const {
  std::set<std::string> monitors = given_up_;
  for (const auto& [monitor, unseen] : unseen_) {
    if (unseen.count + 1 >= (unseen.last.dark() ? kMaxDarkAttempts : kMaxAttempts)) monitors.insert(monitor);
  }
  return {monitors.begin(), monitors.end()};
}

std::vector<std::string> PatchLearning::note_learned(const v1::LearnPatchesResponse& response) {
  for (const int step : response.waiting_steps()) {
    if (const auto due = due_.find(step); due != due_.end()) held_.insert(*due);
  }
  std::set<std::string> stored;  // monitors
  for (const v1::Frame& frame : response.frames()) {
    due_.erase(frame.step());
    stored.insert(frame.stimulus().panel());
  }
  std::vector<std::string> warnings;
  if (!response.unseen_patches().empty()) ++unseen_showings_;
  for (const v1::UnseenPatch& unseen : response.unseen_patches()) {
    const std::string& monitor = unseen.monitor();
    std::erase_if(held_, [&](const auto& step) { return step.second == monitor; });
    Unseen& known = unseen_[monitor];
    known.last = unseen;
    if (unseen.contradicts()) {
      known.count = 0;
      ++known.contradictions;
    } else if (unseen.frozen()) {
      ++known.frozen;
    } else {
      ++known.count;
    }
    if (!stored.contains(monitor) || !given_up_.insert(monitor).second) continue;
    warnings.push_back(
        fmt::format("monitor \"{}\": {}; its steps are proven by time alone", monitor, unseen.reason()));
  }
  return warnings;
}

std::optional<std::vector<v1::Frame>> PatchLearning::take_ready_frames() {
  if (due_.empty()) return std::exchange(queue_, {});
  const bool dark =
      std::ranges::any_of(unseen_, [](const auto& unseen) { return unseen.second.last.dark(); });
  if (queue_.size() < (dark ? others_ : 1) || !learning_.empty()) return std::vector<v1::Frame>();
  return std::nullopt;
}

const v1::UnseenPatch* PatchLearning::hopeless() const {
  for (const auto& [monitor, unseen] : unseen_) {
    const bool refused = unseen.count >= (unseen.last.dark() ? kMaxDarkAttempts : kMaxAttempts) &&
                         !given_up_.contains(monitor);
    if (unseen.contradictions >= kMaxAttempts || unseen.frozen >= kMaxDarkAttempts || refused)
      return &unseen.last;
  }
  return nullptr;
}

}  // namespace glasswing
