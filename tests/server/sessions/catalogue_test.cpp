#include "server/sessions/catalogue.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <map>
#include <set>

#include "core/file/file.h"
#include "server/storage/database.h"
#include "tests/core/file/flipped.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

TEST(Catalogue, SessionsOutliveTheProcess) {
  const fs::path path =
      fs::path(testing::TempDir()) / ("catalogue_test." + std::to_string(::getpid()) + ".sqlite");
  v1::Session session;
  session.set_name("a");
  session.mutable_plan()->set_method("gaussian");
  {
    const auto catalogue = Catalogue::open(path).value();
    ASSERT_OK(catalogue->insert(session, "request-1"));
    const absl::Status again = catalogue->insert(session, "request-2");
    EXPECT_TRUE(absl::IsAlreadyExists(again)) << again;
    session.set_state(v1::SESSION_STATE_CAPTURING);
    ASSERT_OK(catalogue->update(session));
    v1::Session second;
    second.set_name("b");
    ASSERT_OK(catalogue->insert(second, ""));
  }
  const auto catalogue = Catalogue::open(path).value();
  EXPECT_EQ(catalogue->find("a").value().SerializeAsString(), session.SerializeAsString());
  EXPECT_EQ(catalogue->find_request("request-1").value().name(), "a");
  EXPECT_TRUE(absl::IsNotFound(catalogue->find_request("").status()));  // an empty id names no request
  EXPECT_TRUE(absl::IsNotFound(catalogue->find("c").status()));
  EXPECT_EQ(catalogue->list().value().front().name(), "b");  // newest first
  for (const char* suffix : {"", "-wal", "-shm"}) fs::remove(path.string() + suffix);
}

// A catalogue in the running test's own file.
class CatalogueTest : public testing::Test {
 protected:
  CatalogueTest() { reopen(); }
  ~CatalogueTest() override {
    for (const char* suffix : {"", "-wal", "-shm"}) fs::remove(path_.string() + suffix);
  }
  void reopen() {
    catalogue_ = nullptr;
    catalogue_ = Catalogue::open(path_).value();
  }

  const fs::path path_ = fs::path(testing::TempDir()) /
                         (std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) +
                          std::to_string(::getpid()));
  std::unique_ptr<Catalogue> catalogue_;
};

TEST_F(CatalogueTest, NoByteIsAlteredUnnoticed) {
  for (int i = 0; i < 20; ++i) {
    v1::Session session;
    session.set_name("session-" + std::to_string(i));
    session.set_reason(std::string(200, static_cast<char>('a' + i)));
    ASSERT_OK(catalogue_->insert(session, std::to_string(i)));
    ASSERT_OK(catalogue_->keep_finished(session));
  }
  v1::AnnotateSessionRequest request;
  request.set_name("session-7");
  request.set_note("of glass");
  ASSERT_OK(catalogue_->annotate(request));
  ASSERT_OK(catalogue_->remove("session-3"));
  const auto all = [](Catalogue& catalogue) -> absl::StatusOr<std::string> {
    const absl::StatusOr<std::vector<v1::Session>> sessions = catalogue.list();
    if (!sessions.ok()) return sessions.status();
    std::string text;
    for (const v1::Session& session : *sessions) {
      if (session.state() == v1::SESSION_STATE_DAMAGED) return absl::DataLossError(session.reason());
      const absl::StatusOr<v1::Session> finished = catalogue.finished(session.name());
      const absl::StatusOr<v1::Session> found = catalogue.find(session.name());
      if (!finished.ok()) return finished.status();
      if (!found.ok()) return found.status();
      text += session.SerializeAsString() + finished->SerializeAsString() + found->SerializeAsString();
    }
    return text;
  };
  const std::string known = all(*catalogue_).value();
  catalogue_ = nullptr;  // SQLite merges its log into the file
  const std::string bytes = read_file(path_).value();
  int refused = 0;
  const auto look = [&](const std::string& altered, size_t at) {
    for (const char* suffix : {"-wal", "-shm"}) fs::remove(path_.string() + suffix);
    std::ofstream(path_, std::ios::binary) << altered;
    const absl::StatusOr<std::unique_ptr<Catalogue>> catalogue = Catalogue::open(path_);
    const absl::StatusOr<std::string> now = catalogue.ok() ? all(**catalogue) : catalogue.status();
    refused += !now.ok();
    if (now.ok()) {
      EXPECT_EQ(*now, known) << "byte " << at << " of " << bytes.size();
    }
  };
  for_each_flip(bytes.substr(0, 100), 0, 1, [&](const std::string& header, size_t at) {  // SQLite's own
    look(header + bytes.substr(100), at);
  });
  for_each_flip(bytes, 100, 53, look);
  EXPECT_GT(refused, 0);
  std::ofstream(path_, std::ios::binary) << bytes;
}

TEST_F(CatalogueTest, ADamagedRecordIsListedAndTheOthersAreServed) {
  for (const char* name : {"a", "b", "c"}) {
    v1::Session session;
    session.set_name(name);
    ASSERT_OK(catalogue_->insert(session, ""));
  }
  catalogue_ = nullptr;
  const std::string bytes = read_file(path_).value();
  // A flipped bit, and bytes that are no name.
  for (const std::string& damage : {std::string("session = x'ff'"), std::string("name = x'ff00' || 'b'")}) {
    ASSERT_OK(Database::open(path_)->run("DROP TRIGGER sessions_updated; UPDATE sessions SET " + damage +
                                         " WHERE name = 'b'"));
    reopen();
    const std::vector<v1::Session> listed = catalogue_->list().value();
    ASSERT_EQ(listed.size(), 3u);
    EXPECT_EQ(listed[0].name(), "c");
    EXPECT_EQ(listed[2].name(), "a");
    EXPECT_EQ(listed[1].state(), v1::SESSION_STATE_DAMAGED);
    for (const std::string& word : {path_.string(), listed[1].name(), std::string("fsck --repair")})
      EXPECT_NE(listed[1].reason().find(word), std::string::npos) << listed[1].reason();
    EXPECT_TRUE(std::ranges::all_of(listed[1].name(), [](char c) { return c > ' ' && c <= '~'; }));
    const absl::Status damaged = catalogue_->find("b").status();
    EXPECT_TRUE(absl::IsDataLoss(damaged) || absl::IsNotFound(damaged)) << damaged;
    EXPECT_OK(catalogue_->find("a"));
    v1::Session next;
    next.set_name("d");
    EXPECT_OK(catalogue_->insert(next, ""));
    catalogue_ = nullptr;
    for (const char* suffix : {"-wal", "-shm"}) fs::remove(path_.string() + suffix);
    ASSERT_OK(write_file_durably(path_, bytes));
  }
}

TEST_F(CatalogueTest, AnIndexThatContradictsItsRowsIsMadeAgain) {
  for (const char* name : {"some-session", "b"}) {
    v1::Session session;
    session.set_name(name);
    ASSERT_OK(catalogue_->insert(session, ""));
  }
  catalogue_ = nullptr;
  std::string bytes = read_file(path_).value();
  // The row has the name twice, in its column and in the session; the index is the third.
  int altered = 0;
  for (size_t at = bytes.find("some-session"); at != std::string::npos;
       at = bytes.find("some-session", at + 1)) {
    std::string one = bytes;
    one[at] = 'S';
    for (const char* suffix : {"-wal", "-shm"}) fs::remove(path_.string() + suffix);
    ASSERT_OK(write_file_durably(path_, one));
    const absl::StatusOr<std::unique_ptr<Catalogue>> opened = Catalogue::open(path_);
    ASSERT_OK(opened);
    EXPECT_EQ((*opened)->list()->size(), 2u);
    EXPECT_OK((*opened)->find("b"));
    ++altered;
  }
  EXPECT_EQ(altered, 3);
}

TEST_F(CatalogueTest, NotesAndTagsAreKeptWhateverRuns) {
  v1::Session running;
  running.set_name("a");
  ASSERT_OK(catalogue_->insert(running, ""));
  v1::AnnotateSessionRequest request;
  request.set_name("a");
  request.set_note("handle\nto the left");
  for (const char* tag : {"vases", "lab3", "vases"}) request.add_add_tags(tag);
  const absl::StatusOr<v1::Session> annotated = catalogue_->annotate(request);
  ASSERT_OK(annotated);
  EXPECT_EQ(annotated->ShortDebugString().find("vases"), annotated->ShortDebugString().rfind("vases"));
  // A capture that began before does not know them.
  running.set_proven_count(7);
  ASSERT_OK(catalogue_->update(running));
  reopen();
  v1::Session found = catalogue_->find("a").value();
  EXPECT_EQ(found.proven_count(), 7);
  EXPECT_EQ(found.note(), request.note());
  EXPECT_EQ(std::vector<std::string>(found.tags().begin(), found.tags().end()),
            (std::vector<std::string>{"lab3", "vases"}));
  EXPECT_EQ(catalogue_->list().value()[0].note(), request.note());

  request.clear_note();
  request.clear_add_tags();
  for (const char* tag : {"vases", "never there"}) request.add_remove_tags(tag);
  found = catalogue_->annotate(request).value();
  EXPECT_EQ(found.note(), "handle\nto the left");
  EXPECT_EQ(found.tags_size(), 1);

  request.add_add_tags("no tag");
  EXPECT_TRUE(absl::IsInvalidArgument(catalogue_->annotate(request).status()));
  request.clear_add_tags();
  request.set_note(std::string(kMaxNoteBytes + 1, 'x'));
  EXPECT_TRUE(absl::IsInvalidArgument(catalogue_->annotate(request).status()));
  request.set_name("b");
  request.clear_note();
  EXPECT_TRUE(absl::IsNotFound(catalogue_->annotate(request).status()));
}

TEST_F(CatalogueTest, TheFinishedSessionIsKeptBesideTheOneThatGoesOn) {
  v1::Session session;
  session.set_name("a");
  session.set_method("gaussian");
  ASSERT_OK(catalogue_->insert(session, ""));
  EXPECT_TRUE(absl::IsNotFound(catalogue_->finished("a").status()));
  ASSERT_OK(catalogue_->keep_finished(session));
  session.set_method("alpha");
  ASSERT_OK(catalogue_->update(session));
  reopen();
  EXPECT_EQ(catalogue_->finished("a")->method(), "gaussian");
  EXPECT_EQ(catalogue_->find("a")->method(), "alpha");
  ASSERT_OK(catalogue_->drop_finished("a"));
  EXPECT_TRUE(absl::IsNotFound(catalogue_->finished("a").status()));
}

TEST_F(CatalogueTest, FindsSeriesByTheirNames) {
  for (const char* name : {"vas", "vase", "vase-1", "vase.left", "vases", "vat"}) {
    v1::Session session;
    session.set_name(name);
    if (session.name() == "vases") session.set_deleted("2026-11-05T12:00:00Z");
    ASSERT_OK(catalogue_->insert(session, ""));
    ASSERT_OK(catalogue_->keep_quality(name, {.poor_fit = 0.5, .error_px = 0.1, .width_px = 1.0 / 3.0}));
  }
  ASSERT_OK(catalogue_->remove("vase-1"));
  reopen();
  std::set<std::string> names;
  const std::vector<v1::Session> found = catalogue_->named("vase").value();
  for (const v1::Session& session : found) names.insert(session.name());
  EXPECT_EQ(names, (std::set<std::string>{"vase", "vase.left"}));
  const std::map<std::string, MatteQuality> qualities = catalogue_->qualities("vase").value();
  EXPECT_EQ(qualities.size(), 3u);  // also of the trash
  EXPECT_EQ(qualities.count("vase-1"), 0u);
  EXPECT_NEAR(qualities.at("vase").width_px, 1.0 / 3.0, 1e-12);
}

TEST(SessionSearch, EveryConditionHasToHold) {
  v1::Session session;
  session.set_name("vase-3");
  session.set_note("Handle to the left");
  session.set_reason("the camera went away");
  session.add_tags("lab3");
  session.add_tags("vases");
  session.set_state(v1::SESSION_STATE_PAUSED);
  session.set_created("2026-11-05T12:00:00Z");
  const auto found = [&](const std::function<void(v1::ListSessionsRequest&)>& ask) {
    v1::ListSessionsRequest request;
    ask(request);
    return matches(session, request).value();
  };
  EXPECT_TRUE(found([](auto&) {}));
  for (const char* text : {"VASE", "handle TO", "Lab3", "went away"})
    EXPECT_TRUE(found([&](auto& request) { request.set_text(text); })) << text;
  EXPECT_FALSE(found([](auto& request) { request.set_text("bowl"); }));
  EXPECT_TRUE(found([](auto& request) { request.add_tags("vases"); }));
  EXPECT_FALSE(found([](auto& request) {
    request.add_tags("vases");
    request.add_tags("bowls");
  }));
  EXPECT_FALSE(found([](auto& request) { request.add_tags("vase"); })) << "tags are whole";
  EXPECT_TRUE(found([](auto& request) {
    request.add_states(v1::SESSION_STATE_DONE);
    request.add_states(v1::SESSION_STATE_PAUSED);
  }));
  EXPECT_FALSE(found([](auto& request) { request.add_states(v1::SESSION_STATE_DONE); }));
  EXPECT_TRUE(found([](auto& request) {
    request.set_created_from("2026-11-05T12:00:00Z");
    request.set_created_before("2026-11-05T12:00:01Z");
  }));
  EXPECT_FALSE(found([](auto& request) { request.set_created_before("2026-11-05T12:00:00Z"); }));
  // The same moment, in another time zone.
  EXPECT_FALSE(found([](auto& request) { request.set_created_from("2026-11-05T13:00:01+01:00"); }));
  EXPECT_TRUE(found([](auto& request) { request.set_created_from("2026-11-05T13:00:00+01:00"); }));
  v1::ListSessionsRequest bad;
  bad.set_created_from("yesterday");
  EXPECT_TRUE(absl::IsInvalidArgument(matches(session, bad).status()));
}

TEST(Catalogue, ADamagedFileIsNamedNotUsed) {
  const fs::path path =
      fs::path(testing::TempDir()) / ("catalogue_bad." + std::to_string(::getpid()) + ".sqlite");
  std::FILE* file = std::fopen(path.c_str(), "w");
  std::fputs(
      "this is no database, and long enough to be one with a header of a hundred bytes, which it has not",
      file);
  std::fclose(file);
  EXPECT_FALSE(Catalogue::open(path).ok());
  fs::remove(path);
}

}  // namespace
}  // namespace glasswing
