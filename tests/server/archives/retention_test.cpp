// Which sessions the rules end.
#include "server/archives/retention.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/sessions/series.h"

namespace glasswing {
namespace {

using testing::ElementsAre;
const absl::Time kNow = absl::FromUnixSeconds(1'800'000'000);

StoredSession done(const std::string& name, double matte_days = 0.0) {
  StoredSession stored;
  v1::Session& session = stored.session;
  session.set_name(name);
  session.set_state(v1::SESSION_STATE_DONE);
  session.set_matte_ready(true);
  session.set_archive_address("127.0.0.1:1");
  session.set_archive_bytes(1000);
  stored.matte_bytes = 10;
  stored.solved = kNow - absl::Hours(24.0 * matte_days);
  return stored;
}

std::vector<std::string> names(const RetentionRules& rules, const std::vector<StoredSession>& sessions) {
  std::vector<std::string> names;
  for (const v1::SessionEnding& ending : endings(rules, sessions, kNow))
    names.push_back(ending.session() + (ending.frames_only() ? " frames" : ""));
  return names;
}

TEST(Retention, SeriesAreNamesWithoutTheirNumbers) {
  for (const char* name :
       {"vase-7", "vase-090", "vase-090.5", "vase_12", "vase-20261101-203000", "vase7", "vase"})
    EXPECT_EQ(series_of(name), "vase") << name;
  EXPECT_EQ(series_of("2026-11-01"), "2026-11-01");
  EXPECT_EQ(series_of("vase-"), "vase-");
  EXPECT_EQ(series_of("lab3-vase"), "lab3-vase");
  EXPECT_EQ(series_of("vase-200mm"), "vase-200mm");
}

TEST(Retention, KeepsTheNewestOfEachSeries) {
  StoredSession failed = done("vase-4"), copied = done("vase-1"), kept = done("vase-0");
  failed.session.set_state(v1::SESSION_STATE_FAILED);  // neither counts nor ends
  copied.session.add_copies()->set_address("127.0.0.1:2");
  copied.session.add_copies();  // never completed
  kept.session.set_kept(true);
  StoredSession calibration = done("vase-5");
  calibration.session.mutable_plan()->mutable_calibration();
  const std::vector<StoredSession> sessions = {
      calibration, failed, done("vase-3"), done("glass-9"), done("vase-2"), copied, kept};
  const RetentionRules rules{.newest = 2, .exempt_tags = {}};
  EXPECT_THAT(names(rules, sessions), ElementsAre("vase-1"));
  EXPECT_EQ(endings(rules, sessions, kNow)[0].bytes(), 2010);  // frames, their copy, and the matte
  EXPECT_THAT(names({.newest = 1, .exempt_tags = {}}, sessions), ElementsAre("vase-2", "vase-1"));
  EXPECT_THAT(names({}, sessions), ElementsAre());
}

TEST(Retention, ExemptTagsStayButCount) {
  StoredSession gold = done("vase-2"), oldest = done("vase-1");
  gold.session.add_tags("gold");
  oldest.session.add_tags("gold");
  EXPECT_THAT(names({.newest = 1, .exempt_tags = {"silver", "gold"}},
                    {done("vase-4"), done("vase-3"), gold, oldest, done("vase-0")}),
              ElementsAre("vase-3", "vase-0"));
}

TEST(Retention, FramesEndAfterTheirMatte) {
  StoredSession unsolved = done("a", 100.0), gone = done("b", 100.0), going = done("c", 100.0);
  unsolved.session.set_state(v1::SESSION_STATE_CAPTURED);
  gone.session.clear_archive_address();
  going.session.set_frames_deleted("2027-01-01T00:00:00Z");
  const std::vector<StoredSession> sessions = {unsolved, gone, going, done("d", 29.9), done("e", 30.0)};
  EXPECT_THAT(names({.frames_days = 30.0, .exempt_tags = {}}, sessions), ElementsAre("e frames"));
  EXPECT_EQ(endings({.frames_days = 30.0, .exempt_tags = {}}, sessions, kNow)[0].bytes(), 1000);
}

}  // namespace
}  // namespace glasswing
