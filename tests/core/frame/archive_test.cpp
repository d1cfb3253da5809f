#include "core/frame/archive.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <limits>
#include <random>

#include "core/base/checksum.h"
#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/import/foreign_manifest.h"
#include "tests/core/file/flipped.h"
#include "tests/core/frame/archive_rows.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

Image16 noise(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  Image16 image(width, height);
  for (std::uint16_t& sample : image.samples) sample = static_cast<std::uint16_t>(random());
  return image;
}

class ArchiveTest : public testing::Test {
 protected:
  void SetUp() override {
    header_.set_session("s");
    header_.mutable_camera()->set_width_px(5);
    header_.mutable_camera()->set_height_px(4);
    v1::Monitor& monitor = *header_.add_monitors();
    monitor.set_name("back");
    monitor.set_width_px(8);
    monitor.set_height_px(6);
  }

  Archive::NewFrame frame(int step) const {
    v1::Frame record;
    record.set_step(step);
    record.set_object(true);
    record.mutable_stimulus()->set_kind("solid");
    return {.record = record, .image = noise(5, 4, static_cast<unsigned>(step))};
  }

  const TemporaryDirectory root_;
  const fs::path directory_ = root_ / "s";
  v1::CaptureManifest header_;
};

TEST_F(ArchiveTest, FramesComeBackAfterAnEndWithoutWarning) {
  {
    const auto archive = Archive::create(directory_, header_).value();
    ASSERT_OK(archive->add({frame(0), frame(1)}));
  }
  // A crash leaves a torn line.
  std::ofstream(directory_ / "frames.jsonl", std::ios::app) << "{\"file\": \"frames/0000";
  const auto archive = Archive::open(directory_).value();
  EXPECT_EQ(archive->manifest().frames_size(), 2);
  ASSERT_OK(archive->add({frame(2)}));
  const auto again = Archive::open(directory_).value();
  ASSERT_EQ(again->manifest().frames_size(), 3);
  for (int step = 0; step < 3; ++step) {
    const std::string rows = read_rows(*again, again->manifest().frames(step).file(), 1, 2).value();
    const Image16 image = noise(5, 4, static_cast<unsigned>(step));
    EXPECT_EQ(rows, std::string(reinterpret_cast<const char*>(&image.samples[15]), 60));
  }
}

// Not durable, since tests write often.
void overwrite(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

TEST_F(ArchiveTest, NoByteOfItsListsIsAlteredUnnoticed) {
  header_.mutable_plan()->set_method("gaussian");
  header_.mutable_camera()->set_gain(0.0123456789);
  std::string known;
  {
    const auto archive = Archive::create(directory_, header_).value();
    ASSERT_OK(archive->add({frame(0), frame(1)}));
    ASSERT_OK(archive->add({frame(2)}));
    ASSERT_OK(archive->seal());
    known = archive->manifest().SerializeAsString();
  }
  const auto expect_noticed = [&](const fs::path& path, const auto& read) {
    const std::string bytes = read_file(path).value();
    int refused = 0;
    for_each_flip(bytes, 0, 1, [&](const std::string& altered, size_t at) {
      overwrite(path, altered);
      const absl::StatusOr<v1::CaptureManifest> manifest = read();
      refused += !manifest.ok();
      if (manifest.ok()) {
        EXPECT_EQ(manifest->SerializeAsString(), known) << path << ", byte " << at;
      }
    });
    EXPECT_GT(refused, 0);
    overwrite(path, bytes);
  };
  const auto opened = [&]() -> absl::StatusOr<v1::CaptureManifest> {
    const absl::StatusOr<std::unique_ptr<Archive>> archive = Archive::open(directory_);
    if (!archive.ok()) return archive.status();
    return (*archive)->manifest();
  };
  expect_noticed(directory_ / "header.json", opened);
  expect_noticed(directory_ / "frames.jsonl", opened);
  expect_noticed(directory_ / "manifest.json", [&] { return read_any_manifest(directory_); });
}

TEST_F(ArchiveTest, NoByteOfAFrameIsAlteredUnnoticed) {
  const auto archive = Archive::create(directory_, header_).value();
  ASSERT_OK(archive->add({frame(0)}));
  const std::string file = archive->manifest().frames(0).file();
  const std::string bytes = read_file(directory_ / file).value();
  const auto once_more = Archive::open(directory_).value();
  for_each_flip(bytes, 0, 1, [&](const std::string& altered, size_t at) {
    overwrite(directory_ / file, altered);
    // A new Archive has no cached verification.
    const absl::Status status = read_rows(*Archive::open(directory_).value(), file, 0, 4).status();
    EXPECT_TRUE(absl::IsDataLoss(status)) << "byte " << at << ": " << status;
  });
}

TEST_F(ArchiveTest, AStepIsStoredOnce) {
  const auto archive = Archive::create(directory_, header_).value();
  ASSERT_OK(archive->add({frame(3)}));
  Archive::NewFrame other = frame(3);
  other.image = noise(5, 4, 99);
  const std::vector<v1::Frame> stored = archive->add({other}).value();
  EXPECT_EQ(archive->manifest().frames_size(), 1);
  EXPECT_EQ(stored[0].checksum(), archive->manifest().frames(0).checksum());
  EXPECT_EQ(decode_tiff(archive->read_frame_bytes(stored[0].file()).value()).value().samples,
            noise(5, 4, 3).samples);
}

TEST_F(ArchiveTest, NoFrameIsStoredOverAnother) {
  const auto archive = Archive::create(directory_, header_).value();
  // The same step twice in a batch is one frame, as in two batches.
  const std::vector<v1::Frame> stored = archive->add({frame(3), frame(3)}).value();
  ASSERT_EQ(stored.size(), 2u);
  EXPECT_EQ(archive->manifest().frames_size(), 1);
  Archive::NewFrame named = frame(7);
  named.record.set_file("frames/000004.tif");
  ASSERT_OK(archive->add({named}));
  EXPECT_TRUE(absl::IsAlreadyExists(archive->add({frame(4)}).status()));
  Archive::NewFrame other = frame(8);
  other.record.set_file("frames/000009.tif");
  EXPECT_TRUE(absl::IsAlreadyExists(archive->add({other, frame(9)}).status()));
  const v1::CaptureManifest manifest = archive->manifest();
  EXPECT_OK(check_manifest(manifest));
  for (const v1::Frame& each : manifest.frames())
    EXPECT_OK(archive->read_frame_bytes(each.file())) << each.file();
}

TEST_F(ArchiveTest, AFileHasOneName) {
  const auto archive = Archive::create(directory_, header_).value();
  const v1::Frame stored = archive->add({frame(0)}).value()[0];
  const std::string bytes = archive->read_frame_bytes(stored.file()).value();
  for (const char* spelling :
       {"frames//000000.tif", "frames/./000000.tif", "./frames/000000.tif", "frames/../frames/000000.tif",
        "/frames/000000.tif", "frames/", "frames/.", "frames/..", "frames/.hidden.tif", "frames",
        "000000.tif", "header.json", "frames/sub/000000.tif"}) {
    Archive::NewFrame other = frame(1);
    other.record.set_file(spelling);
    const absl::Status refused = archive->add({other}).status();
    EXPECT_TRUE(absl::IsInvalidArgument(refused)) << spelling << ": " << refused;
    const std::string copy = encode_tiff(other.image);
    other.record.set_checksum(checksum_of(copy));
    EXPECT_TRUE(absl::IsInvalidArgument(archive->add_copies({{.record = other.record, .bytes = copy}})))
        << spelling;
  }
  EXPECT_EQ(archive->manifest().frames_size(), 1);
  EXPECT_EQ(read_file(directory_ / stored.file()).value(), bytes);
}

TEST_F(ArchiveTest, ASealedArchiveTakesNoNewFrames) {
  {
    const auto archive = Archive::create(directory_, header_).value();
    ASSERT_OK(archive->add({frame(0)}));
    ASSERT_OK(archive->seal());
    EXPECT_TRUE(absl::IsFailedPrecondition(archive->add({frame(1)}).status()));
  }
  const auto again = Archive::open(directory_).value();
  EXPECT_TRUE(absl::IsFailedPrecondition(again->add({frame(1)}).status()));
  // Asked for again, as after a lost answer, what it has is there.
  EXPECT_EQ(again->add({frame(0)}).value()[0].checksum(), again->manifest().frames(0).checksum());
  EXPECT_EQ(again->manifest().frames_size(), 1);
  EXPECT_FALSE(fs::exists(directory_ / "frames/000001.tif"));
}

TEST_F(ArchiveTest, DroppedFramesAreTakenAgain) {
  const auto archive = Archive::create(directory_, header_).value();
  ASSERT_OK(archive->add({frame(0), frame(1), frame(2)}));
  ASSERT_OK(archive->map("frames/000001.tif"));
  const std::string before = archive->manifest().frames(1).checksum();
  ASSERT_OK(archive->seal());
  const auto dropped = archive->drop([](int step) { return step == 1; });
  ASSERT_OK(dropped);
  EXPECT_FALSE(fs::exists(directory_ / "frames/000001.tif"));
  EXPECT_FALSE(archive->map("frames/000001.tif").ok());
  for (const v1::CaptureManifest& manifest :
       {archive->manifest(), Archive::open(directory_).value()->manifest()}) {
    ASSERT_EQ(manifest.frames_size(), 2);
    EXPECT_EQ(manifest.frames(0).step(), 0);
    EXPECT_EQ(manifest.frames(1).step(), 2);
  }
  Archive::NewFrame again = frame(1);
  again.image = noise(5, 4, 77);
  const auto added = archive->add({again});
  ASSERT_OK(added);
  EXPECT_NE(added->front().checksum(), before);
  ASSERT_OK(archive->seal());
  const auto reopened = Archive::open(directory_).value();
  EXPECT_EQ(reopened->manifest().frames_size(), 3);
  EXPECT_EQ(decode_tiff(reopened->read_frame_bytes("frames/000001.tif").value()).value().samples,
            again.image.samples);
}

TEST_F(ArchiveTest, DamageIsNamed) {
  std::string file;
  {
    const auto archive = Archive::create(directory_, header_).value();
    file = archive->add({frame(0)}).value()[0].file();
  }
  const std::string good = read_file(directory_ / file).value();
  std::string flipped = good;
  flipped[300] = static_cast<char>(flipped[300] ^ 1);
  for (const std::string& bytes : {flipped, good.substr(0, good.size() - 1), std::string()}) {
    ASSERT_OK(write_file_durably(directory_ / file, bytes));
    const absl::Status status = read_rows(*Archive::open(directory_).value(), file, 0, 1).status();
    EXPECT_TRUE(absl::IsDataLoss(status)) << status;
    EXPECT_NE(std::string(status.message()).find(file), std::string::npos) << status;
  }
  fs::remove(directory_ / file);
  EXPECT_TRUE(absl::IsDataLoss(read_rows(*Archive::open(directory_).value(), file, 0, 1).status()));
}

TEST_F(ArchiveTest, RowsOutsideTheFrameAreRefused) {
  const auto archive = Archive::create(directory_, header_).value();
  const std::string file = archive->add({frame(0)}).value()[0].file();
  for (const auto& [first, count] :
       std::vector<std::pair<int, int>>{{-1, 1}, {0, 0}, {3, 2}, {2147483647, 1}}) {
    EXPECT_TRUE(absl::IsInvalidArgument(read_rows(*archive, file, first, count).status()))
        << first << " " << count;
  }
  EXPECT_TRUE(absl::IsNotFound(read_rows(*archive, "frames/other.tif", 0, 1).status()));
}

TEST_F(ArchiveTest, ASealedArchiveReadsAsAnyManifest) {
  const auto archive = Archive::create(directory_, header_).value();
  ASSERT_OK(archive->add({frame(0), frame(1)}));
  ASSERT_OK(archive->seal());
  EXPECT_EQ(read_any_manifest(directory_).value().SerializeAsString(),
            archive->manifest().SerializeAsString());
}

TEST_F(ArchiveTest, IsSealedWithTheRoundsThatWereAdded) {
  header_.mutable_plan()->set_method("gaussian");
  header_.mutable_plan()->mutable_adapt();
  const auto archive = Archive::create(directory_, header_).value();
  ASSERT_OK(archive->add({frame(0)}));
  v1::Plan grown = header_.plan();
  grown.add_rounds()->set_why("edges");
  grown.set_retries(20);
  v1::Plan other = grown;
  other.set_white_every(50);
  EXPECT_TRUE(absl::IsInvalidArgument(archive->seal(&other)));
  EXPECT_FALSE(fs::exists(directory_ / "manifest.json"));
  ASSERT_OK(archive->seal(&grown));
  EXPECT_EQ(read_any_manifest(directory_).value().plan().rounds(0).why(), "edges");
  EXPECT_EQ(Archive::open(directory_).value()->manifest().plan().rounds_size(), 1);
}

// A file of the right size but of another shape, so its rows would be wrong.
TEST_F(ArchiveTest, AFrameOfAnotherShapeIsDamaged) {
  v1::Frame record;
  {
    const auto archive = Archive::create(directory_, header_).value();
    record = archive->add({frame(0)}).value()[0];
    Archive::NewFrame turned = frame(1);
    turned.image = noise(4, 5, 1);
    EXPECT_TRUE(absl::IsInvalidArgument(archive->add({turned}).status()));
  }
  const std::string turned = encode_tiff(noise(4, 5, 1));
  ASSERT_OK(write_file_durably(directory_ / record.file(), turned));
  std::string lines = read_file(directory_ / "frames.jsonl").value();
  lines.replace(lines.find(record.checksum()), record.checksum().size(), checksum_of(turned));
  lines.replace(lines.find(",\"record_checksum\""), std::string::npos,
                "}\n");  // as another program writes it
  ASSERT_OK(write_file_durably(directory_ / "frames.jsonl", lines));
  const absl::Status status = read_rows(*Archive::open(directory_).value(), record.file(), 0, 4).status();
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_NE(std::string(status.message()).find(record.file()), std::string::npos) << status;
}

TEST_F(ArchiveTest, ASizeThatNoFrameHasIsRefused) {
  const v1::Frame record = Archive::create(directory_, header_).value()->add({frame(0)}).value()[0];
  std::string lines = read_file(directory_ / "frames.jsonl").value();
  const std::string size = std::to_string(record.size_bytes());
  lines.replace(lines.find(size, lines.find("size_bytes")), size.size(), "9223372036854775807");
  lines.replace(lines.find(",\"record_checksum\""), std::string::npos, "}\n");
  ASSERT_OK(write_file_durably(directory_ / "frames.jsonl", lines));
  const absl::Status status = Archive::open(directory_).value()->map(record.file()).status();
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_NE(std::string(status.message()).find(record.file() + " is listed with 9223372036854775807 bytes"),
            std::string::npos)
      << status;
}

TEST_F(ArchiveTest, CompressedFramesComeBack) {
  header_.mutable_camera()->set_width_px(200);
  header_.mutable_camera()->set_height_px(90);
  Archive::NewFrame dim{.record = frame(0).record, .image = noise(200, 90, 5)};
  for (std::uint16_t& sample : dim.image.samples) sample %= 100;
  v1::Frame record;
  {
    const auto archive = Archive::create(directory_, header_).value();
    record = archive->add({dim}, FrameForm::kCompressed).value()[0];
  }
  EXPECT_LT(static_cast<size_t>(record.size_bytes()), tiff_size_bytes({200, 90}));
  const auto archive = Archive::open(directory_).value();
  EXPECT_EQ(decode_tiff(archive->read_frame_bytes(record.file()).value()).value().samples, dim.image.samples);
  const fs::path file = directory_ / record.file();
  fs::resize_file(file, fs::file_size(file) - 1);
  const absl::Status cut = Archive::open(directory_).value()->map(record.file()).status();
  EXPECT_TRUE(absl::IsDataLoss(cut)) << cut;
  EXPECT_NE(std::string(cut.message()).find(file.string()), std::string::npos) << cut;
}

TEST_F(ArchiveTest, AFileOfAnySizeIsNotReadToSeeThatItIsWrong) {
  const auto archive = Archive::create(directory_, header_).value();
  const std::string file = archive->add({frame(0)}).value()[0].file();
  fs::resize_file(directory_ / file, std::uintmax_t{1} << 40);  // sparse: uses no disk space
  const absl::Status status = read_rows(*archive, file, 0, 1).status();
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_NE(std::string(status.message()).find("1099511627776 bytes"), std::string::npos) << status;
}

TEST_F(ArchiveTest, WhatAManifestSaysOfItselfIsNotBelieved) {
  v1::CaptureManifest good = header_;
  good.set_format_version(1);
  for (const char* file : {"frames/a.tif", "frames/b.tif"}) good.add_frames()->set_file(file);
  ASSERT_OK(check_manifest(good));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  struct Lie {
    std::function<void(v1::CaptureManifest&)> tell;
    std::string words;
  };
  const std::vector<Lie> lies{
      {[](auto& m) { m.set_format_version(2); }, "format_version is 2"},
      {[](auto& m) { m.mutable_camera()->set_width_px(2000000000); }, "camera's size is 2000000000x4"},
      {[](auto& m) { m.mutable_camera()->set_height_px(0); }, "camera's size is 5x0"},
      {[](auto& m) { m.mutable_camera()->set_height_px(-4); }, "camera's size is 5x-4"},
      {[](auto& m) { m.mutable_camera()->set_read_sd(-1.0); }, "read_sd is -1"},
      {[&](auto& m) { m.mutable_camera()->set_gain(nan); }, "camera: gain is nan"},
      {[&](auto& m) { (*m.mutable_axes())["turn"] = nan; }, "axis \"turn\" is at nan"},
      {[](auto& m) { m.clear_monitors(); }, "no monitor"},
      {[](auto& m) { m.mutable_monitors(0)->set_width_px(0); }, "monitor \"back\" is 0x6"},
      {[&](auto& m) { *m.add_monitors() = m.monitors(0); }, "\"back\" twice"},
      {[](auto& m) {
         for (int i = 0; i < 5000; ++i) {
           *m.add_monitors() = m.monitors(0);
           m.mutable_monitors(i + 1)->set_name(std::to_string(i));
         }
       },
       "names 5001 monitors; at most 64"},
      {[](auto& m) { m.clear_frames(); }, "no frames"},
      {[](auto& m) { m.mutable_frames(1)->set_file("frames/a.tif"); }, "frames/a.tif is listed twice"},
      {[](auto& m) { m.mutable_frames(1)->set_file("frames/../../b.tif"); }, "frames/../../b.tif"},
      {[](auto& m) { m.mutable_frames(1)->set_file("/etc/passwd"); }, "/etc/passwd"},
      {[](auto& m) { m.mutable_frames(1)->set_file(std::string("b\0.tif", 6)); }, "inside the archive"},
      {[](auto& m) { m.mutable_frames(1)->set_file(""); }, "inside the archive"},
      {[](auto& m) { m.mutable_frames(1)->set_size_bytes(-1); }, "frames/b.tif: size_bytes is -1"},
      {[&](auto& m) { m.mutable_frames(1)->set_exposure_ms(nan); }, "frames/b.tif: exposure_ms is nan"},
      {[&](auto& m) { m.mutable_frames(1)->mutable_stimulus()->set_r_px(INFINITY); },
       "frames/b.tif: stimulus.r_px is inf"},
      {[&](auto& m) { m.mutable_frames(1)->mutable_stimulus()->add_colour(nan); },
       "stimulus.colour[0] is nan"},
      {[&](auto& m) { m.mutable_frames(1)->add_also_lit()->set_peak(nan); }, "also_lit[0].peak is nan"},
      {[&](auto& m) { m.mutable_plan()->add_exposure_ms(nan); }, "plan: exposure_ms[0] is nan"}};
  for (const Lie& lie : lies) {
    v1::CaptureManifest manifest = good;
    lie.tell(manifest);
    const absl::Status status = check_manifest(manifest);
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << lie.words;
    EXPECT_NE(std::string(status.message()).find(lie.words), std::string::npos) << status;
  }
}

TEST_F(ArchiveTest, NothingIsStoredThatCouldNotBeReadAgain) {
  v1::CaptureManifest huge = header_;
  huge.mutable_camera()->set_width_px(1 << 30);
  EXPECT_TRUE(absl::IsInvalidArgument(Archive::create(directory_, huge).status()));
  const auto archive = Archive::create(directory_, header_).value();
  Archive::NewFrame strange = frame(0);
  strange.record.mutable_stimulus()->set_r_px(std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(absl::IsInvalidArgument(archive->add({strange}).status()));
  strange = frame(0);
  strange.record.set_file("../a.tif");
  EXPECT_TRUE(absl::IsInvalidArgument(archive->add({strange}).status()));
  EXPECT_EQ(Archive::open(directory_).value()->manifest().frames_size(), 0);
}

TEST_F(ArchiveTest, LinesThatCannotBeTrueAreNamed) {
  { const auto archive = Archive::create(directory_, header_).value(); }
  for (const char* line :
       {R"({"file": "../a.tif"})", R"({"file": "a.tif", "exposure_ms": "NaN"})", "{", "[]"}) {
    std::ofstream(directory_ / "frames.jsonl") << line << "\n";
    const absl::Status status = Archive::open(directory_).status();
    EXPECT_TRUE(absl::IsDataLoss(status)) << status;
    EXPECT_NE(std::string(status.message()).find("frames.jsonl"), std::string::npos) << status;
  }
}

TEST_F(ArchiveTest, ForeignManifestsAreTranslated) {
  const auto written = [&](const std::string& text) {
    std::ofstream(root_ / "manifest.json") << text;
    return read_any_manifest(root_);
  };
  const std::string frames =
      R"("frames": [{"file": "a.png", "object": true, "stimulus": {"kind": "gauss_stripe", "phi_deg": -45, "r_px": -3.5,
          "sigma_px": 4, "peak": 1, "colour": [1, 1, 1], "panel": "left", "unknown": 3}}])";
  const auto manifest =
      written(R"({"monitor": {"left": {"width": 8, "height": 6}, "back": {"width": 9, "height": 7}},
      "image": {"width": 3, "height": 2}, )" +
              frames + "}")
          .value();
  EXPECT_EQ(manifest.monitors(0).name(), "left");  // in the file's order
  EXPECT_EQ(manifest.monitors(1).width_px(), 9);
  EXPECT_EQ(manifest.frames(0).stimulus().r_px(), -3.5);
  EXPECT_EQ(manifest.frames(0).proof(), v1::PROOF_IMPORTED);
  for (
      const std::string& bad :
      {std::string("{"), std::string("[]"), std::string("{}"),
       R"({"monitor": {"back": {"width": 0, "height": 7}}, "image": {"width": 3, "height": 2}, )" + frames +
           "}",
       R"({"monitor": {"back": {"width": 4, "height": 7}}, "image": {"width": "3", "height": 2}, )" + frames +
           "}",
       std::string(
           R"({"monitor": {"b": {"width": 4, "height": 7}}, "image": {"width": 3, "height": 2}, "frames": []})"),
       std::string(R"({"monitor": {"b": {"width": 4, "height": 7}}, "image": {"width": 3, "height": 2},
            "frames": [{"file": "../a.png", "object": true, "stimulus": {"kind": "solid"}}]})")}) {
    const absl::Status status = written(bad).status();
    EXPECT_FALSE(status.ok()) << bad;
    EXPECT_NE(std::string(status.message()).find("manifest.json"), std::string::npos) << status;
  }
}

}  // namespace
}  // namespace glasswing
