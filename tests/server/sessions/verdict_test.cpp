// Outliers of a series.
#include "server/sessions/verdict.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace glasswing {
namespace {

using testing::HasSubstr;

// With 1000 pixels, 400 of the object.
v1::Session session(int number, int flagged, const std::string& method = "gaussian") {
  v1::Session session;
  session.set_name("vase-" + std::to_string(number));
  session.set_state(v1::SESSION_STATE_DONE);
  session.set_matte_ready(true);
  session.mutable_plan()->set_method(method);
  session.set_step_count(100);
  session.set_frames_taken(300);
  session.set_capture_seconds(10.0);
  session.set_pixel_count(1000);
  session.set_object_pixel_count(400);
  session.set_flagged_pixel_count(flagged);
  return session;
}

// Flagged: 1 % to 3 % of the object; the median 2 %, the median distance from it 0.5 %.
std::vector<v1::Session> series() {
  return {session(1, 4), session(2, 6), session(3, 8), session(4, 10), session(5, 12)};
}

TEST(Verdict, AnOutlierIsFiveSpreadsFromTheMedian) {
  const std::vector<v1::Session> others = series();
  const Verdicts verdicts(others);
  // The threshold: 2 % + 5 x 1.4826 x 0.5 % = 5.7 %, 22.8 pixels.
  EXPECT_FALSE(verdicts.of(session(6, 22)).outlier());
  const v1::SessionVerdict verdict = verdicts.of(session(6, 23));
  EXPECT_TRUE(verdict.outlier());
  EXPECT_EQ(verdict.others(), 5);
  EXPECT_EQ(verdict.text(), "5.75 % of the object's pixels flagged, usually 2 %");
  EXPECT_FALSE(verdicts.of(session(6, 0)).outlier());  // better than usual
}

TEST(Verdict, JudgesTheMattesErrorAndBlur) {
  const std::vector<v1::Session> others = series();
  std::map<std::string, MatteQuality> qualities;
  for (const v1::Session& other : others)
    qualities[other.name()] = {.poor_fit = 0.01, .error_px = 0.1, .width_px = 2.0};
  qualities["vase-6"] = {.poor_fit = 0.5, .error_px = 0.3, .width_px = 2.2};
  EXPECT_EQ(Verdicts(others, qualities).of(session(6, 8)).text(),
            "50 % of the object's pixels fitted worse than their noise, usually 1 %; 0.3 px of predicted "
            "error of the "
            "footprints, usually 0.1");
  qualities["vase-6"] = {.poor_fit = 0.01, .error_px = 0.0, .width_px = 2.3};  // out of focus, error unknown
  EXPECT_EQ(Verdicts(others, qualities).of(session(6, 8)).text(),
            "2.3 px of blur of the footprints, usually 2");
  v1::Session captured = session(6, 0);
  captured.set_state(v1::SESSION_STATE_CAPTURED);  // again: that was its former matte
  EXPECT_FALSE(Verdicts(others, qualities).of(captured).outlier());
}

TEST(Verdict, LittleOfTheObjectIsAsUnusualAsMuch) {
  const std::vector<v1::Session> others = series();
  for (const int pixels : {370, 430}) {
    v1::Session moved = session(6, 8);
    moved.set_object_pixel_count(pixels);
    EXPECT_THAT(Verdicts(others).of(moved).text(), HasSubstr("of the pixels show the object")) << pixels;
  }
}

TEST(Verdict, ComparesWithTheSamePlanAlone) {
  std::vector<v1::Session> others = series();
  for (v1::Session& other : others) other.mutable_plan()->set_method("alpha");
  const v1::SessionVerdict verdict = Verdicts(others).of(session(6, 400));
  EXPECT_FALSE(verdict.outlier());
  EXPECT_EQ(verdict.others(), 0);
  EXPECT_THAT(verdict.text(), HasSubstr("too few others"));
}

TEST(Verdict, NeedsEnoughOthersAndNotItself) {
  std::vector<v1::Session> others = {session(1, 4), session(2, 6), session(3, 8), session(6, 400)};
  EXPECT_FALSE(Verdicts(others).of(others.back()).outlier());
  others.push_back(session(4, 10));
  EXPECT_TRUE(Verdicts(others).of(others[3]).outlier());
}

TEST(Verdict, CapturesAreComparedBeforeTheyAreSolved) {
  const std::vector<v1::Session> others = series();
  v1::Session captured = session(6, 0);
  captured.set_state(v1::SESSION_STATE_CAPTURED);
  captured.set_matte_ready(false);
  captured.set_retaken_count(6);
  captured.add_rig_changes();
  const v1::SessionVerdict verdict = Verdicts(others).of(captured);
  EXPECT_EQ(verdict.text(), "6 % of the steps shown again, usually 0 %; 1 changes of the rig, usually 0");
  captured.set_state(v1::SESSION_STATE_PAUSED);
  EXPECT_TRUE(Verdicts(others).of(captured).measures().empty());
}

}  // namespace
}  // namespace glasswing
