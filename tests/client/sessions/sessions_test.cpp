// import, export, watch and fetch against a fake server.
#include <fmt/format.h>
#include <sys/stat.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "client/capture/rail_positions.h"
#include "core/base/checksum.h"
#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "tests/client/fake_server.h"
#include "tests/client/run_glasswing.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kWidth = 9, kHeight = 7;

Image16 frame_image(int number) {
  Image16 image(kWidth, kHeight);
  for (size_t i = 0; i < image.samples.size(); ++i) {
    image.samples[i] = static_cast<std::uint16_t>(i * 311 + static_cast<size_t>(number) * 1021);
  }
  return image;
}

class SessionCommands : public ScratchTest {
 protected:
  SessionCommands() {
    nlohmann::json manifest = {{"monitor", {{"back", {{"width", 128}, {"height", 96}}}}},
                               {"image", {{"width", kWidth}, {"height", kHeight}}},
                               {"frames", nlohmann::json::array()}};
    std::filesystem::create_directories(archive_ / "obj");
    for (int i = 0; i < 3; ++i) {
      const std::string file = "obj/" + std::to_string(i) + ".png";
      manifest["frames"].push_back(
          {{"file", file}, {"object", true}, {"stimulus", {{"kind", "solid"}, {"panel", "back"}}}});
      EXPECT_OK(write_file_durably(archive_ / file, encode_png16(frame_image(i)).value()));
    }
    EXPECT_OK(write_file_durably(archive_ / "manifest.json", manifest.dump()));
  }

  Outcome run(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"--server", server_.address()});
    return run_glasswing(arguments);
  }
  void expect_nothing_sent() const {
    EXPECT_TRUE(server_.sessions_.begun.empty());
    EXPECT_TRUE(server_.archive_.files.empty());
  }

  const std::filesystem::path archive_ = scratch_ / "vase";
  FakeServer server_;
};

TEST_F(SessionCommands, ImportSendsEveryFrameAsItIs) {
  const Outcome outcome = run({"import", archive_.string()});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  ASSERT_EQ(server_.sessions_.finished, std::vector<std::string>{"vase"});
  ASSERT_EQ(server_.archive_.manifest.frames_size(), 3);
  for (int i = 0; i < 3; ++i) {
    const v1::Frame& frame = server_.archive_.manifest.frames(i);
    const std::string& bytes = server_.archive_.files.at(frame.file());
    EXPECT_EQ(decode_tiff(bytes)->samples, frame_image(i).samples);
    EXPECT_EQ(frame.checksum(), checksum_of(bytes));
    EXPECT_EQ(frame.size_bytes(), static_cast<std::int64_t>(bytes.size()));
  }
  EXPECT_EQ(server_.sessions_.begun[0].manifest().session(), "vase");
  EXPECT_EQ(server_.sessions_.begun[0].manifest().frames_size(), 0);
}

TEST_F(SessionCommands, ImportNamesADamagedFrameAndSendsNothing) {
  const std::filesystem::path last = archive_ / "obj" / "2.png";
  const std::string good = read_file(last).value();
  for (size_t at = 0; at < good.size(); at += 7) {
    std::string flipped = good;
    flipped[at] = static_cast<char>(flipped[at] ^ 0x10);
    ASSERT_OK(write_file_durably(last, flipped));
    expect_one_line_error(run({"import", archive_.string()}), last.string());
  }
  ASSERT_OK(write_file_durably(last, good.substr(0, good.size() / 2)));
  expect_one_line_error(run({"import", archive_.string()}), last.string());
  std::filesystem::remove(last);
  expect_one_line_error(run({"import", archive_.string()}), last.string());
  expect_nothing_sent();
}

TEST_F(SessionCommands, ImportRefusesAFifoInPlaceOfAFrame) {
  const std::filesystem::path last = archive_ / "obj" / "2.png";
  std::filesystem::remove(last);
  ASSERT_EQ(::mkfifo(last.c_str(), 0600), 0);
  expect_one_line_error(run({"import", archive_.string()}), last.string());
  expect_nothing_sent();
}

TEST_F(SessionCommands, ImportRefusesFramesOfAnotherSize) {
  const std::filesystem::path last = archive_ / "obj" / "2.png";
  ASSERT_OK(write_file_durably(last, encode_png16(Image16(kWidth + 1, kHeight)).value()));
  expect_one_line_error(run({"import", archive_.string()}), last.string() + " is 10x7");
  expect_one_line_error(run({"import", archive_.string(), "--session", "a/b"}), "a/b");
  expect_nothing_sent();
}

TEST_F(SessionCommands, ExportedArchiveImportsAgain) {
  ASSERT_EQ(run({"import", archive_.string()}).status, 0);
  v1::CaptureManifest& stored = server_.archive_.manifest;
  stored.mutable_camera()->set_width_px(kWidth);
  stored.mutable_camera()->set_height_px(kHeight);
  *stored.mutable_monitors() = server_.sessions_.begun[0].manifest().monitors();
  stored.set_format_version(1);
  stored.set_session("vase");
  server_.sessions_.session.set_state(v1::SESSION_STATE_CAPTURED);
  const std::map<std::string, std::string> files = server_.archive_.files;
  const v1::CaptureManifest before = stored;

  const std::string exported = (scratch_ / "out" / "vase").string();
  const Outcome outcome = run({"export", "vase", exported});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  server_.archive_.files.clear();
  stored.clear_frames();
  ASSERT_EQ(run({"import", exported, "--session", "again"}).status, 0);
  EXPECT_EQ(server_.archive_.files, files);
  EXPECT_EQ(stored.SerializeAsString(), before.SerializeAsString());

  expect_one_line_error(run({"export", "vase", exported}), exported + " already exists");
}

TEST_F(SessionCommands, OwnFramesAreVerifiedWhileTheyAreSent) {
  const std::filesystem::path own = scratch_ / "own";
  ASSERT_EQ(run({"import", archive_.string(), "--archive", own.string()}).status, 0);
  const std::filesystem::path last = own / "frames" / "000002.tif";
  const std::string good = read_file(last).value();
  for (size_t at = 256; at < good.size(); at += 50) {
    std::string flipped = good;
    flipped[at] = static_cast<char>(flipped[at] ^ 0x10);
    ASSERT_OK(write_file_durably(last, flipped));
    expect_one_line_error(run({"import", own.string()}), last.string());
    EXPECT_TRUE(server_.sessions_.finished.empty());
  }
}

TEST_F(SessionCommands, ImportSendsNothingIfAFrameOfItsOwnIsCutOffOrGone) {
  const std::filesystem::path own = scratch_ / "own";
  ASSERT_EQ(run({"import", archive_.string(), "--archive", own.string()}).status, 0);
  const std::filesystem::path last = own / "frames" / "000002.tif";
  std::filesystem::resize_file(last, std::filesystem::file_size(last) / 2);
  expect_one_line_error(run({"import", own.string()}), last.string());
  std::filesystem::remove(last);
  expect_one_line_error(run({"import", own.string()}), last.string());
  expect_nothing_sent();
}

TEST_F(SessionCommands, ExportLeavesNothingOfADamagedArchive) {
  ASSERT_EQ(run({"import", archive_.string()}).status, 0);
  server_.sessions_.session.set_state(v1::SESSION_STATE_CAPTURED);
  server_.archive_.files.at("frames/000001.tif")[300] ^= 1;
  expect_one_line_error(run({"export", "vase", (scratch_ / "out" / "vase").string()}), "frames/000001.tif");
  EXPECT_TRUE(std::filesystem::is_empty(scratch_ / "out"));
}

TEST_F(SessionCommands, ExportBeginsOnlyWhereThereIsRoom) {
  ASSERT_EQ(run({"import", archive_.string()}).status, 0);
  server_.sessions_.session.set_state(v1::SESSION_STATE_CAPTURED);
  server_.sessions_.session.set_archive_bytes(std::int64_t{1} << 60);
  expect_one_line_error(run({"export", "vase", (scratch_ / "out" / "vase").string()}), "MB are missing in");
  EXPECT_TRUE(std::filesystem::is_empty(scratch_ / "out"));
}

TEST_F(SessionCommands, ExportWaitsForTheCapture) {
  server_.sessions_.session.set_state(v1::SESSION_STATE_CAPTURING);
  expect_one_line_error(run({"export", "vase", (scratch_ / "out").string()}), "must be captured");
}

TEST_F(SessionCommands, WatchSucceedsOnlyWhenCapturedOrDone) {
  v1::Session& session = server_.sessions_.session;
  session.set_name("vase");
  for (const v1::SessionState good : {v1::SESSION_STATE_CAPTURED, v1::SESSION_STATE_DONE}) {
    session.set_state(good);
    EXPECT_EQ(run({"watch", "vase"}).status, 0);
  }
  session.set_reason("take the object off the stage");
  session.set_state(v1::SESSION_STATE_PAUSED);
  expect_one_line_error(run({"watch", "vase"}),
                        "take the object off the stage; resume with: glasswing resume vase");
  for (const v1::SessionState bad : {v1::SESSION_STATE_FAILED, v1::SESSION_STATE_CANCELLED}) {
    session.set_state(bad);
    expect_one_line_error(run({"watch", "vase"}), session.reason());
  }
}

TEST_F(SessionCommands, SolveWatchSucceedsOnlyWhenDone) {
  v1::Session& session = server_.sessions_.session;
  session.set_name("vase");
  session.set_state(v1::SESSION_STATE_DONE);
  EXPECT_EQ(run({"solve", "vase", "--watch"}).status, 0);
  session.set_state(v1::SESSION_STATE_CAPTURED);  // as after glasswing cancel
  expect_one_line_error(run({"solve", "vase", "--watch"}), "solve it with: glasswing solve vase --watch");
}

TEST_F(SessionCommands, JsonHasEveryPlainField) {
  server_.sessions_.session.set_name("vase");
  server_.sessions_.session.set_state(v1::SESSION_STATE_CAPTURED);
  const Outcome outcome = run({"show", "vase", "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const nlohmann::json shown = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(shown["state"], "SESSION_STATE_CAPTURED");
  EXPECT_EQ(shown["step_count"], 0);
}

TEST_F(SessionCommands, FetchWritesOnlyAWholeMatte) {
  Matte matte(0, 0, kWidth, kHeight, 1);
  matte.metadata.set_format_version(1);
  matte.metadata.add_monitors()->set_name("back");
  matte.metadata.set_width_px(kWidth);
  matte.metadata.set_height_px(kHeight);
  server_.sessions_.matte = encode_matte(matte).value();
  const std::string path = (scratch_ / "vase.exr").string();
  ASSERT_EQ(run({"fetch", "vase", "-o", path}).status, 0);
  EXPECT_EQ(read_file(path).value(), server_.sessions_.matte);
  expect_one_line_error(run({"fetch", "vase", "-o", "vase.png"}), "must end in .exr");

  const Outcome piped = run({"fetch", "vase", "-o", "-"});
  EXPECT_EQ(piped.status, 0);
  EXPECT_TRUE(piped.out == server_.sessions_.matte);
  EXPECT_EQ(piped.err, "-: the matte of session vase, 9x7\n");

  server_.sessions_.matte.resize(server_.sessions_.matte.size() / 2);
  const std::string other = (scratch_ / "other.exr").string();
  expect_one_line_error(run({"fetch", "vase", "-o", other}), "session vase arrived damaged");
  EXPECT_FALSE(std::filesystem::exists(other));
}

TEST_F(SessionCommands, FetchAsksForARegion) {
  Matte matte(2, 1, 3, 2, 1);
  matte.metadata.set_format_version(1);
  matte.metadata.add_monitors()->set_name("back");
  matte.metadata.set_width_px(kWidth);
  matte.metadata.set_height_px(kHeight);
  server_.sessions_.matte = encode_matte(matte).value();
  const std::string path = (scratch_ / "part.exr").string();
  const Outcome outcome = run({"fetch", "vase", "-o", path, "--crop", "3x2+2+1"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find(fmt::format("3x2+2+1 of {}x{}", kWidth, kHeight)), std::string::npos)
      << outcome.out;
  const v1::MatteRegion& asked = server_.sessions_.region_fetched;
  EXPECT_EQ((std::vector{asked.x_px(), asked.y_px(), asked.width_px(), asked.height_px()}),
            (std::vector{2, 1, 3, 2}));
  EXPECT_EQ(read_file(path).value(), server_.sessions_.matte);
  for (const char* text : {"3x2", "3x2+2", "0x2+2+1", "3x2-2+1"})
    EXPECT_NE(run({"fetch", "vase", "-o", path, "--crop", text}).err.find("WIDTHxHEIGHT+X+Y"),
              std::string::npos);
}

std::string matte_of_frame(int frame, int width_px = kWidth) {
  Matte matte(0, 0, width_px, kHeight, 1);
  matte.metadata.set_format_version(1);
  matte.metadata.set_session("vase");
  matte.metadata.set_method("ramp");
  matte.metadata.set_frame(frame);
  matte.metadata.add_monitors()->set_name("back");
  matte.metadata.set_width_px(kWidth);
  matte.metadata.set_height_px(kHeight);
  return encode_matte(matte).value();
}

class VideoFetch : public SessionCommands {
 protected:
  VideoFetch() {
    session_.set_name("vase");
    session_.set_method("ramp");
    session_.set_state(v1::SESSION_STATE_DONE);
    session_.set_frame_count(7);
    for (const int frame : {2, 3}) session_.add_lost_frames(frame);
    for (const int frame : {0, 1, 4, 5, 6}) {
      session_.add_solved_frames(frame);
      server_.sessions_.frame_mattes[frame] = matte_of_frame(frame);
    }
  }
  std::vector<int> fetched_now(const std::string& directory, const std::vector<std::string>& more = {}) {
    server_.sessions_.frames_fetched.clear();
    std::vector<std::string> words{"fetch", "vase", "-o", directory};
    words.insert(words.end(), more.begin(), more.end());
    outcome_ = run(words);
    return server_.sessions_.frames_fetched;
  }

  v1::Session& session_ = server_.sessions_.session;
  Outcome outcome_;
};

TEST_F(VideoFetch, EveryFrameBecomesAFileAndIsNotFetchedTwice) {
  const std::filesystem::path directory = scratch_ / "mattes";
  EXPECT_EQ(fetched_now(directory.string() + "/"), (std::vector{0, 1, 4, 5, 6})) << outcome_.err;
  EXPECT_EQ(outcome_.status, 0);
  EXPECT_NE(outcome_.out.find("lost, not captured: frames 2 to 3"), std::string::npos) << outcome_.out;
  for (const auto& [frame, bytes] : server_.sessions_.frame_mattes)
    EXPECT_EQ(read_file(directory / ("000" + std::to_string(frame) + ".exr")).value(), bytes);
  EXPECT_FALSE(std::filesystem::exists(directory / "0002.exr"));
  EXPECT_TRUE(fetched_now(directory.string()).empty());
  EXPECT_EQ(outcome_.status, 0);

  // One file is missing, one truncated; then all are of an older solve.
  std::filesystem::remove(directory / "0001.exr");
  std::filesystem::resize_file(directory / "0004.exr", 500);
  EXPECT_EQ(fetched_now(directory.string()), (std::vector{1, 4}));
  (*session_.mutable_options())["smooth"] = "1";
  EXPECT_EQ(fetched_now(directory.string()).size(), 5u);
}

TEST_F(VideoFetch, FramesOfAnotherRegionAreFetchedAnew) {
  const std::filesystem::path directory = scratch_ / "mattes";
  EXPECT_EQ(fetched_now(directory.string() + "/").size(), 5u);
  for (auto& [frame, bytes] : server_.sessions_.frame_mattes) bytes = matte_of_frame(frame, kWidth - 1);
  const std::string region = fmt::format("{}x{}+0+0", kWidth - 1, kHeight);
  EXPECT_EQ(fetched_now(directory.string(), {"--crop", region}).size(), 5u);
  EXPECT_EQ(server_.sessions_.region_fetched.width_px(), kWidth - 1);
  EXPECT_TRUE(fetched_now(directory.string(), {"--crop", region}).empty());
  EXPECT_EQ(fetched_now(directory.string()).size(), 5u);
}

TEST_F(VideoFetch, WhatIsNotSolvedIsNamedAndTheRestIsThere) {
  session_.set_state(v1::SESSION_STATE_FAILED);
  session_.set_reason("frame 4: it is damaged");
  session_.clear_solved_frames();
  for (const int frame : {0, 1}) session_.add_solved_frames(frame);
  const std::filesystem::path directory = scratch_ / "mattes";
  EXPECT_EQ(fetched_now(directory.string()), (std::vector{0, 1}));
  EXPECT_EQ(outcome_.status, 1);
  EXPECT_NE(outcome_.err.find("3 frames are not solved: 4 to 6"), std::string::npos) << outcome_.err;
  EXPECT_NE(outcome_.err.find("frame 4: it is damaged"), std::string::npos) << outcome_.err;
  EXPECT_TRUE(std::filesystem::exists(directory / "0001.exr"));
}

TEST_F(VideoFetch, OneFrameIsAFile) {
  const std::string path = (scratch_ / "seven.exr").string();
  for (const std::string& file : {path, (scratch_ / "vase.png").string()}) {
    expect_one_line_error(run({"fetch", "vase", "-o", file}), "session vase is a video of 7 frames");
    EXPECT_FALSE(std::filesystem::exists(file));
  }
  ASSERT_EQ(run({"fetch", "vase", "-o", path, "--frame", "6"}).status, 0);
  EXPECT_EQ(read_file(path).value(), matte_of_frame(6));
}

TEST_F(VideoFetch, ShowTellsWhatTheVideoIs) {
  const Outcome outcome = run({"show", "vase"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("video     7 frames"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("2 of them: 2 to 3"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("5 of them: 0 to 1, 4 to 6"), std::string::npos) << outcome.out;
}

TEST_F(SessionCommands, ShowGivesTheReasonOfAWaitAsASentence) {
  v1::Session& session = server_.sessions_.session;
  session.set_name("vase");
  session.set_state(v1::SESSION_STATE_CAPTURING);
  session.mutable_waiting()->set_what("press the camera's button: picture 1 of 6 is due");
  session.mutable_waiting()->set_advice("the capture continues by itself when it arrives");
  const Outcome shown = run({"show", "vase"});
  EXPECT_NE(shown.out.find("\nwaiting   press the camera's button: picture 1 of 6 is due\n"
                           "          the capture continues by itself when it arrives\n"),
            std::string::npos)
      << shown.out;
}

TEST(RailPositions, AreNumbersOfOneMonitor) {
  const RailPositions plain = parse_rail_positions("--rail-mm", "200,251.2").value();
  EXPECT_EQ(plain.monitor, "");
  EXPECT_EQ(plain.mm, (std::vector<double>{200.0, 251.2}));
  const RailPositions named = parse_rail_positions("--rail-mm", "back:-3").value();
  EXPECT_EQ(named.monitor, "back");
  EXPECT_EQ(named.mm, std::vector<double>{-3.0});
  for (const char* text :
       {"", "back:", "200,", "200,,300", "200 300", "200mm", "nan", "inf", "a:b:1", "200,200.0"})
    EXPECT_TRUE(absl::IsInvalidArgument(parse_rail_positions("--rail-mm", text).status())) << text;
}

TEST(RailPositions, TheMonitorIsTheOneThatCanBeMeant) {
  RigView rig;
  EXPECT_TRUE(absl::IsUnavailable(monitor_to_move("", rig).status()));
  for (const char* name : {"back", "left"}) rig.monitors.emplace_back().set_name(name);
  const absl::Status several = monitor_to_move("", rig).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(several)) << several;
  EXPECT_NE(std::string(several.message()).find("several monitors, back, left"), std::string::npos)
      << several;
  EXPECT_EQ(monitor_to_move("", rig, {"left"}).value(), "left") << "of the plan";
  rig.rails["back"];
  EXPECT_EQ(monitor_to_move("", rig, {"left"}).value(), "back") << "on a rail";
  EXPECT_EQ(monitor_to_move("left", rig).value(), "left") << "by its name";
  EXPECT_TRUE(absl::IsNotFound(monitor_to_move("side", rig).status()));
}

TEST_F(SessionCommands, ASeriesHasNamesBeforeItBegins) {
  const std::string plan = (scratch_ / "plan.txtpb").string();
  ASSERT_OK(write_file_durably(plan, "method: \"gaussian\" solids { colour: [0, 0, 0] }"));
  expect_one_line_error(run({"capture", plan, "--rail-mm", "200,251.2"}), "--rail-mm needs --session");
  expect_one_line_error(run({"capture", plan, "--session", std::string(61, 'x'), "--rail-mm", "200"}),
                        "-200");
  expect_one_line_error(run({"capture", plan, "--session", "vase", "--rail-mm", "far"}),
                        "--rail-mm is \"far\"");
}

// Nothing that others wrote moves the cursor, changes colours or turns the direction of writing.
TEST_F(SessionCommands, TextsOfOthersAreEscaped) {
  const std::string text = "good\u202etxet\x1b[2J\rgone\u2066";
  const std::string escaped = R"(good\xe2\x80\xaetxet\x1b[2J\x0dgone\xe2\x81\xa6)";
  v1::Session& session = server_.sessions_.session;
  session.set_name("vase");
  session.set_state(v1::SESSION_STATE_FAILED);
  session.set_note(text);
  session.set_warning(text);
  session.set_reason(text);
  const Outcome shown = run({"show", "vase"});
  for (const char* label : {"reason   ", "note     ", "warning  "})
    EXPECT_NE(shown.out.find(label + (" " + escaped) + "\n"), std::string::npos) << shown.out;
  expect_one_line_error(run({"watch", "vase"}), escaped);
  for (const Outcome& outcome : {shown, run({"watch", "vase"})}) {
    for (const char* raw : {"\u202e", "\x1b", "\r", "\u2066"})
      EXPECT_EQ((outcome.out + outcome.err).find(raw), std::string::npos) << outcome.out << outcome.err;
  }
}

}  // namespace
}  // namespace glasswing
