// Photographs and a list of them become an archive, or a session.
#include "client/exchange/photograph_list.h"

#include <cmath>
#include <functional>
#include <map>

#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/image/image_file.h"
#include "core/import/mapped_archive.h"
#include "tests/client/fake_server.h"
#include "tests/client/run_glasswing.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kWidth = 9, kHeight = 7;
const std::string kHeaders = "#monitor back:64x48\n#response linear\n";

Image16 picture(int number) {
  Image16 image(kWidth, kHeight);
  for (size_t i = 0; i < image.samples.size(); ++i)
    image.samples[i] = static_cast<std::uint16_t>(i * 311 + static_cast<size_t>(number) * 1021);
  return image;
}

class PhotographLists : public ScratchTest {
 protected:
  PhotographLists() {
    std::filesystem::create_directories(photographs_);
    for (int i = 0; i < 3; ++i) put(std::to_string(i) + ".png", encode_png16(picture(i)).value());
  }
  void put(const std::string& file, const std::string& bytes) const {
    ASSERT_OK(write_file_durably(photographs_ / file, bytes));
  }
  std::string list(const std::string& text) const {
    EXPECT_OK(write_file_durably(list_, text));
    return list_.string();
  }
  Outcome import(const std::string& text, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {"import", photographs_.string(), "--list", list(text)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_glasswing(arguments);
  }
  absl::StatusOr<PhotographList> read(const std::string& text, const PhotographOptions& options = {}) const {
    return read_photograph_list(list(text), options);
  }

  const std::filesystem::path photographs_ = scratch_ / "photographs", list_ = scratch_ / "list.tsv",
                              archive_ = scratch_ / "out" / "vase";
};

TEST_F(PhotographLists, EveryFieldOfAStimulusHasAColumn) {
  const PhotographList list =
      read("#scene a vase\n# a remark\n" + kHeaders +
           "\nfile\tobject\ttime_s\texposure_ms\tkind\tcolour\torient\tbar_width_px\toffset_"
           "px\tinverse\tlevel\tpeak\t"
           "period_px\tphase_deg\tpatch_id\r\n"
           "a.jpg\ttrue\t1.5\t20\tsquare\t1,0,0.5\tvertical_bars\t16\t-8\ttrue\t3\t\t\t\t\r\n"
           "b/c.jpg\tfalse\t\t\tsinusoid\t\t\t\t\t\t\t0.5\t30\t90\t\n"
           "d.jpg\tfalse\t\t\tpatch\t\t\t\t\t\t\t\t\t\t65535\n")
          .value();
  EXPECT_EQ(list.manifest.scene(), "a vase");
  ASSERT_EQ(list.manifest.monitors_size(), 1);
  EXPECT_EQ(list.manifest.monitors(0).width_px(), 64);
  EXPECT_EQ(list.lines, (std::vector<int>{7, 8, 9}));
  const v1::Frame& square = list.manifest.frames(0);
  EXPECT_TRUE(square.object());
  EXPECT_EQ(square.exposure_start_ns(), 1'500'000'000);
  EXPECT_EQ(square.exposure_end_ns(), 1'520'000'000);
  EXPECT_EQ(square.stimulus().colour(2), 0.5);
  EXPECT_EQ(square.stimulus().panel(), "back");
  EXPECT_EQ(square.stimulus().offset_px(), -8.0);
  EXPECT_EQ(square.stimulus().level(), 3);
  EXPECT_TRUE(square.stimulus().inverse());
  EXPECT_FALSE(list.manifest.frames(1).object());
  EXPECT_EQ(list.manifest.frames(1).exposure_end_ns(), 0);
  EXPECT_EQ(list.manifest.frames(1).stimulus().phase_deg(), 90.0);
  EXPECT_EQ(list.manifest.frames(2).stimulus().patch_id(), 65535u);
}

TEST_F(PhotographLists, TheCommandLineGoesFirst) {
  const PhotographOptions options{
      .monitors = {"left:10x10", "right:20x10"}, .response = "srgb", .black = 2.0};
  const PhotographList list =
      read("#black 1\n" + kHeaders + "file\tobject\tkind\tpanel\na\ttrue\tramp\tright\n", options).value();
  EXPECT_EQ(list.manifest.monitors_size(), 2);
  EXPECT_EQ(list.response, "srgb");
  EXPECT_EQ(list.black, 2.0);
}

TEST_F(PhotographLists, ComplaintsNameLineValueAndWhatIsAccepted) {
  struct Case {
    std::string text;
    const char* complaint;
  };
  const std::string columns =
      kHeaders + "file\tobject\tkind\tbar_width_px\torient\tcolour\tlevel\tinverse\tpanel\n";
  for (const Case& each : {
           Case{"", ": it lists no photographs"},
           {columns, ": it lists no photographs"},
           {"#monitor back\n",
            ":1: monitor is \"back\"; it must be NAME:WIDTHxHEIGHT, such as back:1920x1080"},
           {"#monitor back:0x9\n", ":1: monitor is \"back:0x9\"; it must be NAME:WIDTHxHEIGHT"},
           {"#monitor back:9x16385\n",
            ":1: monitor is \"back:9x16385\"; it must be NAME:WIDTHxHEIGHT, such as back:1920x1080, or "
            "WIDTHxHEIGHT, each side 1 to 16384 px"},
           {"#scene gl\xe4ser\n", ":1: it is not UTF-8"},
           {"#exposure 3\n",
            ":1: unknown setting \"#exposure\"; it must be #monitor, #response, #black, #white or #scene"},
           {"#black -1\n", ":1: black is \"-1\"; it must be 0 or more codes"},
           {"#response srgb\nfile\tobject\tkind\n",
            ":2: no monitor is named before the header row; add #monitor"},
           {kHeaders + "file\tobject\n",
            ":3: there is no column \"kind\"; there must be file, object and kind"},
           {kHeaders + "file\tobject\tkind\tbar\n",
            ":3: there is no column \"bar\"; columns are file, object, time_s"},
           {kHeaders + "file\tobject\tkind\tkind\n", ":3: column \"kind\" is there twice"},
           {columns + "#response srgb\n", ":4: #response comes after the header row"},
           {columns + "a\ttrue\tsolid\n", ":4: it has 3 tab-separated cells; the header row has 9"},
           {columns + "a\tyes\tsolid\t\t\t\t\t\t\n", ":4: object is \"yes\"; it must be true or false"},
           {columns + "a\ttrue\tsolid\t\t\t\t\tno\t\n", ":4: inverse is \"no\"; it must be true or false"},
           {columns + "a\ttrue\tsolid\t\t\t1,2x,3\t\t\t\n",
            ":4: colour is \"2x\"; it must be numbers separated by commas"},
           {columns + "a\ttrue\tsolid\tinf\t\t\t\t\t\n", ":4: bar_width_px is \"inf\"; it must be a number"},
           {columns + "a\ttrue\tsolid\t\t\t\t1.5\t\t\n", ":4: level is \"1.5\"; it must be a whole number"},
           {columns + "a\ttrue\tsolid\t\t\t\t\t\tfront\n",
            ":4: panel is \"front\"; it must be a monitor: back"},
           {columns + "a\ttrue\tsquare\t0\tvertical_bars\t\t\t\t\n",
            ":4: stimulus bar_width_px is 0; it must be > 0"},
           {columns + "a\ttrue\tstripes\t\t\t\t\t\t\n", ":4: stimulus kind is \"stripes\"; it must be solid"},
           {columns + "../a\ttrue\tsolid\t\t\t\t\t\t\n", ":4: a frame's file is \"../a\"; it must be inside"},
           {columns + "a\ttrue\tramp\t\t\t\t\t\t\n\na\ttrue\tramp\t\t\t\t\t\t\n",
            ":6: a is already listed in line 4"},
       }) {
    const std::string message(read(each.text).status().message());
    EXPECT_TRUE(message.starts_with(list_.string() + each.complaint)) << message;
  }
  const std::string time = kHeaders + "file\tobject\tkind\ttime_s\texposure_ms\na\ttrue\tramp\t";
  EXPECT_NE(read(time + "1e20\t\n").status().message().find(":4: time_s is \"1e20\"; it must be seconds"),
            std::string::npos);
  EXPECT_NE(read(time + "\t0\n").status().message().find(":4: exposure_ms is \"0\"; it must be above 0 ms"),
            std::string::npos);
  EXPECT_TRUE(absl::IsNotFound(read_photograph_list(scratch_ / "none.tsv", {}).status()));
}

TEST_F(PhotographLists, AnArchiveIsWrittenWithoutAServer) {
  const Outcome outcome = import(kHeaders + "file\tobject\tkind\n2.png\ttrue\tramp\n0.png\tfalse\tramp\n",
                                 {"--archive", archive_.string()});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(outcome.out, archive_.string() + ": 2 frames\n");
  const auto archive = MappedArchive::open_interpolated(archive_).value();
  EXPECT_EQ(archive->manifest().session(), "vase");
  EXPECT_EQ(archive->manifest().camera().bits(), 16);
  ASSERT_EQ(archive->manifest().frames_size(), 2);
  EXPECT_EQ(archive->manifest().frames(0).proof(), v1::PROOF_IMPORTED);
  for (const auto& [frame, number] : std::map<int, int>{{0, 2}, {1, 0}}) {
    const std::span<const std::uint16_t> rows = archive->rows(frame, 0, kHeight);
    EXPECT_EQ(std::vector<std::uint16_t>(rows.begin(), rows.end()), picture(number).samples);
  }
  // The result is an ordinary archive: importing it again gives the same.
  const std::filesystem::path again = scratch_ / "out" / "again";
  ASSERT_EQ(
      run_glasswing({"import", archive_.string(), "--archive", again.string(), "--session", "vase"}).status,
      0);
  EXPECT_EQ(read_file(again / "manifest.json").value(), read_file(archive_ / "manifest.json").value());
  EXPECT_EQ(read_file(again / "frames/000001.tif").value(),
            read_file(archive_ / "frames/000001.tif").value());
  expect_one_line_error(
      import(kHeaders + "file\tobject\tkind\n0.png\ttrue\tramp\n", {"--archive", archive_.string()}),
      archive_.string() + " already exists");
}

TEST_F(PhotographLists, CodesBecomeLight) {
  const std::string table = "#monitor back:64x48\nfile\tobject\tkind\n0.png\ttrue\tramp\n";
  ASSERT_EQ(
      import(table, {"--archive", archive_.string(), "--response", "gamma:2", "--black", "655.35"}).status,
      0);
  const auto archive = MappedArchive::open_interpolated(archive_).value();
  const std::span<const std::uint16_t> rows = archive->rows(0, 0, kHeight);
  for (size_t i = 0; i < rows.size(); ++i) {
    const double u = std::max(0.0, (picture(0).samples[i] / 65535.0 - 0.01) / 0.99);
    EXPECT_NEAR(rows[i], 65535.0 * u * u, 0.51);
  }
}

TEST_F(PhotographLists, CodesOfFewerBitsAreAskedFor) {
  Image16 codes = picture(0);  // of 12 bits
  for (std::uint16_t& code : codes.samples) code >>= 4;
  codes.samples.back() = 4095;
  put("0.png", encode_png16(codes).value());
  const std::string table = kHeaders + "file\tobject\tkind\n0.png\ttrue\tramp\n";
  const auto imported = [&](const std::string& text, const std::vector<std::string>& more) {
    std::filesystem::remove_all(archive_);
    std::vector<std::string> words{"--archive", archive_.string()};
    words.insert(words.end(), more.begin(), more.end());
    return import(text, words);
  };
  expect_one_line_error(
      imported(table, {}),
      "the largest code of all photographs is 4095: 12 bits in 16? If so, pass --white 4095; "
      "if not, --white 65535");
  expect_one_line_error(imported(table, {"--white", "4094"}), "its largest code is 4095, above white, 4094");
  expect_one_line_error(imported("#white many\n" + table, {}), "white is \"many\"; it must be a code");
  ASSERT_EQ(imported("#white 4095\n#black 64\n" + table, {}).status, 0);
  const auto archive = MappedArchive::open_interpolated(archive_).value();
  EXPECT_EQ(archive->manifest().camera().bits(), 12);
  const std::span<const std::uint16_t> rows = archive->rows(0, 0, kHeight);
  for (size_t i = 0; i < rows.size(); ++i) {
    // The codes are rounded to 16 bits before black is taken off.
    EXPECT_NEAR(rows[i], std::max(0.0, 65535.0 * (codes.samples[i] - 64.0) / (4095.0 - 64.0)), 1.1);
  }
  ASSERT_EQ(imported(table, {"--white", "65535"}).status, 0);
  EXPECT_EQ(MappedArchive::open_interpolated(archive_).value()->rows(0, 0, 1)[1], codes.samples[1]);
}

TEST_F(PhotographLists, WhatIsWrongWithAPhotographIsOneLineAndNothingIsSent) {
  FakeServer server;
  const std::string table =
      kHeaders + "file\tobject\tkind\n0.png\ttrue\tramp\n1.png\ttrue\tramp\n2.png\ttrue\tramp\n";
  const auto refused = [&](const std::string& words) {
    expect_one_line_error(import(table, {"--server", server.address()}), words);
    expect_one_line_error(import(table, {"--archive", archive_.string()}), words);
    EXPECT_TRUE(server.sessions_.begun.empty());
    EXPECT_TRUE(std::filesystem::is_empty(scratch_ / "out"));
  };
  put("2.png", encode_png16(Image16(kWidth, kHeight + 1)).value());
  refused("list.tsv:6: 2.png is 9x8 of 16 bits; it must match the first one, 0.png, which is 9x7 of 16 bits");
  ASSERT_OK(write_radiance(photographs_ / "2.png", RadianceImage(kWidth, kHeight), Encoding::kDisplay));
  refused("list.tsv:6: 2.png is 9x7 of 8 bits");
  put("2.png", encode_png16(picture(2)).value().substr(0, 100));
  refused("list.tsv:6: " + (photographs_ / "2.png").string() + ": the PNG is truncated");
  std::filesystem::remove(photographs_ / "2.png");
  refused("the photograph is missing");
  put("2.png", encode_png16(picture(2)).value());
  ASSERT_EQ(import(table, {"--server", server.address(), "--session", "vase"}).status, 0);
  EXPECT_EQ(server.sessions_.finished, std::vector<std::string>{"vase"});
  EXPECT_EQ(decode_tiff(server.archive_.files.at("frames/000002.tif"))->samples, picture(2).samples);
  expect_one_line_error(
      import("#monitor 64x48\nfile\tobject\tkind\n0.png\ttrue\tramp\n"),
      "the response of its codes is not declared and cannot be estimated from the photographs");
  expect_one_line_error(import(table, {"--response", "film"}),
                        "list.tsv: response is \"film\"; it must be linear");
}

}  // namespace
}  // namespace glasswing
