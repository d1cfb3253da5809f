// What a display, camera or clock can do that reports times which are not true: the table in docs/timing.md
// (capture.lies). Two things are tested of each lie: no frame is kept under another step's label, and the
// capture either proves its steps or fails, naming the lag where a lag explains it.
//
// The rig is simulated row by row: a monitor that scans out from the top, and a camera with a rolling shutter
// that runs free. What decides is the capture's own: windows and matches (core/timing/proof), PatchLearning,
// PatchProof and find_lag. Some lies are repeated on a rig of real daemons.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <regex>

#include "camera-node/services/patch_proof.h"
#include "core/timing/proof.h"
#include "server/capture/lag_search.h"
#include "server/capture/patch_learning.h"
#include "tests/faults/capture/rig.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

constexpr int kWidth_px = 64, kPatternRows = 40, kPatchRows = 8, kRows = kPatternRows + kPatchRows;
constexpr nanoseconds kRefresh(16'666'667), kStepTime = 2 * kRefresh;
constexpr nanoseconds kLag = milliseconds(3), kSettle = milliseconds(1);
constexpr nanoseconds kFramePeriod = milliseconds(5), kExposure = milliseconds(4), kReadout = milliseconds(1);
constexpr nanoseconds kLead = milliseconds(300);  // from the first frame to the first picture
constexpr int kSteps = 60, kRetries = 10;
// Share of another picture in a frame whose patch is read. A patch is learned from frames with less than a
// quarter of another picture, so its levels are at least 3/4 of full contrast apart; it is read if a cell
// reaches 0.8 of that: (1 - 2 share) >= 0.8 * 3/4.
constexpr double kMaxOther = 0.2;

// What differs from the reports. Pictures and frames are numbered as they are reported.
struct Lie {
  std::string name;
  std::optional<bool> fails = {};  // none: by chance
  // How much later than reported the row of picture i (0: the first row, 1: the last) is scanned out.
  std::function<nanoseconds(int i, double row)> light = [](int, double) { return nanoseconds(0); };
  // Which picture is shown in place of picture i.
  std::function<int(int i)> picture = [](int i) { return i; };
  // How much later than reported frame i is exposed.
  std::function<nanoseconds(int i)> exposure = [](int) { return nanoseconds(0); };
  // Whose pixels the row of frame i holds.
  std::function<int(int i, double row)> pixels = [](int i, double) { return i; };
  // Columns of the id patch, from the middle on, that an object hides. No lie by itself.
  int hidden = 0;
};

// The same draw for the same number, whatever was drawn before (splitmix64).
double draw(std::uint64_t seed, int number) {
  std::uint64_t z = (seed << 32) + static_cast<std::uint64_t>(number) * 0x9e3779b97f4a7c15u;
  z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
  z = (z ^ z >> 27) * 0x94d049bb133111ebu;
  return static_cast<double>((z ^ z >> 31) >> 11) * 0x1p-53;
}

nanoseconds ms(double value) {
  return nanoseconds(std::llround(1e6 * value));
}

// Blocks that are lit or dark by the number, above an id patch of which columns are hidden.
RadianceImage drawn(int number, std::uint16_t id, int hidden) {
  RadianceImage picture(kWidth_px, kRows);
  for (int y = 0; y < kPatternRows && number >= 0; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      const bool lit = draw(7, (number * 64 + y / 4) * 64 + x / 8) < 0.5;
      for (int c = 0; c < 3; ++c) picture.at(x, y, c) = lit ? 1.0f : 0.0f;
    }
  }
  IdPatch{.width_px = kWidth_px, .first_row = kPatternRows, .rows = kPatchRows}.draw(id, picture);
  const int left = (IdPatch::kBits - hidden) / 2 * kWidth_px / IdPatch::kBits;
  for (int y = kPatternRows; y < kRows; ++y) {
    for (int x = left; x < kWidth_px - left; ++x) {
      for (int c = 0; c < 3; ++c) picture.at(x, y, c) = 0.0f;
    }
  }
  return picture;
}

// A program that is shown from time 0 on, and the camera's frames meanwhile.
class Showing {
 public:
  explicit Showing(const Lie& lie, int first_picture, int first_frame)
      : lie_(lie), first_picture_(first_picture), first_frame_(first_frame) {}

  void add(int step, const RadianceImage& picture) {
    steps_.push_back(step);
    pictures_.push_back(picture);
  }
  int picture_count() const { return static_cast<int>(pictures_.size()); }
  int frame_count() const {
    return static_cast<int>((kLead + picture_count() * kStepTime + milliseconds(350)) / kFramePeriod);
  }

  std::vector<StableWindow> windows() const {
    std::vector<StableWindow> windows;
    for (int i = 0; i < picture_count(); ++i) {
      if (steps_[i] < 0) continue;
      const nanoseconds start = kLead + i * kStepTime;
      windows.push_back(stable_window({{.step = steps_[i],
                                        .scanout_end = start + kRefresh,
                                        .replaced = start + kStepTime,
                                        .lag = kLag,
                                        .settle = kSettle,
                                        .patch_delay = kRefresh * kPatternRows / kRows}}));
    }
    return windows;
  }
  std::vector<FrameTime> frames() const {
    std::vector<FrameTime> frames;
    for (int i = 0; i < frame_count(); ++i) {
      const nanoseconds start = reported_start(i);
      frames.push_back({.sequence = i, .start = start, .end = start + kExposure + kReadout});
    }
    return frames;
  }

  // What the camera saw.
  Image16 image(std::int64_t sequence) const {
    Image16 image(kWidth_px, kRows);
    for (int y = 0; y < kRows; ++y) {
      const double row = static_cast<double>(y) / kRows;
      const int i = lie_.pixels(first_frame_ + static_cast<int>(sequence), row) - first_frame_;
      const nanoseconds start = reported_start(i) + lie_.exposure(first_frame_ + i) +
                                nanoseconds(std::llround(row * static_cast<double>(kReadout.count())));
      std::array<double, 3 * kWidth_px> light{};
      // The last is the black one that ends a program.
      for (int p = 0; p <= picture_count(); ++p) {
        const double share = shown_share(p, row, start) - shown_share(p + 1, row, start);
        const int shown = std::clamp(lie_.picture(first_picture_ + p) - first_picture_, 0, picture_count());
        if (share == 0.0 || shown == picture_count()) continue;
        for (int s = 0; s < 3 * kWidth_px; ++s)
          light[s] += share * static_cast<double>(pictures_[shown].samples[y * 3 * kWidth_px + s]);
      }
      for (int s = 0; s < 3 * kWidth_px; ++s)
        image.samples[y * 3 * kWidth_px + s] = code16_of(static_cast<float>(light[s]));
    }
    return image;
  }

 private:
  // Phases drift past those of the refreshes.
  nanoseconds reported_start(int i) const {
    return i * kFramePeriod + microseconds(137) * first_frame_ % kFramePeriod;
  }

  // Of an exposure from `start` on, after picture p has replaced the one before: the mean of r(t - t_p), r(u)
  // = u / settle clamped to [0, 1]. Pictures replace each other in order, and all are replaced by black at
  // the end.
  double shown_share(int p, double row, nanoseconds start) const {
    if (p > picture_count()) return 0.0;
    const auto scanned = [&](int i) {
      return kLead + i * kStepTime + lie_.light(first_picture_ + i, row) +
             nanoseconds(std::llround(row * static_cast<double>(kRefresh.count()))) + kLag;
    };
    const nanoseconds at = scanned(p);
    const auto until = [&](nanoseconds t) {  // the integral of r up to t, ns
      const double u = static_cast<double>((t - at).count()), settle = static_cast<double>(kSettle.count());
      return u <= 0.0 ? 0.0 : u < settle ? 0.5 * u * u / settle : u - 0.5 * settle;
    };
    return (until(start + kExposure) - until(start)) / static_cast<double>(kExposure.count());
  }

  const Lie& lie_;
  const int first_picture_, first_frame_;
  std::vector<int> steps_;  // -1: not reported
  std::vector<RadianceImage> pictures_;
};

struct Outcome {
  int kept = 0, wrong = 0, by_time = 0;
  bool failed = false;
  std::optional<nanoseconds> lag;  // that the failure names
};

// A capture of kSteps steps after the patch learning steps, as GroupCapture does it.
class LyingRig {
 public:
  explicit LyingRig(const Lie& lie) : lie_(lie) {
    const std::span<const std::uint16_t> ids = patch_learning_ids();
    for (int i = 0; i < static_cast<int>(ids.size()) + kSteps; ++i) {
      const bool learns = i < static_cast<int>(ids.size());
      Step& step =
          pending_.emplace_back(Step{.number = i, .object = false, .exposure_ms = 4.0, .stimulus = {}});
      step.stimulus.set_kind(learns ? "patch" : "solid");
      step.stimulus.set_panel("back");
      if (learns) step.stimulus.set_patch_id(ids[i]);
    }
    learning_steps_ = {pending_.begin(), pending_.begin() + static_cast<std::ptrdiff_t>(ids.size())};
  }

  Outcome run() {
    for (int showings = 0; !pending_.empty(); ++showings) {
      if (showings - learning_.unseen_showings() > kRetries || learning_.hopeless() != nullptr)
        return failure();
      show(learning_.begin_showing(pending_));
      std::erase_if(pending_, [&](const Step& step) { return proven_.contains(step.number); });
    }
    return outcome_;
  }

 private:
  Showing start(const std::vector<Step>& steps) {
    Showing showing(lie_, pictures_, frames_);
    ids_.clear();
    for (const Step& step : steps) {
      const bool learns = is_patch_learning_step(step);
      const auto id = learns ? static_cast<std::uint16_t>(step.stimulus.patch_id())
                             : static_cast<std::uint16_t>(++showings_ * 40503u);
      ids_[step.number] = id;
      const RadianceImage picture = drawn(learns ? -1 : step.number, id, lie_.hidden);
      if (learns) showing.add(-1, picture);  // it is shown twice
      showing.add(step.number, picture);
    }
    showing.add(-1, RadianceImage(kWidth_px, kRows));
    pictures_ += showing.picture_count();
    frames_ += showing.frame_count();
    return showing;
  }

  void show(const std::vector<Step>& steps) {
    const Showing showing = start(steps);
    std::map<int, StableWindow> windows;
    FrameMatcher matcher;
    for (const StableWindow& window : showing.windows()) {
      windows[window.step] = window;
      matcher.add_window(window);
    }
    const std::vector<FrameTime> frames = showing.frames();
    for (const FrameTime& frame : frames) matcher.add_frame(frame);
    std::vector<v1::Frame> records;
    for (const FrameMatcher::Match& match : matcher.take()) {
      v1::Frame& record = records.emplace_back();
      record.set_step(match.step);
      record.set_sequence(match.frame.sequence);
      record.set_exposure_ms(4.0);
      *record.mutable_stimulus() = all_step(match.step, steps).stimulus;
      if (!is_patch_learning_step(all_step(match.step, steps))) record.set_patch_id(ids_[match.step]);
    }
    learn(learning_.take_learning_frames(std::move(records), [](int) { return true; }), showing, windows,
          frames);
    for (v1::Frame& record : learning_.take_ready_frames().value_or(std::vector<v1::Frame>())) {
      const Image16 image = showing.image(record.sequence());
      if (proof_.judge(record, image) == PatchVerdict::kAgrees) keep(record, image);
    }
  }

  static const Step& all_step(int number, const std::vector<Step>& steps) {
    return *std::ranges::find(steps, number, &Step::number);
  }

  void learn(const std::vector<v1::Frame>& records, const Showing& showing,
             const std::map<int, StableWindow>& windows, const std::vector<FrameTime>& frames) {
    v1::LearnPatchesResponse response;
    const bool accepted = !learning_.accepted_unseen().empty();
    for (const v1::Frame& record : records) {
      std::int64_t last = record.sequence();
      for (const FrameTime& frame : frames) {
        if (frame.end <= windows.at(record.step()).patch_until) last = std::max(last, frame.sequence);
      }
      CapturedFrame later{.taken = {}, .image = [image = showing.image(last)] { return image; }};
      auto set = proof_.add({.record = record, .image = showing.image(record.sequence())}, std::move(later));
      if (!set) {
        response.add_waiting_steps(record.step());
        continue;
      }
      response.clear_waiting_steps();
      if (!set->learned.ok()) {
        v1::UnseenPatch& unseen = *response.add_unseen_patches();
        unseen.set_monitor("back");
        unseen.set_dark(absl::IsNotFound(set->learned));
        unseen.set_contradicts(absl::IsOutOfRange(set->learned));
        if (!accepted || unseen.contradicts()) continue;
        unseen.set_frozen(unseen.dark() && std::ranges::none_of(frames, [&](const FrameTime& frame) {
                            return frame.sequence > set->frames.front().record.sequence() &&
                                   differs(showing.image(frame.sequence), set->frames.front().image);
                          }));
        if (unseen.frozen()) continue;
      }
      for (Archive::NewFrame& frame : set->frames) {
        if (set->learned.ok()) frame.record.set_proof(v1::PROOF_TIME_AND_PATCH);
        *response.add_frames() = frame.record;
        keep(frame.record, frame.image);
      }
    }
    (void)learning_.note_learned(response);
  }

  void keep(const v1::Frame& record, const Image16& image) {
    proven_.insert(record.step());
    ++outcome_.kept;
    if (record.proof() != v1::PROOF_TIME_AND_PATCH) ++outcome_.by_time;
    const bool learns = kind_of(record.stimulus()) == StimulusKind::kPatch;
    const RadianceImage truth = drawn(learns ? -1 : record.step(), ids_.at(record.step()), lie_.hidden);
    double off = 0.0;
    for (size_t s = 0; s < truth.samples.size(); ++s)
      off = std::max(off, std::abs(image.samples[s] / 65535.0 - static_cast<double>(truth.samples[s])));
    if (off > kMaxOther) ++outcome_.wrong;
  }

  Outcome failure() {
    outcome_.failed = true;
    const Showing showing = start(learning_steps_);
    std::vector<TimeOnScreen> ids;
    for (const StableWindow& window : showing.windows())
      ids.push_back({.from = window.from - kStepTime, .until = window.patch_until});
    const std::vector<FrameTime> frames = showing.frames();
    const auto sees = [&](const std::vector<std::int64_t>& sequences) {
      std::vector<Image16> images;
      for (const std::int64_t sequence : sequences) images.push_back(showing.image(sequence));
      return PatchReader::learn(images).ok();
    };
    outcome_.lag = find_lag(ids, frames, sees).value();
    return outcome_;
  }

  const Lie& lie_;
  std::vector<Step> pending_, learning_steps_;
  std::set<std::string> given_up_;
  PatchLearning learning_{given_up_};
  PatchProof proof_;
  std::map<int, std::uint16_t> ids_;
  std::set<int> proven_;
  std::uint32_t showings_ = 0;
  int pictures_ = 0, frames_ = 0;  // of earlier showings
  Outcome outcome_;
};

Outcome outcome_of(const Lie& lie) {
  return LyingRig(lie).run();
}

TEST(Lies, WithoutOneEveryStepIsProven) {
  const Outcome outcome = outcome_of({.name = "none"});
  EXPECT_EQ(outcome.kept, kSteps + static_cast<int>(patch_learning_ids().size()));
  EXPECT_EQ(outcome.wrong, 0);
  EXPECT_EQ(outcome.by_time, 0);
  EXPECT_FALSE(outcome.failed);
}

// What the camera does not see is no lie: the capture goes on, and says so.
TEST(Lies, AHiddenPatchIsNone) {
  for (const int hidden : {2, 4, 6, 8, 16}) {
    const Outcome outcome = outcome_of({.name = "none", .hidden = hidden});
    const int all = kSteps + static_cast<int>(patch_learning_ids().size());
    EXPECT_EQ(outcome.kept, all) << hidden;
    EXPECT_EQ(outcome.wrong, 0) << hidden;
    EXPECT_FALSE(outcome.failed) << hidden;
    EXPECT_EQ(outcome.by_time, IdPatch::kBits - hidden >= IdPatch::kMinBits ? 0 : all) << hidden;
  }
  // But nothing that changes at all is no hidden patch.
  const Outcome frozen = outcome_of({.name = "frozen", .picture = [](int) { return 0; }, .hidden = 16});
  EXPECT_TRUE(frozen.failed);
  EXPECT_EQ(frozen.wrong, 0);
}

// As much of a patch as is read contradicts as all of it. With less the learning steps contradict, which tell
// only offsets that are longer than the time for which an id is shown in vain.
TEST(Lies, AHiddenPatchContradictsAllTheSame) {
  for (const int hidden : {4, 8}) {
    for (int offset_ms = -100; offset_ms <= 200; offset_ms += 10) {
      if (offset_ms == 0) continue;
      const Outcome outcome = outcome_of(
          {.name = "late", .light = [&](int, double) { return milliseconds(offset_ms); }, .hidden = hidden});
      if (hidden == 8 && offset_ms > 0 && milliseconds(offset_ms) < kStepTime + kSettle) {
        EXPECT_EQ(outcome.by_time, outcome.kept) << offset_ms;
        continue;
      }
      EXPECT_EQ(outcome.wrong, 0) << hidden << " " << offset_ms;
      EXPECT_TRUE(outcome.failed) << hidden << " " << offset_ms;
    }
  }
}

// A monitor that lags, and a camera whose clock is off: pixels cannot tell them apart.
TEST(Lies, AConstantOffsetFailsTheCaptureWhichNamesIt) {
  for (int offset_ms = -100; offset_ms <= 200; offset_ms += 10) {
    if (offset_ms == 0) continue;
    const Lie display{.name = "display", .light = [&](int, double) { return milliseconds(offset_ms); }};
    const Lie camera{.name = "camera", .exposure = [&](int) { return milliseconds(-offset_ms); }};
    for (const Lie& lie : {display, camera}) {
      const Outcome outcome = outcome_of(lie);
      EXPECT_EQ(outcome.wrong, 0) << lie.name << " " << offset_ms;
      EXPECT_TRUE(outcome.failed) << lie.name << " " << offset_ms;
      ASSERT_TRUE(outcome.lag) << lie.name << " " << offset_ms;
      // Frames fall where they may: half a period off the middle at either end.
      EXPECT_LE(std::chrono::abs(*outcome.lag - milliseconds(offset_ms)), kFramePeriod / 2)
          << lie.name << " " << offset_ms << " " << outcome.lag->count();
    }
  }
}

int swapped(int i, std::uint64_t seed, double share) {
  if (draw(seed, i / 2) >= share) return i;
  return i % 2 == 0 ? i + 1 : i - 1;
}

std::function<nanoseconds(int)> at_random(std::uint64_t key, double share, nanoseconds off) {
  return [=](int i) { return draw(key, i) < share ? off : nanoseconds(0); };
}

std::function<nanoseconds(int)> jitter(std::uint64_t key, double most_ms) {
  return [=](int i) { return ms(most_ms * (2.0 * draw(key, i) - 1.0)); };
}

std::function<nanoseconds(int, double)> of_all_rows(const std::function<nanoseconds(int)>& off) {
  return [off](int i, double) { return off(i); };
}

std::vector<Lie> lies_of_displays(std::uint64_t seed) {
  return {
      {.name = "display drifts ahead, 5 ms a second", .fails = true, .light = of_all_rows([](int i) {
                                                                       return -ms(0.167 * i);
                                                                     })},
      {.name = "display drifts behind, 5 ms a second", .fails = true, .light = of_all_rows([](int i) {
                                                                        return ms(0.167 * i);
                                                                      })},
      {.name = "display jitters by 8 ms", .light = of_all_rows(jitter(seed + 1, 8.0))},
      {.name = "display jitters by 16 ms", .fails = true, .light = of_all_rows(jitter(seed + 2, 16.0))},
      {.name = "display late by a refresh, 5 %",
       .fails = false,
       .light = of_all_rows(at_random(seed + 3, 0.05, kRefresh))},
      {.name = "display late by a refresh, always",
       .fails = true,
       .light = of_all_rows(at_random(seed + 3, 1.0, kRefresh))},
      {.name = "display early by a refresh, always",
       .fails = true,
       .light = of_all_rows(at_random(seed + 3, 1.0, -kRefresh))},
      {.name = "display swaps pictures, 5 %",
       .fails = false,
       .picture = [=](int i) { return swapped(i, seed + 4, 0.05); }},
      {.name = "display swaps all pictures",
       .fails = true,
       .picture = [=](int i) { return swapped(i, seed + 4, 1.0); }},
      {.name = "display repeats pictures, 5 %",
       .fails = false,
       .picture = [=](int i) { return draw(seed + 5, i) < 0.05 ? i - 1 : i; }},
      {.name = "display is frozen from the start", .fails = true, .picture = [](int) { return 0; }},
      {.name = "display is frozen after a while",
       .fails = true,
       .picture = [](int i) { return std::min(i, 40); }},
      {.name = "display's lower half late by a refresh",
       .fails = true,
       .light = [](int, double row) { return row < 0.5 ? nanoseconds(0) : kRefresh; }},
  };
}

std::vector<Lie> lies_of_cameras(std::uint64_t seed) {
  return {
      {.name = "camera drifts ahead, 5 ms a second",
       .fails = true,
       .exposure = [](int i) { return ms(0.025 * i); }},
      {.name = "camera drifts behind, 5 ms a second",
       .fails = true,
       .exposure = [](int i) { return -ms(0.025 * i); }},
      {.name = "camera's stamps jitter by 8 ms", .exposure = jitter(seed + 6, 8.0)},
      {.name = "camera's stamps early by a frame, 5 %", .exposure = at_random(seed + 7, 0.05, kFramePeriod)},
      {.name = "camera swaps frames, 5 %",
       .fails = false,
       .pixels = [=](int i, double) { return swapped(i, seed + 8, 0.05); }},
      {.name = "camera swaps all frames",
       .fails = true,
       .pixels = [=](int i, double) { return swapped(i, seed + 8, 1.0); }},
      {.name = "camera repeats frames, 70 %",
       .pixels =
           [=](int i, double) {
             while (i > 0 && draw(seed + 9, i) < 0.7) --i;
             return i;
           }},
      {.name = "camera's frames are ten late",
       .fails = true,
       .pixels = [](int i, double) { return std::max(i - 10, 0); }},
      {.name = "camera is frozen from the start", .fails = true, .pixels = [](int, double) { return 0; }},
      {.name = "camera is frozen after a while",
       .fails = true,
       .pixels = [](int i, double) { return std::min(i, 200); }},
      {.name = "camera's lower half is of the frame before",
       .fails = false,
       .pixels = [](int i, double row) { return row < 0.5 ? i : std::max(i - 1, 0); }},
      {.name = "camera's lower half is ten frames old",
       .fails = true,
       .pixels = [](int i, double row) { return row < 0.5 ? i : std::max(i - 10, 0); }},
  };
}

TEST(Lies, NoFrameIsKeptUnderAnotherStepsLabel) {
  for (std::uint64_t seed = 100; seed <= 1000; seed += 100) {
    std::vector<Lie> lies = lies_of_displays(seed);
    for (Lie& lie : lies_of_cameras(seed)) lies.push_back(std::move(lie));
    for (const Lie& lie : lies) {
      const Outcome outcome = outcome_of(lie);
      EXPECT_EQ(outcome.wrong, 0) << lie.name << ", seed " << seed;
      if (lie.fails) {
        EXPECT_EQ(outcome.failed, *lie.fails) << lie.name << ", seed " << seed;
      }
    }
  }
}

// The patch is scanned out last, so it cannot speak for rows that are replaced out of turn (docs/timing.md).
TEST(Lies, APictureWhoseUpperHalfAloneIsOldIsNotNoticed) {
  const Lie display{.name = "display",
                    .light = [](int, double row) { return row < 0.5 ? kRefresh : nanoseconds(0); }};
  const Lie camera{.name = "camera",
                   .pixels = [](int i, double row) { return row < 0.5 ? std::max(i - 10, 0) : i; }};
  for (const Lie& torn : {display, camera}) {
    const Outcome outcome = outcome_of(torn);
    EXPECT_FALSE(outcome.failed) << torn.name;
    EXPECT_GT(outcome.wrong, 0) << torn.name;
  }
}

class LyingDaemons : public testing::Test {
 protected:
  // Named to the frames' period, 1 ms, and rounded.
  static void expect_lag(const v1::Session& session, int lag_ms) {
    EXPECT_EQ(session.state(), v1::SESSION_STATE_FAILED);
    EXPECT_EQ(session.proven_count(), 0);
    std::smatch said;
    ASSERT_TRUE(std::regex_search(session.reason(), said,
                                  std::regex("shows each step ([0-9]+) ms later than display-1 reports, .*"
                                             "glasswing calibrate sync --monitor back")))
        << session.reason();
    EXPECT_NEAR(std::stoi(said[1]), lag_ms, 2) << session.reason();
  }
  v1::Session capture(const RigFaults& faults) {
    FaultyRig rig(faults, 1, 16, data_);
    v1::CreateSessionRequest create;
    create.set_name("s");
    create.mutable_plan()->set_method("alpha");
    for (int i = 0; i < 20; ++i) {
      v1::Solid& solid = *create.mutable_plan()->add_solids();
      for (int c = 0; c < 3; ++c) solid.add_colour(0.05 * i);
    }
    create.mutable_plan()->add_exposure_ms(FaultyRig::kExposure_ms);
    v1::CreateSessionResponse created;
    grpc::ClientContext context;
    const grpc::Status status = rig.sessions().CreateSession(&context, create, &created);
    EXPECT_OK(status);
    v1::WatchSessionRequest watch;
    watch.set_name("s");
    grpc::ClientContext watching;
    const auto reader = rig.sessions().WatchSession(&watching, watch);
    v1::WatchSessionResponse response;
    while (reader->Read(&response)) continue;
    (void)reader->Finish();
    return response.session();
  }
  const TemporaryDirectory data_;
};

TEST_F(LyingDaemons, ADisplayThatIsLateIsNamed) {
  expect_lag(capture({.name = "late", .light_shift = milliseconds(50)}), 50);
}

TEST_F(LyingDaemons, ACameraWhoseStampsAreLateIsNamed) {
  expect_lag(capture({.name = "late stamps", .stamp_shift = milliseconds(20)}), 20);
}

}  // namespace
}  // namespace glasswing
