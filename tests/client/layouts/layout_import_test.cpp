// Folders of photographs become archives by --layout, and undeclared responses are estimated.
#include "client/layouts/photograph_layout.h"
#include "core/frame/archive.h"
#include "core/import/mapped_archive.h"
#include "core/import/photograph_response.h"
#include "tests/client/layouts/synthetic_stack.h"
#include "tests/client/run_glasswing.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

class LayoutImport : public ScratchTest {
 protected:
  Outcome import(std::vector<std::string> options) {
    options.insert(options.begin(), {"import", folder_.string(), "--archive", archive_.string()});
    std::filesystem::remove_all(archive_);
    return run_glasswing(options);
  }
  void write(const std::vector<Shown>& stack, const View& view = {}) {
    // Names without leading zeros, which sort otherwise as text.
    files_ = write_stack(folder_, stack, view, [](size_t i) { return fmt::format("IMG{}.png", i + 1); });
  }
  v1::CaptureManifest manifest() const { return MappedArchive::open(archive_).value()->manifest(); }

  const std::filesystem::path folder_ = scratch_ / "scan", archive_ = scratch_ / "out" / "scan";
  std::vector<std::string> files_;
};

std::vector<Shown> gray_stack() {
  std::vector<Shown> stack;
  add_bits(stack, true, 0, 1);
  add_bits(stack, true, 1, 1);
  stack.push_back(uniform(1.0));
  stack.push_back(uniform(0.0));
  return stack;
}

TEST_F(LayoutImport, AutoAndTheNamedLayoutGiveTheSameArchive) {
  write(gray_stack());
  const Outcome by_name =
      import({"--layout", "opencv-graycode", "--monitor", "64x48", "--response", "linear"});
  ASSERT_EQ(by_name.status, 0) << by_name.err;
  const v1::CaptureManifest named = manifest();
  const Outcome looked = import({"--layout", "auto", "--monitor", "64x48", "--response", "linear"});
  ASSERT_EQ(looked.status, 0) << looked.err;
  EXPECT_NE(looked.err.find(
                "auto: this is --layout opencv-graycode --order columns,rows,white,black --inverse after"),
            std::string::npos)
      << looked.err;
  EXPECT_EQ(manifest().SerializeAsString(), named.SerializeAsString());
  EXPECT_EQ(named.monitors(0).name(), "monitor");
  ASSERT_EQ(named.frames_size(), 26);
  // The tenth photograph comes after the ninth: the complement of the second finest columns.
  EXPECT_EQ(named.frames(9).stimulus().bar_width_px(), 4.0);
  EXPECT_TRUE(named.frames(9).stimulus().inverse());
}

TEST_F(LayoutImport, AnUndeclaredResponseIsEstimated) {
  for (const double gamma : {1.0, 2.2}) {
    write(gray_stack(), {.gamma = gamma});
    const Outcome outcome = import({"--layout", "auto", "--monitor", "back:64x48"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    double estimate = 0.0, error = 0.0;
    const size_t at = outcome.err.find("warning: the response is not declared; it was estimated as ");
    ASSERT_NE(at, std::string::npos) << outcome.err;
    ASSERT_EQ(std::sscanf(outcome.err.c_str() + outcome.err.find(": gamma ", at), ": gamma %lf +- %lf",
                          &estimate, &error),
              2)
        << outcome.err;
    EXPECT_NEAR(estimate, gamma, 0.1) << outcome.err;  // half of what is taken for linear or not
    EXPECT_LT(error, 0.1);
    // Green is linear in the archive: the light of complements sums to that of white and black. Codes of 8
    // bits are 1/255 apart, 2.2 times that of light where it is steepest; four of them.
    const auto archive = MappedArchive::open_interpolated(archive_).value();
    const auto at_row = [&](int frame) { return archive->rows(frame, 100, 1); };
    for (size_t x = 1; x < at_row(0).size(); x += 3) {
      const auto light = [&](int frame) { return at_row(frame)[x] / 65535.0; };
      EXPECT_NEAR(light(10) + light(11), light(24) + light(25), 4 * 2.2 * 2.0 / 255.0);
    }
  }
}

TEST_F(LayoutImport, PhotographsOfTenBitsInSixteenAreStretchedWhereToldSo) {
  write(gray_stack());
  const auto at_ten_bits = [&](int brightest) {
    for (const std::string& file : files_) {
      Image16 image = read_frame_file(folder_ / file).value();
      for (std::uint16_t& sample : image.samples) sample = static_cast<std::uint16_t>(sample >> 6);
      image.samples.front() = static_cast<std::uint16_t>(brightest);
      ASSERT_OK(write_file_flushed(folder_ / file, encode_png16(image).value()));
    }
  };
  const std::vector<std::string> options{"--layout", "auto", "--monitor", "64x48", "--response", "linear"};
  at_ten_bits(1023);
  expect_one_line_error(import(options), "the largest code of all photographs is 1023: 10 bits in 16?");
  std::vector<std::string> all = options;
  all.insert(all.end(), {"--white", "1023"});
  const Outcome outcome = import(all);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("auto: this is --layout opencv-graycode"), std::string::npos) << outcome.err;
  EXPECT_EQ(manifest().camera().bits(), 10);
  at_ten_bits(15);  // once more, so that next to nothing is seen
  EXPECT_NE(import(options).err.find("No code is above 15 of 65535"), std::string::npos)
      << import(options).err;
}

TEST_F(LayoutImport, AResponseThatPhotographsDoNotTellIsAskedFor) {
  std::vector<Shown> stack{uniform(1.0)};
  add_bits(stack, false, 1, 0);
  add_bits(stack, false, 0, 0);
  write(stack);
  const std::vector<std::string> options{"--layout",           "binary",    "--order",
                                         "white,rows,columns", "--monitor", "64x48"};
  const auto with = [&](const std::string& response) {
    std::vector<std::string> all = options;
    all.insert(all.end(), {"--response", response});
    return import(all);
  };
  expect_one_line_error(import(options),
                        "the response of its codes is not declared and cannot be estimated from the "
                        "photographs (there are no complements, gray levels or several exposures); pass "
                        "--response srgb, linear or gamma:G, or --response unknown");
  ASSERT_EQ(with("srgb").status, 0);
  EXPECT_EQ(manifest().camera().response(), "linear");
  const Outcome unknown = with("unknown");
  ASSERT_EQ(unknown.status, 0) << unknown.err;
  EXPECT_NE(unknown.err.find("warning: the response is unknown"), std::string::npos) << unknown.err;
  EXPECT_EQ(manifest().camera().response(), "unknown");
  expect_one_line_error(with("film"), "response is \"film\"; it must be linear");
}

TEST_F(LayoutImport, WhatIsWrongIsOneLine) {
  write({uniform(1.0), uniform(0.0)});
  const auto refused = [&](const std::vector<std::string>& options, const std::string& words) {
    expect_one_line_error(import(options), words);
    EXPECT_FALSE(std::filesystem::exists(archive_));
  };
  refused({"--layout", "auto"}, "--monitor is given 0 times; --layout needs it once, such as 1920x1080");
  refused({"--layout", "auto", "--monitor", "64"}, "monitor is \"64\"; it must be NAME:WIDTHxHEIGHT");
  refused({"--layout", "auto", "--monitor", "64x48", "--order", "rows"},
          "--layout auto takes only --periods, --shift and --cell");
  refused({"--layout", "gray", "--monitor", "64x48"}, "--layout is \"gray\"; it must be opencv-graycode");
  refused({"--layout", "binary", "--monitor", "64x48"}, "there are 2 photographs; --layout binary");
  refused({"--layout", "binary", "--monitor", "64x48", "--files", "x*"},
          "holds no PNG, JPEG, TIFF, BMP, PGM or PPM that fits");
  EXPECT_EQ(import({"--order", "rows"}).status, kUsageError);
  EXPECT_EQ(import({"--layout", "auto", "--list", "list.tsv"}).status, kUsageError);
}

}  // namespace
}  // namespace glasswing
