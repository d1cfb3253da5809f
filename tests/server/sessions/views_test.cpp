#include "server/sessions/views.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/sessions/session_state.h"
#include "server/sessions/session_store.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

using testing::AllOf;
using testing::HasSubstr;

v1::Session view(const std::string& camera, v1::SessionState state) {
  v1::Session view;
  view.set_name(view_name("vase", camera));
  view.set_view_of("vase");
  view.set_view_camera(camera);
  view.mutable_plan()->set_method("gaussian");
  view.mutable_plan()->set_camera(camera);
  view.set_state(state);
  view.set_step_count(10);
  view.set_proven_count(camera == "left" ? 7 : 4);
  view.set_archive_bytes(100);
  return view;
}

TEST(Views, ASumSaysWhatEveryCameraHas) {
  v1::Session left = view("left", v1::SESSION_STATE_CAPTURED),
              right = view("right", v1::SESSION_STATE_FAILED);
  right.set_reason("it sees nothing");
  const v1::Session sum = sum_of({left, right});
  EXPECT_EQ(sum.name(), "vase");
  EXPECT_EQ(sum.proven_count(), 4);
  EXPECT_EQ(sum.step_count(), 10);
  EXPECT_EQ(sum.archive_bytes(), 200);
  EXPECT_EQ(sum.state(), v1::SESSION_STATE_FAILED);
  EXPECT_EQ(sum.reason(), "camera right: it sees nothing");
  EXPECT_THAT(sum.plan().cameras(), testing::ElementsAre("left", "right"));
  // Not both can be solved, and one can be retried.
  EXPECT_FALSE(allows(sum, v1::SESSION_ACTION_SOLVE));
  EXPECT_TRUE(allows(sum, v1::SESSION_ACTION_RETRY));
  const std::vector<v1::Plan> plans = view_plans(sum.plan());
  ASSERT_EQ(plans.size(), 2u);
  EXPECT_EQ(plans[1].SerializeAsString(), right.plan().SerializeAsString());
}

TEST(Views, TheStateIsThatOfTheViewThatIsFurthestBehind) {
  using enum v1::SessionState;
  const auto state = [](v1::SessionState left, v1::SessionState right) {
    return sum_of({view("left", left), view("right", right)}).state();
  };
  EXPECT_EQ(state(SESSION_STATE_DONE, SESSION_STATE_DONE), SESSION_STATE_DONE);
  EXPECT_EQ(state(SESSION_STATE_DONE, SESSION_STATE_CAPTURED), SESSION_STATE_CAPTURED);
  EXPECT_EQ(state(SESSION_STATE_SOLVING, SESSION_STATE_FAILED), SESSION_STATE_SOLVING);
  EXPECT_EQ(state(SESSION_STATE_CAPTURING, SESSION_STATE_FAILED), SESSION_STATE_CAPTURING);
  EXPECT_EQ(state(SESSION_STATE_PAUSED, SESSION_STATE_CAPTURED), SESSION_STATE_PAUSED);
}

TEST(Views, AreStoredTogetherAndFoundByEitherName) {
  const TemporaryDirectory data;
  const std::unique_ptr<SessionStore> store = SessionStore::open(data.path()).value();
  const v1::Session left = view("left", v1::SESSION_STATE_CAPTURED),
                    right = view("right", v1::SESSION_STATE_CAPTURED);
  v1::Session other;
  other.set_name("vase.right");
  ASSERT_OK(store->edit().insert(other, ""));
  EXPECT_TRUE(absl::IsAlreadyExists(store->edit().insert({left, right}, "request")));
  EXPECT_TRUE(absl::IsNotFound(store->find_any("vase").status())) << "one of them was stored";
  ASSERT_OK(store->edit().remove("vase.right"));
  ASSERT_OK(store->edit().insert({left, right}, "request"));
  EXPECT_EQ(store->find_any("vase")->views_size(), 2);
  EXPECT_EQ(store->find_any("vase.left")->view_camera(), "left");
  EXPECT_EQ(store->find_request("request")->name(), "vase");
  EXPECT_THAT(std::string(store->find("vase").status().message()),
              AllOf(HasSubstr("has 2 cameras"), HasSubstr("vase.left, vase.right")));
  // Neither a session of that name, nor one that begins with it, becomes part of it.
  other.set_name("vase");
  EXPECT_TRUE(absl::IsAlreadyExists(store->edit().insert(other, "")));
  other.set_name("vase.top");
  ASSERT_OK(store->edit().insert(other, ""));
  EXPECT_EQ(store->find_any("vase")->views_size(), 2);
  const std::vector<v1::Session> listed = store->list({}).value();
  ASSERT_EQ(listed.size(), 2u);
  EXPECT_EQ(listed[0].name(), "vase.top");
  EXPECT_EQ(listed[1].name(), "vase");

  v1::AnnotateSessionRequest annotation;
  annotation.set_name("vase");
  annotation.add_add_tags("glass");
  ASSERT_OK(store->annotate(annotation).status());
  EXPECT_THAT(store->find("vase.right")->tags(), testing::ElementsAre("glass"));
}

}  // namespace
}  // namespace glasswing
