#include "camera-node/backends/replay_camera.h"

#include <unistd.h>

#include <filesystem>

#include "core/file/file.h"
#include "tests/camera-node/backends/camera_contract.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

constexpr milliseconds kPatience(10'000);
constexpr int kWidth_px = 8, kHeight_px = 6;
// Starts of the archive's exposures, with a pause in the middle that a replay leaves out.
constexpr std::int64_t kStarts_ms[] = {100, 110, 130, 60'000, 60'010, 60'020};
// Two alternating exposure times.
double exposure_ms_of(int i) {
  return i % 2 == 0 ? 2.0 : 4.0;
}

Image16 picture_of(int i) {
  Image16 image(kWidth_px, kHeight_px);
  for (size_t k = 0; k < image.samples.size(); ++k)
    image.samples[k] = static_cast<std::uint16_t>(1000 * static_cast<size_t>(i) + k);
  return image;
}

class Directory {
 public:
  Directory() : path_(fs::path(testing::TempDir()) / unique_name()) {}
  ~Directory() { fs::remove_all(path_); }
  const fs::path& path() const { return path_; }

 private:
  static std::string unique_name() {
    static int count = 0;
    return "replay." + std::to_string(::getpid()) + "." + std::to_string(++count);
  }
  fs::path path_;
};

void write_archive(const fs::path& directory, bool sealed) {
  v1::CaptureManifest header;
  header.set_session("s");
  header.mutable_camera()->set_name("then");
  header.mutable_camera()->set_width_px(kWidth_px);
  header.mutable_camera()->set_height_px(kHeight_px);
  header.mutable_camera()->set_bits(12);
  header.mutable_camera()->set_response("linear");
  header.add_monitors()->set_name("back");
  header.mutable_monitors(0)->set_width_px(4);
  header.mutable_monitors(0)->set_height_px(4);
  const std::unique_ptr<Archive> archive = Archive::create(directory, header).value();
  for (int i = 0; i < static_cast<int>(std::size(kStarts_ms)); ++i) {
    v1::Frame frame;
    frame.set_step(i);
    frame.set_exposure_ms(exposure_ms_of(i));
    frame.set_gain(1.5);
    frame.mutable_stimulus()->set_panel("back");
    frame.set_exposure_start_ns(kStarts_ms[i] * 1'000'000);
    frame.set_exposure_end_ns(kStarts_ms[i] * 1'000'000 +
                              static_cast<std::int64_t>((exposure_ms_of(i) + 1.0) * 1e6));
    ASSERT_OK(archive->add({{.record = frame, .image = picture_of(i)}}));
  }
  if (sealed) {
    ASSERT_OK(archive->seal());
  }
}

std::unique_ptr<Camera> make_replay() {
  static const Directory directory;
  if (!fs::exists(directory.path())) write_archive(directory.path(), true);
  return ReplayCamera::open({.name = "now", .archive = directory.path(), .frame_rate_hz = {}}).value();
}

INSTANTIATE_TEST_SUITE_P(Replay, CameraContract, testing::Values(make_replay));

TEST(ReplayCamera, ShowsEveryFrameOfAnExposureInOrderAndBeginsAgain) {
  for (const bool exported : {false, true}) {
    const Directory directory;
    write_archive(directory.path(), exported);
    if (exported) {  // an export has no journal
      fs::remove(directory.path() / "header.json");
      fs::remove(directory.path() / "frames.jsonl");
    }
    const auto camera =
        ReplayCamera::open({.name = "now", .archive = directory.path(), .frame_rate_hz = 200.0}).value();
    EXPECT_EQ(camera->describe().camera().name(), "now");
    EXPECT_EQ(camera->describe().camera().bits(), 12);
    EXPECT_EQ(camera->describe().readout_ns(), 1'000'000);
    EXPECT_DOUBLE_EQ(camera->describe().frame_rate_hz(), 200.0);
    ASSERT_OK(camera->start(4.0));
    std::optional<CapturedFrame> before;
    for (const int expected : {1, 3, 5, 1, 3, 5, 1}) {
      std::optional<CapturedFrame> frame = camera->next(kPatience);
      ASSERT_TRUE(frame);
      EXPECT_TRUE(frame->image()->samples == picture_of(expected).samples) << expected;
      EXPECT_DOUBLE_EQ(frame->taken.gain(), 1.5);
      EXPECT_EQ(frame->taken.exposure_end_ns() - frame->taken.exposure_start_ns(), 5'000'000);
      if (before) {
        EXPECT_EQ(frame->taken.exposure_start_ns() - before->taken.exposure_start_ns(), 5'000'000);
      }
      before = std::move(frame);
    }
  }
}

TEST(ReplayCamera, KeepsTheArchivesPaceButNotItsPauses) {
  const Directory directory;
  write_archive(directory.path(), false);
  const auto camera =
      ReplayCamera::open({.name = "now", .archive = directory.path(), .frame_rate_hz = {}}).value();
  ASSERT_OK(camera->start(2.0));
  std::vector<std::int64_t> starts_ns;
  for (int i = 0; i < 4; ++i) starts_ns.push_back(camera->next(kPatience)->taken.exposure_start_ns());
  EXPECT_EQ(starts_ns[1] - starts_ns[0], 10'000'000);          // frame 0 to 1
  EXPECT_EQ(starts_ns[2] - starts_ns[1], 1'000'000'000 / 30);  // the minute between 2 and 3
  EXPECT_EQ(starts_ns[3] - starts_ns[2], 10'000'000);
  // A frame that is not complete within the timeout is not lost.
  const std::int64_t last = camera->next(kPatience)->taken.sequence();
  EXPECT_FALSE(camera->next(milliseconds(0)));
  EXPECT_EQ(camera->next(kPatience)->taken.sequence(), last + 1);
}

TEST(ReplayCamera, SaysWhatIsWrong) {
  const Directory directory;
  EXPECT_TRUE(absl::IsNotFound(
      ReplayCamera::open({.name = "now", .archive = directory.path(), .frame_rate_hz = {}}).status()));
  write_archive(directory.path(), true);
  const absl::Status fast =
      ReplayCamera::open({.name = "now", .archive = directory.path(), .frame_rate_hz = 250.0}).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(fast));
  EXPECT_NE(std::string(fast.message()).find("frames/000001.tif"), std::string::npos) << fast;
  const auto camera =
      ReplayCamera::open({.name = "now", .archive = directory.path(), .frame_rate_hz = 200.0}).value();
  const absl::Status exposure = camera->start(3.0);
  EXPECT_TRUE(absl::IsInvalidArgument(exposure));
  EXPECT_NE(std::string(exposure.message()).find("2, 4"), std::string::npos) << exposure;
  std::string bytes = read_file(directory.path() / "frames/000000.tif").value();
  bytes.back() = static_cast<char>(bytes.back() ^ 1);
  ASSERT_OK(write_file_durably(directory.path() / "frames/000000.tif", bytes));
  ASSERT_OK(camera->start(2.0));
  const absl::Status damaged = camera->next(kPatience)->image().status();
  EXPECT_TRUE(absl::IsDataLoss(damaged));
  EXPECT_NE(std::string(damaged.message()).find("frames/000000.tif"), std::string::npos) << damaged;
}

}  // namespace
}  // namespace glasswing
