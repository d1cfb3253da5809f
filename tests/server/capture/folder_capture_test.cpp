// A capture with a tethered camera: pictures that come into a folder late, twice, cut off, or swapped are
// never taken for another step's.
#include <absl/strings/str_replace.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <map>

#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/image/image_file.h"
#include "core/service/service.h"
#include "tests/faults/capture/decoder.h"
#include "tests/faults/capture/rig.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int kPatchRows = 16;
constexpr double kExposure_ms = 10.0;

enum class EmptyStage { kShown, kSkipped };

// About so many steps with the object, and without it too if the empty stage is shown.
v1::Plan stripes(int steps, EmptyStage empty = EmptyStage::kSkipped) {
  v1::Plan plan;
  plan.set_method("gaussian");
  plan.set_skip_empty_stage(empty == EmptyStage::kSkipped);
  v1::Sweep& sweep = *plan.add_sweeps();
  sweep.set_sigma_px(2.0 * FaultyRig::kWidth_px / steps);
  sweep.set_step_px(1.4 * sweep.sigma_px());
  plan.add_exposure_ms(kExposure_ms);
  plan.set_retries(6);
  return plan;
}

// The command of the stand-in, with whatever is wrong with it.
std::string stand_in(const fs::path& state, const std::string& faults) {
  return fmt::format(
      "{} --tap {{tap}} --folder {{dir}} --state {} --width {} --height {} --exposure-ms {} {}",
      std::getenv("GLASSWING_TETHERED"), state.string(), FaultyRig::kWidth_px, FaultyRig::kHeight_px,
      kExposure_ms, faults);
}

// What each stored frame shows, by a reader that shares no code with the patterns.
std::map<int, std::string> mislabelled(const FaultyRig& rig, const std::string& session, int camera,
                                       double stripe_step_px) {
  std::map<int, std::string> wrong;
  const auto archive = Archive::open(rig.archive(session, camera)).value();
  const View view{.pattern_rows = FaultyRig::kHeight_px - kPatchRows,
                  .step_px = stripe_step_px,
                  .noise_sd = FaultyRig::kMaxNoise};
  const v1::CaptureManifest manifest = archive->manifest();
  for (const v1::Frame& frame : manifest.frames()) {
    EXPECT_EQ(frame.proof(), v1::PROOF_TIME_AND_PATCH) << frame.step();
    const Image16 image = decode_tiff(archive->read_frame_bytes(frame.file()).value()).value();
    if (const auto what = mismatch(image, frame.stimulus(), view)) wrong[frame.step()] = *what;
  }
  return wrong;
}

class TetheredRig {
 public:
  // `command` of a state's directory; empty: a person presses the button.
  TetheredRig(const std::function<std::string(const fs::path& state)>& command, double patience_s,
              int patch_rows = kPatchRows)
      : folder_(data_ / "folder"), state_(data_ / "state") {
    fs::create_directories(folder_);
    fs::create_directories(state_);
    RigFaults rig{.name = "tethered"};
    rig.folder = {.name = "camera-1",
                  .directory = folder_,
                  .shoot = command ? command(state_) : "",
                  .patience = nanoseconds(std::llround(1e9 * patience_s)),
                  .exposure_ms = kExposure_ms};
    // Of a camera with a button, the first picture is there.
    if (!command) {
      const Image16 dark(FaultyRig::kWidth_px, FaultyRig::kHeight_px);
      EXPECT_TRUE(write_file_durably(folder_ / "first.png", encode_png16(dark).value()).ok());
    }
    rig_ = std::make_unique<FaultyRig>(rig, 1, patch_rows, data_);
  }
  ~TetheredRig() {
    rig_.reset();
    std::error_code ignored;
  }
  const fs::path& folder() const { return folder_; }
  const fs::path& state() const { return state_; }
  FaultyRig& rig() { return *rig_; }

  std::map<int, std::string> mislabelled(double stripe_step_px) {
    return glasswing::mislabelled(*rig_, "s", 0, stripe_step_px);
  }
  std::map<std::string, int> faults() const {
    std::map<std::string, int> counts;
    std::ifstream lines(state_ / "faults");
    for (std::string line; std::getline(lines, line);) ++counts[line];
    return counts;
  }

 private:
  const TemporaryDirectory data_;
  const fs::path folder_, state_;
  std::unique_ptr<FaultyRig> rig_;
};

int steps_from_environment(int otherwise) {
  const char* const steps = std::getenv("GLASSWING_STEPS");
  return steps == nullptr ? otherwise : std::atoi(steps);
}

TEST(FolderCapture, FaultyFilesNeverPassForAnotherStep) {
  TetheredRig tethered(
      [](const fs::path& state) {
        return stand_in(
            state,
            "--late 0.06 --late-s 3.75 --twice 0.1 --cut 0.05 --slow 0.1 --swapped 0.05 --lost 0.03 "
            "--stale 0.06");
      },
      3.0);
  const v1::Plan plan = stripes(steps_from_environment(16), EmptyStage::kShown);
  const grpc::Status created = tethered.rig().create(plan);
  ASSERT_TRUE(created.ok()) << created.error_message();
  const v1::Session end = tethered.rig().watch();
  const std::map<int, std::string> wrong = tethered.mislabelled(plan.sweeps(0).step_px());
  for (const auto& [step, what] : wrong) ADD_FAILURE() << "step " << step << ": " << what;
  std::string faults;
  for (const auto& [what, count] : tethered.faults()) faults += fmt::format(" {} {}", count, what);
  fmt::print(
      "{} steps: {} proven, {} named unproven, {} mislabelled, {} refused; {} pictures; faults:{}; {}\n",
      end.step_count(), end.patch_proven_count(), end.unproven_size(), wrong.size(), end.refused_count(),
      end.frames_taken(), faults, end.reason());
  EXPECT_EQ(end.time_proven_count(), 0);
  // Each step is proven or named, unless the capture ends at a monitor or a picture, which it names.
  const bool ended_early = end.reason().starts_with("monitor \"back\"") ||
                           end.reason().find(" s for picture ") != std::string::npos;
  EXPECT_TRUE(ended_early || end.patch_proven_count() + end.unproven_size() == end.step_count())
      << end.reason();
}

TEST(FolderCapture, RawMosaicsAreProvenAndKeepTheirBlackLevel) {
  TetheredRig tethered([](const fs::path& state) { return stand_in(state, "--mosaic GBRG"); }, 20.0);
  const v1::Plan plan = stripes(6);
  const grpc::Status created = tethered.rig().create(plan);
  ASSERT_TRUE(created.ok()) << created.error_message();
  const v1::Session end = tethered.rig().watch();
  EXPECT_EQ(end.patch_proven_count(), end.step_count()) << end.reason();
  const v1::Camera camera = Archive::open(tethered.rig().archive("s")).value()->manifest().camera();
  EXPECT_EQ(camera.mosaic(), "GBRG");
  EXPECT_EQ(camera.bits(), 12);
  EXPECT_EQ(camera.response(), "linear");
}

TEST(FolderCapture, ACameraThatSleepsIsNamedAndHowLongTheFolderHasWaited) {
  // It wakes for its first picture only.
  const auto once = [](const fs::path& state) {
    const fs::path script = state / "asleep.sh";
    EXPECT_TRUE(
        write_file_durably(script, "#!/bin/sh\n[ -e $0.done ] && exit 0\ntouch $0.done\nexec \"$@\"\n").ok());
    fs::permissions(script, fs::perms::owner_all);
    return script.string() + " " + stand_in(state, "");
  };
  TetheredRig tethered(once, 2.0);
  const grpc::Status created = tethered.rig().create(stripes(6));
  ASSERT_TRUE(created.ok()) << created.error_message();
  std::string waited;
  const v1::Session end = tethered.rig().watch([&](const v1::Session& now) {
    if (now.has_waiting()) waited = now.waiting().what();
  });
  EXPECT_THAT(waited, testing::MatchesRegex("the folder has waited [0-9]+ s for picture 1 of [0-9]+"));
  EXPECT_EQ(end.state(), v1::SESSION_STATE_FAILED);
  EXPECT_THAT(end.reason(), HasSubstr("s for picture 1 of"));
  EXPECT_THAT(end.reason(), HasSubstr("awake"));
  EXPECT_EQ(end.proven_count(), 0);
}

TEST(FolderCapture, AMonitorWhosePatchIsNotSeenIsNamed) {
  TetheredRig tethered([](const fs::path& state) { return stand_in(state, "--capped"); }, 20.0);
  const grpc::Status created = tethered.rig().create(stripes(6));
  ASSERT_TRUE(created.ok()) << created.error_message();
  const v1::Session end = tethered.rig().watch();
  EXPECT_EQ(end.state(), v1::SESSION_STATE_FAILED);
  EXPECT_THAT(end.reason(), HasSubstr("monitor \"back\""));
  EXPECT_THAT(end.reason(), HasSubstr("proven only by the id patch"));
  EXPECT_EQ(end.proven_count(), 0);
}

TEST(FolderCapture, WhatNoIdPatchCouldProveIsRefusedBeforehand) {
  TetheredRig tethered(nullptr, 2.0, 0);
  const grpc::Status created = tethered.rig().create(stripes(6));
  EXPECT_EQ(created.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(created.error_message(), HasSubstr("monitor \"back\" shows no id patch"));
  v1::Plan calibration;
  calibration.set_method("calibration");
  calibration.mutable_calibration()->set_of("camera");
  calibration.add_exposure_ms(kExposure_ms);
  EXPECT_FALSE(tethered.rig().create(calibration).ok());
}

TEST(FolderCapture, WhereAPersonPressesTheButtonTheSessionSaysWhichPictureIsDue) {
  TetheredRig tethered(nullptr, 2.0);
  const v1::Plan plan = stripes(6);
  const grpc::Status created = tethered.rig().create(plan);
  ASSERT_TRUE(created.ok()) << created.error_message();
  const std::string press = absl::StrReplaceAll(
      stand_in(tethered.state(), ""),
      {{"{tap}", tethered.rig().display_address()}, {"{dir}", tethered.folder().string()}});
  std::string due;
  int pressed = 0;
  const v1::Session end = tethered.rig().watch([&](const v1::Session& now) {
    const std::string& what = now.waiting().what();
    if (what.find("press the camera's button") != 0 || what == due) return;
    due = what;
    ++pressed;
    EXPECT_EQ(std::system(press.c_str()), 0);
  });
  EXPECT_EQ(end.patch_proven_count(), end.step_count()) << end.reason();
  EXPECT_EQ(pressed, end.step_count());
  EXPECT_TRUE(tethered.mislabelled(plan.sweeps(0).step_px()).empty());
}

// "camera-1" and "camera-3" take pictures on demand, "camera-2" between them by itself.
class SeveralTethered : public testing::Test {
 protected:
  // `third`: the command of the third camera's stand-in.
  void start(const std::string& third, double patience_s) {
    const auto tethered = [&](int number, const std::string& command) {
      const fs::path folder = data_ / fmt::format("folder-{}", number);
      fs::create_directories(folder);
      return FolderCamera::Options{.name = fmt::format("camera-{}", number),
                                   .directory = folder,
                                   .shoot = command,
                                   .patience = nanoseconds(std::llround(1e9 * patience_s)),
                                   .exposure_ms = kExposure_ms};
    };
    RigFaults rig{.name = "several tethered"};
    rig.folder = tethered(1, stand_in(state(1), ""));
    rig.cameras.push_back({.name = "free", .frame_rate_hz = 60.0});
    // As bright as the others, with their exposure.
    rig.cameras.back().disturbances.gain = FaultyRig::kExposure_ms / kExposure_ms;
    rig.cameras.push_back({.name = "tethered"});
    rig.cameras.back().folder = tethered(3, third);
    rig_ = std::make_unique<FaultyRig>(rig, 1, kPatchRows, data_);
    plan_ = stripes(4);
    plan_.set_hold_refreshes(16);
    for (int i = 1; i <= 3; ++i) plan_.add_cameras(fmt::format("camera-{}", i));
  }
  fs::path state(int number) const { return data_ / fmt::format("state-{}", number); }
  v1::Session captured() {
    EXPECT_OK(rig_->create(plan_));
    return rig_->watch();
  }
  void expect_whole(const v1::Session& session, int camera) {
    const v1::Session& view = session.views(camera);
    EXPECT_EQ(view.state(), v1::SESSION_STATE_CAPTURED) << view.name() << ": " << view.reason();
    EXPECT_EQ(view.patch_proven_count(), session.step_count()) << view.name();
    for (const auto& [step, what] : mislabelled(*rig_, view.name(), camera, plan_.sweeps(0).step_px()))
      ADD_FAILURE() << view.name() << ", step " << step << ": " << what;
  }

  const TemporaryDirectory data_;
  v1::Plan plan_;
  std::unique_ptr<FaultyRig> rig_;
};

TEST_F(SeveralTethered, EachStepIsHeldUntilEveryCameraHasIt) {
  start(stand_in(state(3), "--twice 0.3"), 20.0);
  const v1::Session session = captured();
  ASSERT_EQ(session.views_size(), 3);
  for (int camera = 0; camera < 3; ++camera) expect_whole(session, camera);
}

TEST_F(SeveralTethered, OneThatSleepsLeavesTheOthersTheirFrames) {
  // It wakes for its first picture only.
  const fs::path script = data_ / "asleep.sh";
  ASSERT_OK(write_file_durably(script, "#!/bin/sh\n[ -e $0.done ] && exit 0\ntouch $0.done\nexec \"$@\"\n"));
  fs::permissions(script, fs::perms::owner_all);
  start(script.string() + " " + stand_in(state(3), ""), 1.0);
  const v1::Session session = captured();
  ASSERT_EQ(session.views_size(), 3);
  for (int camera = 0; camera < 2; ++camera) expect_whole(session, camera);
  EXPECT_EQ(session.views(2).state(), v1::SESSION_STATE_FAILED);
  EXPECT_THAT(session.views(2).reason(), HasSubstr("s for picture 1 of"));
  EXPECT_EQ(session.views(2).proven_count(), 0);
}

}  // namespace
}  // namespace glasswing
