#include "server/sessions/views.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <set>

#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

// The state of a session is the first of these that any of its views is in.
constexpr v1::SessionState kFirst[] = {v1::SESSION_STATE_CAPTURING, v1::SESSION_STATE_CREATED,
                                       v1::SESSION_STATE_SOLVING,   v1::SESSION_STATE_FAILED,
                                       v1::SESSION_STATE_PAUSED,    v1::SESSION_STATE_CAPTURED,
                                       v1::SESSION_STATE_DONE,      v1::SESSION_STATE_CANCELLED};

// These need every view; the others act on those that allow them.
constexpr v1::SessionAction kOfAll[] = {v1::SESSION_ACTION_SOLVE, v1::SESSION_ACTION_REPLICATE,
                                        v1::SESSION_ACTION_DELETE, v1::SESSION_ACTION_RETAKE};

bool is_allowed(v1::SessionAction action, const std::vector<v1::Session>& views) {
  const auto allowing = [&](const v1::Session& view) { return allows(view, action); };
  return std::ranges::find(kOfAll, action) != std::end(kOfAll) ? std::ranges::all_of(views, allowing)
                                                               : std::ranges::any_of(views, allowing);
}

// What all views say alike once, the rest with the camera's name.
template <typename Text>
std::string joined(const std::vector<v1::Session>& views, const Text& text) {
  const std::string first = text(views.front());
  if (std::ranges::all_of(views, [&](const v1::Session& view) { return text(view) == first; })) return first;
  std::string all;
  for (const v1::Session& view : views) {
    if (text(view).empty()) continue;
    all += fmt::format("{}camera {}: {}", all.empty() ? "" : "; ", view.view_camera(), text(view));
  }
  return all;
}

void add_counts(const v1::Session& view, v1::Session& sum) {
  sum.set_retaken_count(sum.retaken_count() + view.retaken_count());
  sum.set_frames_taken(sum.frames_taken() + view.frames_taken());
  sum.set_refused_count(sum.refused_count() + view.refused_count());
  sum.set_archive_bytes(sum.archive_bytes() + view.archive_bytes());
  sum.set_tile_count(sum.tile_count() + view.tile_count());
  sum.set_tiles_done(sum.tiles_done() + view.tiles_done());
  sum.set_pixel_count(sum.pixel_count() + view.pixel_count());
  sum.set_object_pixel_count(sum.object_pixel_count() + view.object_pixel_count());
  sum.set_flagged_pixel_count(sum.flagged_pixel_count() + view.flagged_pixel_count());
  sum.set_unsolved_pixel_count(sum.unsolved_pixel_count() + view.unsolved_pixel_count());
  sum.set_step_count(std::max(sum.step_count(), view.step_count()));
  // A step is proven when every camera has its frame.
  sum.set_proven_count(std::min(sum.proven_count(), view.proven_count()));
  sum.set_patch_proven_count(std::min(sum.patch_proven_count(), view.patch_proven_count()));
  sum.set_time_proven_count(std::max(sum.time_proven_count(), view.time_proven_count()));
  sum.set_capture_seconds(std::max(sum.capture_seconds(), view.capture_seconds()));
  sum.set_solve_seconds(std::max(sum.solve_seconds(), view.solve_seconds()));
  sum.set_solve_follows(sum.solve_follows() || view.solve_follows());
  sum.set_matte_ready(sum.matte_ready() && view.matte_ready());
}

// After each round of an adaptive capture, what the view knows for which its images are least enough.
void add_rounds(const std::vector<v1::Session>& views, v1::Session& sum) {
  for (const v1::Session& view : views) {
    for (int i = 0; i < view.adapted_size(); ++i) {
      const v1::AdaptedRound& found = view.adapted(i);
      if (i == sum.adapted_size()) *sum.add_adapted() = found;
      v1::AdaptedRound& least = *sum.mutable_adapted(i);
      least.set_known_share(std::min(least.known_share(), found.known_share()));
      least.set_error_db(std::min(least.error_db(), found.error_db()));
      least.set_error_px(std::max(least.error_px(), found.error_px()));
      if (!found.has_any_shape()) continue;
      if (!least.has_any_shape()) *least.mutable_any_shape() = found.any_shape();
      v1::AnyShape& shapes = *least.mutable_any_shape();
      shapes.set_share(std::max(shapes.share(), found.any_shape().share()));
      shapes.set_known_share(std::min(shapes.known_share(), found.any_shape().known_share()));
      shapes.set_error_db(std::min(shapes.error_db(), found.any_shape().error_db()));
    }
  }
}

}  // namespace

std::string view_name(const std::string& session, const std::string& camera) {
  return session + "." + camera;
}

std::vector<v1::Plan> view_plans(const v1::Plan& plan) {
  if (plan.cameras().empty()) return {plan};
  std::vector<v1::Plan> plans;
  for (const std::string& camera : plan.cameras()) {
    v1::Plan& view = plans.emplace_back(plan);
    view.clear_cameras();
    view.set_camera(camera);
  }
  return plans;
}

const std::string& capture_name(const v1::Session& session) {
  return session.view_of().empty() ? session.name() : session.view_of();
}

v1::Session sum_of(const std::vector<v1::Session>& views) {
  const v1::Session& first = views.front();
  v1::Session sum;
  sum.set_name(first.view_of());
  sum.set_created(first.created());
  sum.set_started_by(first.started_by());
  *sum.mutable_plan() = first.plan();
  sum.mutable_plan()->clear_camera();
  sum.set_method(first.method());
  *sum.mutable_options() = first.options();
  sum.set_frame_count(first.frame_count());
  *sum.mutable_rail_mm() = first.rail_mm();
  *sum.mutable_axes() = first.axes();
  sum.set_step_count(first.step_count());
  sum.set_proven_count(first.proven_count());
  sum.set_patch_proven_count(first.patch_proven_count());
  sum.set_matte_ready(true);
  sum.set_note(joined(views, [](const v1::Session& view) { return view.note(); }));
  const auto by_person = std::ranges::find_if(views, waits_for_person);  // once for all cameras
  sum.set_reason(by_person != views.end() ? by_person->reason() : joined(views, [](const v1::Session& view) {
    return view.reason();
  }));
  sum.set_warning(joined(views, [](const v1::Session& view) { return view.warning(); }));
  std::set<std::string> tags;
  for (const v1::Session& view : views) {
    sum.mutable_plan()->add_cameras(view.view_camera());
    add_counts(view, sum);
    tags.insert(view.tags().begin(), view.tags().end());
    for (v1::RigChange change : view.rig_changes()) {
      change.set_what(fmt::format("camera {}: {}", view.view_camera(), change.what()));
      *sum.add_rig_changes() = std::move(change);
    }
    v1::Session& listed = *sum.add_views() = with_allowed_actions(view);
    listed.clear_plan();
  }
  sum.mutable_tags()->Assign(tags.begin(), tags.end());
  add_rounds(views, sum);
  for (const v1::SessionState state : kFirst) {
    if (std::ranges::find(views, state, &v1::Session::state) == views.end()) continue;
    sum.set_state(state);
    break;
  }
  // So that rests_in_solve() holds where no view's capture rests.
  for (const v1::Session& view : views) {
    if (view.state() != sum.state()) continue;
    sum.set_job(view.job());
    if (!rests_in_solve(view)) break;
  }
  for (int i = v1::SessionAction_MIN; i <= v1::SessionAction_MAX; ++i) {
    const auto action = static_cast<v1::SessionAction>(i);
    if (v1::SessionAction_IsValid(i) && is_allowed(action, views)) sum.add_allowed_actions(action);
  }
  return sum;
}

absl::Status choose_view(const v1::Session& sum) {
  std::vector<std::string> names;
  for (const v1::Session& view : sum.views()) names.push_back(view.name());
  return absl::FailedPreconditionError(
      fmt::format("session \"{}\" has {} cameras; name the session of one: {}", sum.name(), names.size(),
                  fmt::join(names, ", ")));
}

}  // namespace glasswing
