// Import of videos: sequences of an archive, folders of pictures, video files.
#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <random>

#include "compositing/picture/video_file.h"
#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/image/image_file.h"
#include "tests/client/fake_server.h"
#include "tests/client/run_glasswing.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
constexpr int kWidth = 32, kHeight = 16;

Image16 picture(int mark, int width = kWidth) {
  Image16 image(width, kHeight);
  for (size_t i = 0; i < image.samples.size(); ++i) image.samples[i] = static_cast<std::uint16_t>(257 * mark);
  return image;
}

class ImportVideo : public ScratchTest {
 protected:
  static void put(const fs::path& path, const Image16& image) {
    fs::create_directories(path.parent_path());
    ASSERT_OK(write_file_durably(path, encode_png16(image).value()));
  }
  Outcome run(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"--session", "s", "--server", server_.address()});
    return run_glasswing(arguments);
  }
  // First samples of the imported frames, with the object or without.
  std::vector<int> marks(bool object) const {
    std::vector<int> marks;
    for (const v1::Frame& frame : server_.archive_.manifest.frames()) {
      EXPECT_EQ(frame.stimulus().kind(), "ramp");
      EXPECT_EQ(frame.stimulus().panel(), "back");
      if (frame.object() == object)
        marks.push_back(decode_tiff(server_.archive_.files.at(frame.file()))->samples[0] / 257);
    }
    return marks;
  }
  void expect_nothing_sent() const { EXPECT_TRUE(server_.sessions_.begun.empty()); }

  FakeServer server_;
};

class ImportSequence : public ImportVideo {
 protected:
  ImportSequence() {
    const nlohmann::json manifest = {{"scene", "pouring"},
                                     {"monitor", {{"back", {{"width", 64}, {"height", 48}}}}},
                                     {"image", {{"width", kWidth}, {"height", kHeight}}},
                                     {"sequences", {{"ramp_dark", "no other light"}}}};
    EXPECT_OK(write_file_durably(set_ / "manifest.json", manifest.dump()));
    // More than ten, so that the order of names differs from that of numbers.
    for (int i = 0; i < 12; ++i) {
      put(set_ / fmt::format("ramp_dark/{}.png", i), picture(10 + i));
      put(set_ / fmt::format("ramp_light_noise/{:03d}.png", i), picture(40 + i));
      put(set_ / fmt::format("stilllife_dark/{:02d}.png", i), picture(1));
    }
    for (int i = 0; i < 3; ++i) put(set_ / fmt::format("bg/ramp_noise{:02d}.png", i), picture(70 + i));
    put(set_ / "bg/ramp.png", picture(60));
    put(set_ / "bg/stone.png", picture(2));
  }
  const fs::path set_ = [this] {
    fs::create_directories(scratch_ / "set");
    return scratch_ / "set";
  }();
};

TEST_F(ImportSequence, FramesComeInOrderWithTheBackgroundsOfTheirKind) {
  ASSERT_EQ(run({"import", set_.string(), "--sequence", "ramp_dark"}).status, 0);
  std::vector<int> expected(12);
  for (int i = 0; i < 12; ++i) expected[i] = 10 + i;
  EXPECT_EQ(marks(true), expected);
  EXPECT_EQ(marks(false), std::vector{60});
  EXPECT_EQ(server_.sessions_.begun[0].manifest().monitors(0).width_px(), 64);
  EXPECT_EQ(server_.sessions_.begun[0].manifest().camera().width_px(), kWidth);
}

TEST_F(ImportSequence, ANoisySequenceGetsNoisyBackgrounds) {
  ASSERT_EQ(run({"import", set_.string(), "--sequence", "ramp_light_noise"}).status, 0);
  EXPECT_EQ(marks(true).size(), 12u);
  EXPECT_EQ(marks(false), (std::vector{70, 71, 72}));
}

TEST_F(ImportSequence, WhatIsNotThereIsSaid) {
  expect_one_line_error(run({"import", set_.string(), "--sequence", "ramp_bright"}),
                        "it has: ramp_dark, ramp_light_noise");
  expect_one_line_error(run({"import", set_.string(), "--sequence", "stilllife_dark"}), "it has: ramp_dark");
  expect_one_line_error(run({"import", set_.string(), "--sequence", "ramp_dark", "--empty-frames", "3"}),
                        "is an archive");
  const Outcome whole =
      run({"import", set_.string(), "--sequence", "ramp_dark", "--archive", (scratch_ / "whole").string()});
  EXPECT_EQ(whole.err, "");
  fs::rename(set_ / "ramp_dark/5.png", set_ / "ramp_dark/15.png");
  const Outcome holes =
      run({"import", set_.string(), "--sequence", "ramp_dark", "--archive", (scratch_ / "holes").string()});
  EXPECT_EQ(holes.status, 0);
  EXPECT_NE(holes.err.find("ramp_dark lacks 4 of its numbers"), std::string::npos) << holes.err;
  put(set_ / "ramp_dark/5.png", picture(3, kWidth + 1));
  expect_one_line_error(run({"import", set_.string(), "--sequence", "ramp_dark"}),
                        "ramp_dark/5.png is 33x16");
  fs::remove_all(set_ / "bg");
  expect_one_line_error(run({"import", set_.string(), "--sequence", "ramp_dark"}),
                        "no picture of the empty stage");
  expect_nothing_sent();
}

TEST_F(ImportVideo, AFolderOfPicturesStartsWithTheEmptyStage) {
  const fs::path folder = scratch_ / "clip";
  for (int i = 0; i < 11; ++i) put(folder / fmt::format("frame{}.png", i), picture(i));
  put(folder / "cover.png", picture(99));  // without a number
  const std::vector<std::string> command{"import",     folder.string(), "--monitor",
                                         "back:64x48", "--response",    "linear"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), command.begin(), command.end());
    return run(more);
  };
  expect_one_line_error(with({}), "--empty-frames is 0");
  expect_one_line_error(with({"--empty-frames", "11"}), "1 to 10, or --empty must name a directory");
  expect_one_line_error(run({"import", folder.string(), "--empty-frames", "2"}),
                        "--monitor is given 0 times");
  expect_nothing_sent();
  ASSERT_EQ(with({"--empty-frames", "2"}).status, 0);
  EXPECT_EQ(marks(false), (std::vector{0, 1}));
  EXPECT_EQ(marks(true), (std::vector{2, 3, 4, 5, 6, 7, 8, 9, 10}));
}

TEST_F(ImportVideo, TheEmptyStageMayLieElsewhere) {
  for (int i = 0; i < 3; ++i) {
    put(scratch_ / fmt::format("clip/{}.png", i), picture(i));
    put(scratch_ / fmt::format("empty/{}.png", i), picture(50 + i));
  }
  const std::vector<std::string> command{
      "import",  (scratch_ / "clip").string(), "--monitor", "back:64x48", "--response", "linear",
      "--empty", (scratch_ / "empty").string()};
  put(scratch_ / "clip/1.png", picture(1, kWidth + 2));
  expect_one_line_error(run(command), (scratch_ / "clip/1.png").string() + " is 34x16");
  expect_nothing_sent();
  put(scratch_ / "clip/1.png", picture(1));
  ASSERT_EQ(run(command).status, 0);
  EXPECT_EQ(marks(false), (std::vector{50, 51, 52}));
  EXPECT_EQ(marks(true), (std::vector{0, 1, 2}));
}

TEST_F(ImportVideo, AVideoFileIsDecodedAsFarAsItCanBe) {
  const fs::path path = scratch_ / "clip.avi";
  {
    constexpr int kWide = 128, kHigh = 96;
    absl::StatusOr<VideoWriter> writer = VideoWriter::create(path, kWide, kHigh, 25.0);
    if (!writer.ok()) GTEST_SKIP() << writer.status();
    std::mt19937 random(1);
    for (int i = 0; i < 20; ++i) {
      // Even above, and below what no codec makes small, so that frames are most of the file.
      RadianceImage radiance(kWide, kHigh);
      for (size_t at = 0; at < radiance.samples.size(); ++at) {
        const int code = at < radiance.samples.size() / 2 ? 10 * (i + 1) : static_cast<int>(random() % 256);
        radiance.samples[at] = linear_of_srgb(static_cast<float>(code) / 255.0f);
      }
      ASSERT_OK(writer->add(radiance));
    }
    ASSERT_OK(writer->finish());
  }
  const std::vector<std::string> command{"import",     path.string(),    "--monitor",
                                         "back:64x48", "--empty-frames", "5"};
  Outcome outcome = run(command);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_EQ(marks(false).size(), 5u);
  const std::vector<int> with = marks(true);
  ASSERT_EQ(with.size(), 15u);
  // sRGB unless told otherwise. Motion JPEG keeps an even gray to a code or two of 255, 0.02 of light.
  for (size_t i = 0; i < with.size(); ++i)
    EXPECT_NEAR(with[i] / 255.0, linear_of_srgb(static_cast<float>(10 * (i + 6)) / 255.0f), 0.02);

  fs::resize_file(path, fs::file_size(path) * 3 / 5);
  server_.archive_.manifest.clear_frames();
  outcome = run(command);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const int kept = server_.archive_.manifest.frames_size();
  EXPECT_GT(kept, 5);
  EXPECT_LT(kept, 20);
  EXPECT_NE(outcome.err.find(fmt::format("ends early: {} frames could be decoded", kept)), std::string::npos)
      << outcome.err;

  fs::resize_file(path, 100);
  expect_one_line_error(run(command), "clip.avi");
}

}  // namespace
}  // namespace glasswing
