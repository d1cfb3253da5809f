// `glasswing-server fsck` on a server's data, each damage made by hand.
#include "core/archive/fsck.h"

#include <gtest/gtest.h>

#include "core/base/checksum.h"
#include "core/file/file.h"
#include "core/matte/matte_file.h"
#include "server/fsck/check_server.h"
#include "server/services/server.h"
#include "server/storage/image_name.h"
#include "server/storage/matte_files.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

std::string matte() {
  Matte matte(0, 0, 5, 40, 1);
  matte.metadata.set_format_version(1);
  matte.metadata.add_monitors()->set_name("back");
  matte.metadata.set_width_px(5);
  matte.metadata.set_height_px(40);
  return encode_matte(matte).value();
}

v1::Session session(const std::string& name, v1::SessionState state) {
  v1::Session session;
  session.set_name(name);
  session.set_state(state);
  session.set_method("alpha");
  return session;
}

class FsckServer : public testing::Test {
 protected:
  // A session that is done, a video that is done, and one that is being solved: one of its two tiles is
  // there.
  void SetUp() override {
    { ASSERT_OK(Server::open({.data = data_})); }
    catalogue_ = Catalogue::open(data_ / "catalogue.sqlite").value();
    v1::Session done = session("done", v1::SESSION_STATE_DONE),
                solving = session("solving", v1::SESSION_STATE_SOLVING),
                video = session("video", v1::SESSION_STATE_DONE);
    done.set_matte_ready(true);
    video.set_matte_ready(true);
    video.set_method("ramp");
    video.set_frame_count(3);
    for (const int frame : {0, 1, 2}) video.add_solved_frames(frame);
    fs::create_directories(data_ / "mattes/video");
    for (const int frame : {0, 1, 2}) write(files_.finished("video", frame), matte());
    write(files_.finished("done"), matte());
    const auto jobs = open_job_store("", data_, {.server_id = "id", .server_address = ""}, problems_).value();
    const std::vector<TileRange> tiles = {{.first = 0, .count = 20}, {.first = 20, .count = 20}};
    const std::vector<std::string> computes = {"c"};
    solving.set_job(jobs->create({.session = "solving", .computes = "c", .work = ""}, tiles).value());
    const Lease lease = jobs->claim("solver", computes, false).value().value();
    const std::string name = tile_name(lease.id.job, lease.id.tile, lease.id.attempt, checksum_of(matte()));
    tile_ = files_.tiles("solving").value() / name;
    write(tile_, matte());
    ASSERT_OK(jobs->complete(lease.id, {.result = name}));
    for (const v1::Session& each : {done, video, solving}) ASSERT_OK(catalogue_->insert(each, ""));
    write(data_ / "images" / image_name("png"), "png");
    write(data_ / "calibration/camera-c.json", "{\"camera\": \"c\"}");
  }

  void write(const fs::path& path, const std::string& bytes) { ASSERT_OK(write_file_durably(path, bytes)); }
  void flip(const fs::path& file) {
    std::string bytes = read_file(file).value();
    const size_t at = bytes.size() - 9;
    bytes[at] = static_cast<char>(bytes[at] ^ 1);
    write(file, bytes);
  }
  CheckReport check(bool repair = false) {
    catalogue_.reset();
    const absl::StatusOr<CheckReport> report = fsck(data_, {.repair = repair, .check_server = check_server});
    EXPECT_OK(report);
    if (repair) catalogue_ = Catalogue::open(data_ / "catalogue.sqlite").value();
    return report.value_or(CheckReport());
  }
  void expect_mends(const fs::path& file, bool is_damage = true) {
    for (const bool repair : {false, true}) {
      const CheckReport report = check(repair);
      ASSERT_EQ(report.findings.size(), 1u) << file;
      EXPECT_EQ(report.findings[0].file, file.string());
      EXPECT_EQ(report.findings[0].is_damage, is_damage);
      EXPECT_EQ(report.findings[0].repaired, repair) << report.findings[0].error;
    }
    EXPECT_TRUE(check(true).findings.empty());
    EXPECT_OK(Server::open({.data = data_}));
  }
  bool is_aside(const fs::path& file) const {
    return !fs::exists(file) && fs::exists(data_ / "damaged" / file.lexically_relative(data_));
  }

  const TemporaryDirectory data_;
  const MatteFiles files_{data_};
  Problems problems_;
  fs::path tile_;
  std::unique_ptr<Catalogue> catalogue_;
};

TEST_F(FsckServer, WhatIsWholeIsClean) {
  const CheckReport report = check(true);
  EXPECT_EQ(report.kind, "server");
  EXPECT_TRUE(report.findings.empty()) << report.findings[0].file << ": " << report.findings[0].what;
  EXPECT_EQ(report.file_count, 3 + 4 + 1 + 1 + 1 + 1);  // databases, mattes, tile, image, calibration, id
}

TEST_F(FsckServer, ASessionWhoseMatteIsDamagedCanBeSolvedAgain) {
  flip(files_.finished("done"));
  expect_mends(files_.finished("done"));
  EXPECT_TRUE(is_aside(files_.finished("done")));
  const v1::Session mended = catalogue_->find("done").value();
  EXPECT_EQ(mended.state(), v1::SESSION_STATE_CAPTURED);
  EXPECT_FALSE(mended.matte_ready());
  EXPECT_NE(mended.reason().find("glasswing solve done"), std::string::npos) << mended.reason();
}

TEST_F(FsckServer, ATruncatedMatteIsFoundAtEveryLength) {
  const std::string whole = read_file(files_.finished("done")).value();
  for (size_t size = 0; size < whole.size(); size += 97) {
    write(files_.finished("done"), whole.substr(0, size));
    const CheckReport report = check();
    ASSERT_EQ(report.findings.size(), 1u) << size;
    EXPECT_EQ(report.findings[0].file, files_.finished("done").string());
  }
}

TEST_F(FsckServer, AMatteThatIsMissingIsFoundToo) {
  fs::remove(files_.finished("done"));
  expect_mends(files_.finished("done"));
}

TEST_F(FsckServer, TheOtherFramesOfAVideoStay) {
  flip(files_.finished("video", 1));
  expect_mends(files_.finished("video", 1));
  EXPECT_TRUE(is_aside(files_.finished("video", 1)));
  const v1::Session mended = catalogue_->find("video").value();
  EXPECT_EQ(std::vector<int>(mended.solved_frames().begin(), mended.solved_frames().end()),
            (std::vector<int>{0, 2}));
  EXPECT_TRUE(mended.matte_ready());
}

TEST_F(FsckServer, ADamagedTileIsSolvedAnew) {
  flip(tile_);
  expect_mends(tile_);
  EXPECT_TRUE(is_aside(tile_));
  const std::int64_t job = catalogue_->find("solving")->job();
  const JobCounts counts = open_job_store("", data_, {.server_id = "id", .server_address = ""}, problems_)
                               .value()
                               ->counts(job)
                               .value();
  EXPECT_EQ(counts.done, 0);
  EXPECT_EQ(counts.tiles, 2);
}

TEST_F(FsckServer, PicturesCalibrationsAndTheIdAreSetAside) {
  for (const fs::path& file : {data_ / "images" / image_name("png"), data_ / "calibration/camera-c.json"}) {
    write(file, "{");
    expect_mends(file);
    EXPECT_TRUE(is_aside(file));
  }
  write(data_ / "server-id", "short");
  expect_mends(data_ / "server-id");
  EXPECT_EQ(read_file(data_ / "damaged/server-id").value(), "short");
}

TEST_F(FsckServer, ARecordThatCannotBeReadKeepsTheServerFromNothing) {
  catalogue_.reset();
  ASSERT_OK(Database::open(data_ / "catalogue.sqlite")
                ->run("UPDATE sessions SET session = x'ff' WHERE name = 'done'"));
  {
    const std::unique_ptr<Server> server = Server::open({.data = data_}).value();
    EXPECT_TRUE(absl::IsDataLoss(server->sessions().find("done").status()));
    EXPECT_OK(server->sessions().find("video"));
  }
  const CheckReport report = check(true);
  ASSERT_EQ(report.findings.size(), 1u);
  EXPECT_NE(report.findings[0].what.find("\"done\""), std::string::npos) << report.findings[0].what;
  EXPECT_TRUE(fs::exists(data_ / "damaged/sessions/done"));
  EXPECT_OK(Server::open({.data = data_}));
  EXPECT_OK(catalogue_->find("video"));
  // Its matte is now of nobody.
  expect_mends(files_.finished("done"), false);
  EXPECT_TRUE(is_aside(files_.finished("done")));
}

TEST_F(FsckServer, WithoutItsCatalogueOnlyABackupHelps) {
  catalogue_.reset();
  write(data_ / "catalogue.sqlite", std::string(8192, 'x'));
  const absl::StatusOr<CheckReport> report = fsck(data_, {.repair = true, .check_server = check_server});
  ASSERT_OK(report);
  ASSERT_EQ(report->findings.size(), 1u);
  EXPECT_TRUE(report->findings[0].repair.empty());
  EXPECT_TRUE(fs::exists(data_ / "catalogue.sqlite"));
}

TEST_F(FsckServer, AJobStoreThatCannotBeReadIsBegunAnew) {
  write(data_ / "jobs.sqlite", std::string(8192, 'x'));
  for (const char* part : {"-wal", "-shm"}) fs::remove(data_ / (std::string("jobs.sqlite") + part));
  expect_mends(data_ / "jobs.sqlite");
  EXPECT_EQ(Catalogue::open(data_ / "catalogue.sqlite").value()->find("solving")->state(),
            v1::SESSION_STATE_CAPTURED);
}

TEST_F(FsckServer, WhatBrokenOffWritesLeftIsNoDamage) {
  const fs::path file = data_ / "mattes/done.exr.17.tmp";
  write(file, "half");
  expect_mends(file, false);
  EXPECT_FALSE(fs::exists(file));
}

TEST_F(FsckServer, AMattesFileAloneIsCheckedRowByRow) {
  const fs::path file = files_.finished("done");
  EXPECT_TRUE(fsck(file, {})->findings.empty());
  flip(file);
  EXPECT_EQ(fsck(file, {})->findings.size(), 1u);
}

}  // namespace
}  // namespace glasswing
