// The queue on a simulated rig: order, conditions, what cannot run, and restarts of everything.
#include "server/queue/capture_queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "core/base/time.h"
#include "core/image/image_file.h"
#include "tests/faults/capture/rig.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
const Caller kAnna{.client = "anna@lab3", .hold = ""};

v1::QueueWish wish(const std::string& session, int steps = 2) {
  v1::QueueWish wish;
  wish.set_session(session);
  v1::Plan& plan = *wish.mutable_plan();
  plan.set_method("alpha");
  for (int i = 0; i < steps; ++i) {
    v1::Solid& solid = *plan.add_solids();
    for (int c = 0; c < 3; ++c) solid.add_colour((i + 1.0) / (steps + 1.0));
  }
  plan.add_exposure_ms(FaultyRig::kExposure_ms);
  plan.set_hold_refreshes(4);
  return wish;
}

class CaptureQueueTest : public testing::Test {
 protected:
  CaptureQueueTest() { start(); }
  ~CaptureQueueTest() override {
    rig_ = nullptr;
    fs::remove_all(data_);
  }
  void start(const RigFaults& faults = {.name = "none"}) {
    rig_ = nullptr;
    rig_ = std::make_unique<FaultyRig>(faults, 1, 16, data_);
  }
  CaptureQueue& queue() { return rig_->server().queue(); }
  std::int64_t add(const v1::QueueWish& wish) {
    v1::AddQueueItemRequest request;
    *request.mutable_wish() = wish;
    const absl::StatusOr<v1::QueueItem> added = queue().add(request, kAnna);
    EXPECT_OK(added);
    return added.ok() ? added->number() : 0;
  }
  void run(bool running = true) {
    v1::SetQueueRequest request;
    request.set_running(running);
    EXPECT_OK(queue().set(request, kAnna));
  }
  v1::QueueItem until(std::int64_t number, const std::function<bool(const v1::QueueItem&)>& is_so) {
    const nanoseconds deadline = monotonic_now() + std::chrono::seconds(40);
    while (true) {
      const absl::StatusOr<v1::QueueItem> item = queue().find(number);
      if (item.ok() && is_so(*item)) return *item;
      if (monotonic_now() > deadline) {
        ADD_FAILURE() << item.status() << (item.ok() ? item->DebugString() : "");
        return item.value_or(v1::QueueItem());
      }
      rig_->server().sessions().wait_change(1 << 30, std::chrono::milliseconds(20));
    }
  }
  v1::QueueItem until(std::int64_t number, v1::QueueItemState state) {
    return until(number, [state](const v1::QueueItem& item) { return item.state() == state; });
  }
  v1::QueueItem ended(std::int64_t number) {
    return until(number, [](const v1::QueueItem& item) { return has_ended(item); });
  }
  std::vector<v1::Session> sessions() { return rig_->server().sessions().all_stored().value(); }
  std::string history(std::int64_t item) {
    std::string words;
    const std::vector<v1::QueueEvent> events = queue().history(item).value();
    for (const v1::QueueEvent& event : events) words = event.who() + ": " + event.what() + "\n" + words;
    return words;
  }

  const fs::path data_ = fs::path(testing::TempDir()) / ("capture_queue_test." + std::to_string(::getpid()));
  std::unique_ptr<FaultyRig> rig_;
};

TEST_F(CaptureQueueTest, NamesWhatCannotRunAndRunsTheNext) {
  std::vector<std::string> told;
  std::mutex mutex;
  queue().observe([&](const Event& event) {
    const std::lock_guard lock(mutex);
    told.push_back(std::string(event.what) + " " + event.text);
  });
  v1::QueueWish impossible = wish("b");
  impossible.mutable_plan()->add_monitors()->set_name("nowhere");
  v1::QueueWish noted = wish("a-{item}");
  noted.add_tags("night");
  noted.set_note("queued");
  const std::int64_t a = add(noted), b = add(impossible), c = add(wish("c"));
  EXPECT_EQ(queue().find(a)->state(), v1::QUEUE_ITEM_STATE_WAITING);  // the queue does not run yet
  run();
  EXPECT_EQ(ended(c).state(), v1::QUEUE_ITEM_STATE_DONE);
  EXPECT_EQ(queue().find(a)->session(), "a-1");
  const v1::QueueItem failed = queue().find(b).value();
  EXPECT_EQ(failed.state(), v1::QUEUE_ITEM_STATE_FAILED);
  EXPECT_THAT(failed.reason(), HasSubstr("nowhere"));
  ASSERT_EQ(sessions().size(), 2u);
  const v1::Session captured = rig_->server().sessions().find("a-1").value();
  EXPECT_EQ(captured.note(), "queued");
  EXPECT_EQ(captured.tags(0), "night");
  EXPECT_EQ(captured.started_by(), "anna@lab3");
  EXPECT_THAT(history(a), HasSubstr("anna@lab3: added\n: begun\n: captured as session a-1\n: done\n"));
  const std::lock_guard lock(mutex);
  ASSERT_EQ(told.size(), 2u);
  EXPECT_THAT(told[0], HasSubstr("needs-operator item 2 (b) of the queue failed"));
  EXPECT_THAT(told[1], HasSubstr("queue-done the queue is done: 2 captured; item 2 (b): "));
}

TEST_F(CaptureQueueTest, GoesOnWhenEverythingWasRestarted) {
  const std::int64_t a = add(wish("a", 60)), b = add(wish("b"));
  run();
  until(a, [&](const v1::QueueItem& item) {
    return !item.session().empty() && rig_->server().sessions().find("a")->proven_count() > 0;
  });
  start();
  EXPECT_EQ(ended(b).state(), v1::QUEUE_ITEM_STATE_DONE);
  const v1::QueueItem item = queue().find(a).value();
  EXPECT_EQ(item.state(), v1::QUEUE_ITEM_STATE_DONE);
  EXPECT_EQ(item.tries(), 1);
  ASSERT_EQ(sessions().size(), 2u);
  const v1::Session session = rig_->server().sessions().find("a").value();
  EXPECT_EQ(session.proven_count(), session.step_count());
}

TEST_F(CaptureQueueTest, WaitsForAnApprovalAndGivesUp) {
  v1::QueueWish approved = wish("a");
  approved.set_approval(true);
  v1::QueueWish forgotten = approved;
  forgotten.set_session("b");
  forgotten.set_give_up_s(0.5);
  const std::int64_t a = add(approved), b = add(forgotten);
  run();
  EXPECT_THAT(until(a, [](const v1::QueueItem& item) { return !item.waits_since().empty(); }).reason(),
              HasSubstr("glasswing queue approve 1"));
  EXPECT_EQ(queue().find(b)->waits_since(), "");  // it is not its turn
  EXPECT_OK(queue().approve(a, kAnna));
  EXPECT_EQ(ended(a).state(), v1::QUEUE_ITEM_STATE_DONE);
  EXPECT_EQ(queue().find(a)->approved_by(), "anna@lab3");
  const v1::QueueItem given_up = ended(b);
  EXPECT_EQ(given_up.state(), v1::QUEUE_ITEM_STATE_FAILED);
  EXPECT_THAT(given_up.reason(), HasSubstr("nobody came"));
  EXPECT_EQ(sessions().size(), 1u);
}

TEST_F(CaptureQueueTest, AnEditEndsTheApproval) {
  v1::QueueWish approved = wish("a");
  approved.set_approval(true);
  const std::int64_t a = add(approved);
  EXPECT_OK(queue().approve(a, kAnna));
  v1::EditQueueItemRequest edit;
  edit.set_number(a);
  *edit.mutable_wish() = approved;
  edit.mutable_wish()->clear_plan();
  const absl::StatusOr<v1::QueueItem> edited = queue().edit(edit, kAnna);
  ASSERT_OK(edited);
  EXPECT_EQ(edited->approved_by(), "");
  EXPECT_EQ(edited->wish().plan().SerializeAsString(), approved.plan().SerializeAsString());
}

TEST_F(CaptureQueueTest, RunsOneNowAndStopsAfterOne) {
  const std::int64_t a = add(wish("a")), b = add(wish("b"));
  EXPECT_OK(queue().run_now(b, kAnna));
  EXPECT_EQ(ended(b).state(), v1::QUEUE_ITEM_STATE_DONE);
  EXPECT_EQ(queue().find(a)->state(), v1::QUEUE_ITEM_STATE_WAITING);
  v1::EditQueueItemRequest edit;
  edit.set_number(a);
  *edit.mutable_wish() = wish("a");
  edit.mutable_wish()->set_pause_after(true);
  EXPECT_OK(queue().edit(edit, kAnna));
  const std::int64_t c = add(wish("c"));
  run();
  EXPECT_EQ(ended(a).state(), v1::QUEUE_ITEM_STATE_DONE);
  EXPECT_FALSE(queue().state().running());
  EXPECT_EQ(queue().find(c)->state(), v1::QUEUE_ITEM_STATE_WAITING);
  EXPECT_THAT(history(0), HasSubstr("paused: as wished after item 1"));
}

TEST_F(CaptureQueueTest, CapturesAgainWhatIsUnusual) {
  for (int i = 0; i < 6; ++i) {
    v1::QueueWish one = wish("a-{item}");
    one.set_retake_unusual(true);
    one.set_approval(i == 5);
    add(one);
  }
  run();
  until(5, [](const v1::QueueItem& item) { return has_ended(item); });
  {
    SessionStore::Edit edit = rig_->server().sessions().edit();
    v1::Session session = edit.find_any("a-3").value();
    session.set_refused_count(session.step_count());
    ASSERT_OK(edit.change(session));
  }
  start();
  EXPECT_OK(queue().approve(6, kAnna));
  ended(6);
  const v1::QueueItem again = ended(7);
  EXPECT_EQ(again.session(), "a-7");
  EXPECT_EQ(again.state(), v1::QUEUE_ITEM_STATE_DONE);
  EXPECT_FALSE(again.wish().retake_unusual());
  EXPECT_THAT(history(3), HasSubstr("unusual: "));
  EXPECT_THAT(queue().find(3)->reason(), HasSubstr("; captured again as item 7"));
  size_t unusual = 0;  // of a busy machine, others too
  for (int number = 1; number <= 6; ++number)
    unusual += queue().find(number)->reason().find("; captured again as item ") != std::string::npos ? 1 : 0;
  for (size_t i = 0; i < unusual; ++i) ended(7 + static_cast<std::int64_t>(i));
  EXPECT_EQ(sessions().size(), 6 + unusual);
}

TEST_F(CaptureQueueTest, TriesAgainByItsRule) {
  // Nothing of this rig is calibrated.
  v1::QueueWish strict = wish("a");
  strict.set_no_warnings(true);
  strict.set_retries(2);
  const std::int64_t a = add(strict), b = add(wish("b"));
  run();
  EXPECT_EQ(ended(b).state(), v1::QUEUE_ITEM_STATE_DONE);
  const v1::QueueItem failed = queue().find(a).value();
  EXPECT_EQ(failed.state(), v1::QUEUE_ITEM_STATE_FAILED);
  EXPECT_EQ(failed.tries(), 3);
  EXPECT_THAT(failed.reason(), HasSubstr("(tried 3 times)"));
  EXPECT_EQ(sessions().size(), 1u);
}

TEST_F(CaptureQueueTest, WaitsForThePersonWhoPausedItsSession) {
  const std::int64_t a = add(wish("a", 60)), b = add(wish("b"));
  run();
  until(a, [&](const v1::QueueItem& item) {
    return !item.session().empty() && rig_->server().sessions().find("a")->proven_count() > 0;
  });
  EXPECT_OK(rig_->server().control().pause("a", kAnna));
  EXPECT_THAT(until(a, v1::QUEUE_ITEM_STATE_PAUSED).reason(), HasSubstr("paused on request"));
  EXPECT_EQ(queue().find(b)->state(), v1::QUEUE_ITEM_STATE_WAITING);
  start();  // a restart does not answer for the person
  EXPECT_EQ(queue().find(a)->state(), v1::QUEUE_ITEM_STATE_PAUSED);
  v1::ResumeSessionRequest resume;
  resume.set_name("a");
  EXPECT_OK(rig_->server().control().resume(resume, kAnna));
  EXPECT_EQ(ended(b).state(), v1::QUEUE_ITEM_STATE_DONE);
  EXPECT_EQ(queue().find(a)->state(), v1::QUEUE_ITEM_STATE_DONE);
}

std::string upload(ImageFiles& images, std::uint16_t code) {
  Image16 picture(4, 3);
  std::ranges::fill(picture.samples, code);
  ImageFiles::Upload upload = images.begin().value();
  EXPECT_OK(upload.add(encode_png16(picture).value()));
  return upload.finish().value();
}

TEST_F(CaptureQueueTest, KeepsTheImagesOfItsItems) {
  const auto images = [this]() -> ImageFiles& { return rig_->server().images(); };
  v1::QueueWish shown = wish("a"), missing = wish("b");
  shown.set_solve(true);
  const std::string photo = upload(images(), 1), background = upload(images(), 2),
                    newer = upload(images(), 3);
  shown.mutable_plan()->add_photos()->set_file(photo);
  (*shown.mutable_background())["back"] = background;
  const std::int64_t a = add(shown);
  missing.mutable_plan()->add_photos()->set_file("xxh3-none");
  v1::AddQueueItemRequest request;
  *request.mutable_wish() = missing;
  EXPECT_THAT(std::string(queue().add(request, kAnna).status().message()), HasSubstr("xxh3-none"));
  start();  // nor does a restart lose them
  EXPECT_TRUE(images().has(photo) && images().has(background));
  images().release({photo, background}, std::set<std::string>());  // by a session that is deleted
  EXPECT_TRUE(images().has(photo) && images().has(background));
  v1::EditQueueItemRequest edit;
  edit.set_number(a);
  *edit.mutable_wish() = shown;
  (*edit.mutable_wish()->mutable_background())["back"] = newer;
  EXPECT_OK(queue().edit(edit, kAnna));
  EXPECT_TRUE(images().has(photo) && images().has(newer));
  EXPECT_FALSE(images().has(background));
  EXPECT_OK(queue().remove(a, kAnna));
  EXPECT_FALSE(images().has(photo) || images().has(newer));
}

TEST_F(CaptureQueueTest, WaitsWhileAnotherHasTheRig) {
  const absl::StatusOr<RigLock::Hold> hold =
      rig_->server().rig_lock().hold({.client = "bob", .hold = ""}, "series");
  ASSERT_OK(hold);
  const std::int64_t a = add(wish("a"));
  run();
  EXPECT_THAT(until(a, [](const v1::QueueItem& item) { return !item.reason().empty(); }).reason(),
              HasSubstr("series, of bob"));
  EXPECT_OK(rig_->server().rig_lock().release({.client = "bob", .hold = hold->get_deleter().token}));
  EXPECT_EQ(ended(a).state(), v1::QUEUE_ITEM_STATE_DONE);
}

TEST_F(CaptureQueueTest, RefusesChangesOfWhatRuns) {
  const std::int64_t a = add(wish("a", 60)), b = add(wish("b"));
  run();
  until(a, [&](const v1::QueueItem& item) { return !item.session().empty(); });
  v1::MoveQueueItemRequest move;
  move.set_number(b);
  move.set_before(a);
  EXPECT_TRUE(absl::IsFailedPrecondition(queue().move(move, kAnna).status()));
  EXPECT_TRUE(absl::IsFailedPrecondition(queue().approve(a, kAnna).status()));
  const absl::Status removed = queue().remove(a, kAnna);
  EXPECT_TRUE(absl::IsFailedPrecondition(removed));
  EXPECT_THAT(std::string(removed.message()), HasSubstr("glasswing cancel a"));
  EXPECT_OK(queue().remove(b, kAnna));
  EXPECT_OK(rig_->server().control().cancel("a", kAnna));
  EXPECT_THAT(ended(a).reason(), HasSubstr("cancelled"));
}

std::string rfc3339(absl::Time time) {
  return absl::FormatTime(absl::RFC3339_sec, time, absl::UTCTimeZone());
}

TEST_F(CaptureQueueTest, KeepsTheRigFreeForPeople) {
  v1::HoldQueueRequest request;
  request.set_from(rfc3339(absl::Now() + absl::Seconds(1)));  // no capture ends before
  request.set_to(rfc3339(absl::Now() + absl::Hours(1)));
  request.set_why("visitors");
  const absl::StatusOr<v1::QueueHold> hold = queue().hold(request, kAnna);
  ASSERT_OK(hold);
  request.set_from(rfc3339(absl::Now() + absl::Hours(10)));  // a capture ends long before
  request.set_to(rfc3339(absl::Now() + absl::Hours(11)));
  ASSERT_OK(queue().hold(request, kAnna));
  const std::int64_t a = add(wish("a", 60)), b = add(wish("b"));
  run();
  EXPECT_THAT(until(a, [](const v1::QueueItem& item) { return !item.reason().empty(); }).reason(),
              HasSubstr("the rig is held for people: visitors"));
  EXPECT_OK(queue().run_now(b, kAnna));  // by a person
  EXPECT_EQ(ended(b).state(), v1::QUEUE_ITEM_STATE_DONE);
  start();
  ASSERT_EQ(queue().state().holds_size(), 2);
  EXPECT_EQ(queue().find(a)->state(), v1::QUEUE_ITEM_STATE_WAITING);
  EXPECT_TRUE(queue().state().running());
  EXPECT_OK(queue().release(hold->number(), kAnna));
  EXPECT_EQ(ended(a).state(), v1::QUEUE_ITEM_STATE_DONE);
  EXPECT_TRUE(absl::IsNotFound(queue().release(hold->number(), kAnna)));
  EXPECT_THAT(history(0), HasSubstr("anna@lab3: held from "));
  request.set_to(request.from());
  EXPECT_TRUE(absl::IsInvalidArgument(queue().hold(request, kAnna).status()));
}

TEST_F(CaptureQueueTest, AsksAPersonWhereTheCaptureBeforeSawTheRigChange) {
  v1::QueueWish steady = wish("b");
  steady.set_steady(true);
  const std::int64_t a = add(wish("a"));
  run();
  EXPECT_EQ(ended(a).state(), v1::QUEUE_ITEM_STATE_DONE);
  {
    SessionStore::Edit edit = rig_->server().sessions().edit();
    v1::Session session = edit.find("a").value();
    session.add_rig_changes()->set_what("the table was touched");
    ASSERT_OK(edit.change(session));
  }
  const std::int64_t b = add(steady);
  steady.set_session("c");
  const std::int64_t c = add(steady);
  EXPECT_THAT(until(b, [](const v1::QueueItem& item) { return !item.waits_since().empty(); }).reason(),
              HasSubstr("the rig changed in session a: the table was touched"));
  EXPECT_OK(queue().approve(b, kAnna));
  EXPECT_EQ(ended(c).state(), v1::QUEUE_ITEM_STATE_DONE);  // nothing changed in b
  EXPECT_EQ(queue().find(c)->approved_by(), "");
}

TEST_F(CaptureQueueTest, WarmsUpTheMonitors) {
  v1::QueueWish warmed = wish("a");
  warmed.set_warm_up_s(2.0);
  const std::int64_t a = add(warmed);
  const nanoseconds began = monotonic_now();
  run();
  EXPECT_THAT(until(a, [](const v1::QueueItem& item) { return !item.reason().empty(); }).reason(),
              HasSubstr("warms up"));
  EXPECT_EQ(rig_->server().rig_lock().holder()->what(), "queue item 1 (warming up)");
  EXPECT_EQ(ended(a).state(), v1::QUEUE_ITEM_STATE_DONE) << queue().find(a)->reason();
  EXPECT_GE(monotonic_now() - began, std::chrono::seconds(2));
}

TEST_F(CaptureQueueTest, TestsTheRigBeforeAnItem) {
  v1::QueueWish tested = wish("a");
  tested.set_doctor(true);
  const std::int64_t a = add(tested);
  run();
  EXPECT_EQ(ended(a).state(), v1::QUEUE_ITEM_STATE_DONE) << queue().find(a)->reason();
  start({.name = "no frames", .drop = 1.0});
  tested.set_session("b");
  const std::int64_t b = add(tested);
  EXPECT_THAT(ended(b).reason(), HasSubstr("the rig's self-test: "));
  EXPECT_TRUE(absl::IsNotFound(rig_->server().sessions().find("b").status()));
}

TEST_F(CaptureQueueTest, TellsSessionsWhereMonitorsStand) {
  v1::QueueWish placed = wish("a"), nowhere = wish("b");
  (*placed.mutable_rail_mm())["back"] = 200.0;
  (*nowhere.mutable_rail_mm())["front"] = 200.0;
  const std::int64_t a = add(placed), b = add(nowhere);
  run();
  EXPECT_THAT(ended(b).reason(), HasSubstr("front"));
  EXPECT_EQ(queue().find(a)->state(), v1::QUEUE_ITEM_STATE_DONE);
  EXPECT_EQ(rig_->server().sessions().find("a")->rail_mm().at("back"), 200.0);
}

TEST_F(CaptureQueueTest, MovesMonitorsOnRails) {
  start({.name = "rail", .rail = true});
  v1::QueueWish placed = wish("a"), beyond = wish("b");
  (*placed.mutable_rail_mm())["back"] = 200.0;
  (*beyond.mutable_rail_mm())["back"] = 301.0;
  const std::int64_t a = add(placed), b = add(beyond), c = add(wish("c"));
  run();
  EXPECT_EQ(ended(c).state(), v1::QUEUE_ITEM_STATE_DONE);
  EXPECT_EQ(queue().find(a)->state(), v1::QUEUE_ITEM_STATE_DONE) << queue().find(a)->reason();
  EXPECT_THAT(queue().find(b)->reason(), HasSubstr("301"));
  EXPECT_EQ(rig_->server().sessions().find("a")->rail_mm().at("back"), 200.0);
  EXPECT_EQ(rig_->server().sessions().find("c")->rail_mm().at("back"), 200.0);  // it stays there
}

}  // namespace
}  // namespace glasswing
