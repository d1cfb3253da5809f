#include "core/archive/fsck_command.h"

#include <nlohmann/json.hpp>

#include "core/daemon/daemon_options.h"
#include "tests/core/archive/made_archive.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class FsckCommand : public ArchiveTest {
 protected:
  void SetUp() override {
    v1::CaptureManifest header = MadeArchive::header();
    v1::Monitor& monitor = *header.add_monitors();
    monitor.set_name("back");
    monitor.set_width_px(8);
    monitor.set_height_px(6);
    const std::shared_ptr<Archive> archive = Archive::create(root_ / "s", header).value();
    for (int step = 0; step < MadeArchive::kFrames; ++step) {
      Archive::NewFrame frame;
      frame.record.set_step(step);
      frame.record.mutable_stimulus()->set_kind("solid");
      frame.image = Image16(MadeArchive::kWidth, MadeArchive::kHeight);
      ASSERT_OK(archive->add({frame}));
    }
    ASSERT_OK(archive->seal());
  }
  // `fsck ARGUMENTS` of a daemon; what it printed is in output_ and errors_.
  int run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"glasswing-test", "fsck"});
    std::vector<const char*> texts;
    for (const std::string& text : arguments) texts.push_back(text.c_str());
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const int status = run_daemon(
        static_cast<int>(texts.size()), texts.data(),
        {.name = "glasswing-test",
         .description = "A test.",
         .footer = "",
         .build = "",
         .add_options =
             [&](CLI::App& app, DaemonOptions& options) {
               add_listen_options(app, options.listen);
               add_fsck_command(app, options, "DIR");
             },
         .run = [](const CLI::App&, const DaemonOptions&) { return absl::InternalError("no command"); }});
    output_ = testing::internal::GetCapturedStdout();
    errors_ = testing::internal::GetCapturedStderr();
    return status;
  }
  fs::path frame() const { return root_ / "s" / MadeArchive::file(2); }

  std::string output_, errors_;
};

TEST_F(FsckCommand, SaysThatAllIsGood) {
  EXPECT_EQ(run({root_.string()}), 0);
  EXPECT_NE(output_.find("everything is intact"), std::string::npos) << output_;
  EXPECT_NE(output_.find(root_.string() + ": archives, "), std::string::npos) << output_;
}

TEST_F(FsckCommand, SaysWhatIsDamagedAndWhatItRepairs) {
  write_over(frame(), 1000, 'x');
  EXPECT_EQ(run({root_.string()}), kDamage);
  EXPECT_NE(output_.find(frame().string()), std::string::npos) << output_;
  EXPECT_NE(output_.find("1 damaged, 0 of them repaired"), std::string::npos) << output_;
  EXPECT_TRUE(fs::exists(frame())) << "without --repair nothing changes";
  run({root_.string(), "--repair"});
  EXPECT_NE(output_.find("1 of them repaired"), std::string::npos) << output_;
}

TEST_F(FsckCommand, WritesJsonAndItsProgress) {
  write_over(frame(), 1000, 'x');
  EXPECT_EQ(run({root_.string(), "--json", "--show-progress"}), kDamage);
  const nlohmann::json report = nlohmann::json::parse(output_);
  EXPECT_EQ(report["kind"], "archives");
  EXPECT_EQ(report["damage_left"], 1);
  EXPECT_EQ(report["findings"].size(), 1u);
  EXPECT_EQ(report["findings"][0]["file"], frame().string());
  EXPECT_EQ(report["findings"][0]["damage"], true);
  EXPECT_GE(report["files"], MadeArchive::kFrames);
  EXPECT_NE(errors_.find(std::string(kProgressLine) + "1"), std::string::npos) << errors_;
}

TEST_F(FsckCommand, NamesWhatIsNotThere) {
  EXPECT_EQ(run({(root_ / "nothing").string()}), 1);
  EXPECT_NE(errors_.find((root_ / "nothing").string()), std::string::npos) << errors_;
}

}  // namespace
}  // namespace glasswing
