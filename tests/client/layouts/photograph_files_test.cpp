#include "client/layouts/photograph_files.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "tests/client/run_glasswing.h"

namespace glasswing {
namespace {

TEST(PhotographFiles, NumbersInNamesCountByTheirValue) {
  const std::vector<std::string> sorted{"1_Color.png", "2_Color.png", "10_Color.png", "a",     "a0",    "a00",
                                        "a01",         "a1",          "a1b",          "b12c3", "b12c20"};
  for (size_t i = 0; i < sorted.size(); ++i) {
    for (size_t j = 0; j < sorted.size(); ++j)
      EXPECT_EQ(natural_less(sorted[i], sorted[j]), i < j) << sorted[i] << " " << sorted[j];
  }
}

class PhotographFolder : public ScratchTest {
 protected:
  void put(const std::string& file) const {
    std::filesystem::create_directories((scratch_ / file).parent_path());
    std::ofstream(scratch_ / file) << "x";
  }
  std::vector<std::string> found(const std::string& glob) const {
    return photographs_in(scratch_, glob).value_or(std::vector<std::string>{});
  }
};

TEST_F(PhotographFolder, PicturesAreChosenByAPattern) {
  for (const char* file :
       {"c0_10.png", "c0_2.PNG", "c1_2.jpeg", "list.tsv", "more/c0_11.tif", "more/c1_11.tif"})
    put(file);
  using Files = std::vector<std::string>;
  EXPECT_EQ(found(""), (Files{"c0_2.PNG", "c0_10.png", "c1_2.jpeg"}));
  EXPECT_EQ(found("c0*"), (Files{"c0_2.PNG", "c0_10.png"}));
  EXPECT_EQ(found("*c0_*"), (Files{"c0_2.PNG", "c0_10.png", "more/c0_11.tif"}));
  EXPECT_EQ(photographs_in(scratch_, "left*").status().message(),
            scratch_.string() + " holds no PNG, JPEG, TIFF, BMP, PGM or PPM that fits --files left*");
  EXPECT_TRUE(absl::IsNotFound(photographs_in(scratch_ / "none", "").status()));
  for (size_t i = 0; i <= kMaxPhotographs; ++i) put(fmt::format("many/{}.png", i));
  EXPECT_NE(photographs_in(scratch_ / "many", "").status().message().find("more than 512 photographs"),
            std::string::npos);
}

// Photographs whose dates another program writes.
class WrappedNumbers : public PhotographFolder {
 protected:
  void take(int number, int second, const std::string& ending = "jpg") const {
    const std::string file = (scratch_ / fmt::format("IMG_{:04}.{}", number, ending)).string();
    const std::string command =
        fmt::format("oiiotool --create 16x16 3 --attrib Exif:DateTimeOriginal '2026:05:01 12:00:{:02}' -o {}",
                    second, file);
    ASSERT_EQ(std::system(command.c_str()), 0) << command;
  }
  absl::StatusOr<std::vector<std::string>> taken() const { return photographs_in(scratch_, ""); }
};

TEST_F(WrappedNumbers, GoOnWhereDatesSaySo) {
  for (const std::string ending : {"jpg", "tif"}) {
    take(9998, 1, ending), take(9999, 1, ending), take(1, 2, ending), take(2, 3, ending);
    const std::vector<std::string> files = taken().value();
    EXPECT_EQ(files, (std::vector<std::string>{"IMG_9998." + ending, "IMG_9999." + ending,
                                               "IMG_0001." + ending, "IMG_0002." + ending}));
    for (const std::string& file : files) std::filesystem::remove(scratch_ / file);
  }
}

TEST_F(WrappedNumbers, AreAskedForWhereDatesDoNot) {
  take(9998, 3), take(9999, 4), take(1, 1), take(2, 2);
  EXPECT_NE(taken().status().message().find("seem to belong to one series that wrapped"), std::string::npos)
      << taken().status();
  take(9998, 3, "png");  // of which no dates are read
  std::filesystem::remove(scratch_ / "IMG_9998.jpg");
  EXPECT_TRUE(absl::IsInvalidArgument(taken().status()));
}

TEST_F(WrappedNumbers, AreNoOthers) {
  for (const int number : {1, 2, 9998}) take(number, 1);
  EXPECT_EQ(taken().value().front(), "IMG_0001.jpg");
  take(9999, 1), take(5, 1);  // two gaps
  EXPECT_EQ(taken().value().front(), "IMG_0001.jpg");
}

}  // namespace
}  // namespace glasswing
