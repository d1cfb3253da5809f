// glasswing matte: what its verbs write, and what they refuse. Edits themselves: tests/core/edit.
#include <nlohmann/json.hpp>

#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "tests/compositing/run_glasswing.h"
#include "tests/core/footprint/matte_object.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kWidth = 8, kHeight = 6;

class MatteCommand : public ScratchTest {
 protected:
  MatteCommand() { write("vase.exr", random_object(kWidth, kHeight, 2, 1)); }
  std::string path(const std::string& name) const { return (scratch_ / name).string(); }
  void write(const std::string& name, const Matte& matte) const {
    EXPECT_OK(write_file_durably(path(name), encode_matte(matte).value()));
  }
  Outcome run(std::vector<std::string> words) const {
    words.insert(words.begin(), "matte");
    return run_glasswing(words);
  }
  // Runs a verb on vase.exr; the matte that it writes.
  Matte edited(const std::string& verb, std::vector<std::string> more) const {
    more.insert(more.begin(), {verb, path("vase.exr"), "-o", path("out.exr")});
    const Outcome outcome = run(more);
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return read_matte(path("out.exr")).value();
  }
};

TEST_F(MatteCommand, FilesSayWhatWasDone) {
  const auto last = [](const Matte& matte) { return matte.metadata.edits(matte.metadata.edits_size() - 1); };
  EXPECT_EQ(last(edited("crop", {"4x3+2+1"})), "crop 4x3+2+1");
  EXPECT_EQ(last(edited("resize", {"4x3"})), "resize 4x3");
  EXPECT_EQ(last(edited("flip", {"x"})), "flip x");
  EXPECT_EQ(last(edited("fill", {})), "fill");
  EXPECT_EQ(last(edited("grade", {"--gain", "1,0.5,2", "--only", "passing"})),
            "grade saturation 1, exposure 0, gain 1,0.5,2, only passing");
  const std::string once = path("once.exr"), twice = path("twice.exr");
  ASSERT_EQ(run({"flip", path("vase.exr"), "x", "-o", once}).status, 0);
  ASSERT_EQ(run({"flip", once, "y", "-o", twice}).status, 0);
  EXPECT_EQ(read_matte(twice)->metadata.edits_size(), 2);
}

TEST_F(MatteCommand, OutputIsReported) {
  EXPECT_EQ(run({"crop", path("vase.exr"), "4x3+2+1", "-o", path("out.exr")}).out,
            path("out.exr") + ": 4x3\n");
  Matte hole = random_object(kWidth, kHeight, 2, 1);
  hole.flags(3, 3) = kFlagNoData;
  hole.flags(5, 3) = kFlagPoorFit;
  write("hole.exr", hole);
  const Outcome some = run_glasswing({"matte", "fill", path("hole.exr"), "-o", path("out.exr"), "--json"});
  EXPECT_EQ(nlohmann::json::parse(some.out)["filled_pixels"], 1);
  const Outcome all =
      run_glasswing({"matte", "fill", path("hole.exr"), "--flagged", "-o", path("out.exr"), "--json"});
  EXPECT_EQ(nlohmann::json::parse(all.out)["filled_pixels"], 2);
  EXPECT_EQ(read_matte(path("out.exr"))->flags(5, 3), kFlagFilled);
}

TEST_F(MatteCommand, EditsAreThoseOfTheOptions) {
  const Matte vase = read_matte(path("vase.exr")).value();
  EXPECT_EQ(edited("flip", {"y"}).foreground(2, 0), vase.foreground(2, kHeight - 1));
  EXPECT_EQ(edited("resize", {"2x2", "--modes", "3"}).modes_per_channel(), 3);
  const Matte warm = edited("grade", {"--exposure", "1", "--gain", "1,2,1", "--only", "foreground"});
  EXPECT_FLOAT_EQ(warm.foreground(1, 1)[1], 4.0f * vase.foreground(1, 1)[1]);
  EXPECT_FLOAT_EQ(warm.foreground(1, 1)[0], 2.0f * vase.foreground(1, 1)[0]);
  // Digits that errors hide go: a sixteenth of 0.01.
  EXPECT_NEAR(warm.modes(1, 1, 1)[0].weight, vase.modes(1, 1, 1)[0].weight, 0.01 / 32.0);
}

TEST_F(MatteCommand, TheFirstOfSeveralIsInFront) {
  for (const auto& [name, from] : {std::pair{"a.exr", 0}, {"b.exr", 2}, {"c.exr", 4}}) {
    Matte matte = random_object(kWidth, kHeight, 1, static_cast<unsigned>(from + 1));
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) matte.coverage(x, y) = x >= from && x < from + 3 ? 1.0f : 0.0f;
    }
    write(name, matte);
  }
  ASSERT_EQ(run({"merge", path("a.exr"), path("b.exr"), path("c.exr"), "-o", path("out.exr")}).status, 0);
  const Matte all = read_matte(path("out.exr")).value();
  const std::array<const char*, 7> owners{"a.exr", "a.exr", "a.exr", "b.exr", "b.exr", "c.exr", "c.exr"};
  for (int x = 0; x < 7; ++x) {
    EXPECT_EQ(all.foreground(x, 2), read_matte(path(owners[x]))->foreground(x, 2)) << x;
    EXPECT_EQ(all.coverage(x, 2), 1.0f);
  }
  EXPECT_EQ(all.coverage(7, 2), 0.0f);
}

// A file for other programs gives the same composites, by the verbs that read mattes.
TEST_F(MatteCommand, DeliveredMattesAreMattes) {
  Matte matte = random_object(kWidth, kHeight, 2, 1);
  matte.metadata.mutable_monitors(0)->set_width_px(16);
  for (int x = 0; x < kWidth; ++x) matte.coverage(x, 0) = matte.coverage(x, 1) = 0.0f;
  write("vase.exr", matte);
  const std::string out = path("out.exr");
  const Outcome told = run({"deliver", path("vase.exr"), "--half", "--hug", "--tile", "16", "-o", out});
  EXPECT_EQ(told.out.find(out + ": 8x6; pixels 8x4+0+2; 16 bits: preview, F"), 0u) << told.out << told.err;
  const Outcome json = run_glasswing({"matte", "deliver", path("vase.exr"), "--hug", "-o", out, "--json"});
  EXPECT_EQ(nlohmann::json::parse(json.out)["window"], "8x4+0+2");
  EXPECT_EQ(nlohmann::json::parse(json.out)["bytes"], std::filesystem::file_size(out));
  ASSERT_OK(write_radiance(path("behind.exr"), random_pictures().front(), Encoding::kLinear));
  for (const char* name : {"vase", "out"}) {
    const Outcome shown = run_glasswing({"composite", path(name + std::string(".exr")), "--background",
                                         path("behind.exr"), "-o", path(name + std::string("_over.exr"))});
    EXPECT_EQ(shown.status, 0) << shown.err;
  }
  const RadianceImage whole = read_radiance(path("vase_over.exr"), Encoding::kLinear).value();
  const RadianceImage hugged = read_radiance(path("out_over.exr"), Encoding::kLinear).value();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) EXPECT_EQ(hugged.at(x, y, 1), y < 2 ? 0.0f : whole.at(x, y, 1));
  }
  EXPECT_EQ(run_glasswing({"view", out, "-o", path("sheet.png")}).status, 0);
  EXPECT_EQ(run({"crop", out, "4x3+2+1", "-o", path("part.exr")}).status, 0);
  EXPECT_EQ(read_matte(path("part.exr"))->metadata.edits(1), "crop 4x3+2+1");
}

TEST_F(MatteCommand, BadInputIsNamedAndNothingIsWritten) {
  const auto refused = [this](std::vector<std::string> words, const std::string& error) {
    words.insert(words.end(), {"-o", path("none.exr")});
    expect_one_line_error(run(words), error);
    EXPECT_FALSE(std::filesystem::exists(path("none.exr")));
  };
  const std::string vase = path("vase.exr");
  refused({"crop", vase, "4x3"}, "the region is \"4x3\"");
  refused({"crop", vase, "8x6+1+0"}, vase + ": the region is 8x6+1+0");
  refused({"resize", vase, "4"}, "the size is \"4\"; it must be WIDTHxHEIGHT");
  refused({"resize", vase, "4x3y"}, "the size is \"4x3y\"");
  refused({"resize", vase, "0x3"}, vase + ": the width is 0 px");
  refused({"resize", vase, "4x3", "--modes", "1"}, "a matte with 2 monitors has 2 to 8");
  refused({"flip", vase, "z"}, "z");
  refused({"grade", vase, "--gain", "1,2"}, "--gain");
  refused({"fill", path("nowhere.exr")}, path("nowhere.exr"));
  refused({"deliver", vase, "--tile", "8"}, "--tile");
  refused({"deliver", path("nowhere.exr")}, path("nowhere.exr"));
  write("wide.exr", random_object(kWidth + 1, kHeight, 1, 1));
  refused({"merge", path("wide.exr"), vase}, path("wide.exr") + ": the mattes differ in size, 9x6 and 8x6");
  expect_one_line_error(run({"flip", vase, "x", "-o", path("out.png")}), "its name must end in .exr");
  expect_one_line_error(run({"flip", vase, "x", "-o", path("nowhere/out.exr")}), "there is no directory");
}

}  // namespace
}  // namespace glasswing
