#include "server/queue/queue_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/storage/row_checksums.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;

v1::QueueEvent event(const std::string& what, std::int64_t item = 0) {
  v1::QueueEvent event;
  event.set_what(what);
  event.set_item(item);
  return event;
}

class QueueStoreTest : public testing::Test {
 protected:
  QueueStoreTest() {
    fs::create_directories(data_);
    reopen();
  }
  ~QueueStoreTest() override { fs::remove_all(data_); }
  void reopen() {
    store_ = nullptr;
    store_ = QueueStore::open(data_, problems_).value();
  }
  std::int64_t add(const std::string& session, const std::string& request_id = "") {
    v1::QueueItem item;
    item.set_state(v1::QUEUE_ITEM_STATE_WAITING);
    item.mutable_wish()->set_session(session);
    const absl::StatusOr<v1::QueueItem> added = store_->add(item, request_id, event("added"));
    EXPECT_OK(added);
    return added.ok() ? added->number() : 0;
  }
  std::vector<std::string> sessions() const {
    std::vector<std::string> names;
    for (const v1::QueueItem& item : store_->items()) names.push_back(item.wish().session());
    return names;
  }
  std::vector<std::string> history(std::int64_t item = 0) {
    std::vector<std::string> words;
    const std::vector<v1::QueueEvent> events = store_->history(item, 0, 100).value();
    for (const v1::QueueEvent& each : events)
      words.push_back(std::to_string(each.item()) + " " + each.what());
    return words;
  }

  const fs::path data_ = fs::path(testing::TempDir()) / ("queue_store_test." + std::to_string(::getpid()));
  Problems problems_;
  std::unique_ptr<QueueStore> store_;
};

TEST_F(QueueStoreTest, OutlivesTheProcess) {
  const std::int64_t a = add("a"), b = add("b", "request-b"), c = add("c");
  EXPECT_EQ(add("b", "request-b"), b);  // the call is repeated
  ASSERT_OK(store_->move(c, a, event("moved", c)));
  v1::QueueItem item = store_->find(b).value();
  item.set_reason("waits");
  ASSERT_OK(store_->change(item, std::nullopt));
  v1::QueueState state;
  state.set_running(true);
  ASSERT_OK(store_->set_state(state, event("started")));
  reopen();
  EXPECT_THAT(sessions(), ElementsAre("c", "a", "b"));
  EXPECT_EQ(store_->find(b).value().reason(), "waits");
  EXPECT_TRUE(store_->state().running());
  EXPECT_EQ(add("b", "request-b"), b);
  EXPECT_THAT(history(), ElementsAre("0 started", "3 moved", "3 added", "2 added", "1 added"));
  EXPECT_THAT(history(c), ElementsAre("3 moved", "3 added"));
}

TEST_F(QueueStoreTest, NeverUsesANumberTwice) {
  const std::int64_t a = add("a");
  ASSERT_OK(store_->remove(a, event("removed", a)));
  reopen();
  EXPECT_GT(add("b"), a);
  EXPECT_TRUE(absl::IsNotFound(store_->find(a).status()));
  EXPECT_THAT(history(a), ElementsAre("1 removed", "1 added"));
}

TEST_F(QueueStoreTest, MovesAnItemToAnyPlace) {
  const std::int64_t a = add("a"), b = add("b"), c = add("c");
  ASSERT_OK(store_->move(a, 0, event("moved", a)));
  EXPECT_THAT(sessions(), ElementsAre("b", "c", "a"));
  ASSERT_OK(store_->move(a, c, event("moved", a)));
  EXPECT_THAT(sessions(), ElementsAre("b", "a", "c"));
  ASSERT_OK(store_->move(b, b, event("moved", b)));
  EXPECT_THAT(sessions(), ElementsAre("b", "a", "c"));
  EXPECT_TRUE(absl::IsNotFound(store_->move(a, 99, event("moved", a))));
  EXPECT_TRUE(absl::IsNotFound(store_->move(99, a, event("moved", 99))));
  EXPECT_EQ(add("d"), 4);
  reopen();
  EXPECT_THAT(sessions(), ElementsAre("b", "a", "c", "d"));
}

TEST_F(QueueStoreTest, SetsADamagedFileAside) {
  add("a");
  {
    Database database = Database::open(data_ / kQueueFile).value();
    ASSERT_OK(database.run("DROP TRIGGER items_updated; UPDATE items SET place = 7"));
  }
  store_ = nullptr;
  reopen();
  EXPECT_TRUE(store_->items().empty());
  ASSERT_EQ(problems_.all().size(), 1u);
  EXPECT_NE(problems_.all()[0].find("must be added again"), std::string::npos) << problems_.all()[0];
}

TEST_F(QueueStoreTest, RefusesMoreThanItsMaximum) {
  for (int i = 0; i < kMaxQueueItems; ++i) add(std::to_string(i));
  v1::QueueItem item;
  item.set_state(v1::QUEUE_ITEM_STATE_WAITING);
  EXPECT_TRUE(absl::IsResourceExhausted(store_->add(item, "", event("added")).status()));
  // One that has ended makes room, and stays listed.
  v1::QueueItem first = store_->items()[0];
  first.set_state(v1::QUEUE_ITEM_STATE_DONE);
  ASSERT_OK(store_->change(first, std::nullopt));
  add("more");
  EXPECT_EQ(store_->items().size(), 1u + kMaxQueueItems);
}

}  // namespace
}  // namespace glasswing
