// Parts of rows that processes solved apart: joined they are the matte of one process, and whatever does not
// go together is refused by the name of its file.
#include "core/matte/row_part.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/file/file.h"
#include "tests/core/matte/random_matte.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr int kHeight = 23;

class RowParts : public testing::Test {
 protected:
  RowParts() {
    whole_.metadata.set_generator("glasswing");
    whole_.metadata.set_method("gaussian");
    (*whole_.metadata.mutable_options())["modes"] = "2";
  }

  using Change = std::function<void(PartOrigin&, v1::MatteMetadata&)>;
  // Writes rows [first, end) as a part.
  fs::path part(const std::string& name, int first, int end, const Change& change = nullptr) const {
    Matte rows(0, first, whole_.width_px(), end - first, whole_.modes_per_channel());
    rows.metadata = whole_.metadata;
    for (int y = first; y < end; ++y) {
      for (int x = 0; x < whole_.width_px(); ++x) rows.copy_pixel(whole_, x, y, x, y - first);
    }
    PartOrigin origin{
        .archive = "xxh3:0123456789abcdef", .computes = "gaussian/1 matte/1", .vectors = "AVX2"};
    if (change) change(origin, rows.metadata);
    mark_part(origin, rows.metadata);
    return write(name, encode_matte(rows).value());
  }
  fs::path write(const std::string& name, const std::string& bytes) const {
    EXPECT_TRUE(write_file_durably(folder_ / name, bytes).ok());
    return folder_ / name;
  }
  absl::StatusOr<JoinedParts> join(const std::vector<fs::path>& parts) const {
    PositionedFile file = PositionedFile::create(folder_ / "whole.exr").value();
    return join_parts(parts, file);
  }
  // Expects the refusal of parts 1 of 2 and the changed part 2.
  void expect_refused(const Change& change, const std::string& why) const {
    const fs::path first = part("first.exr", 0, 10), second = part("second.exr", 10, kHeight, change);
    const absl::StatusOr<JoinedParts> joined = join({first, second});
    EXPECT_TRUE(absl::IsInvalidArgument(joined.status())) << joined.status();
    const std::string said(joined.status().message());
    EXPECT_NE(said.find("second.exr"), std::string::npos) << said;
    EXPECT_NE(said.find(why), std::string::npos) << said;
  }

  const TemporaryDirectory folder_;
  Matte whole_ = random_matte(0, kHeight);
};

TEST_F(RowParts, JoinToTheFileOfOneProcess) {
  const std::vector<fs::path> parts = {part("c.exr", 9, kHeight), part("a.exr", 0, 1), part("b.exr", 1, 9)};
  const auto joined = join(parts);
  ASSERT_TRUE(joined.ok()) << joined.status();
  EXPECT_EQ(read_file(folder_ / "whole.exr").value(), encode_matte(whole_).value());
  EXPECT_EQ(joined->origin.archive, "xxh3:0123456789abcdef");
  EXPECT_EQ(joined->pixels.object, count_pixels(whole_).object);
  EXPECT_EQ(mixed_vectors(*joined), "");
  EXPECT_FALSE(origin_of(joined->outline.metadata).has_value()) << "the whole is not a part";
}

TEST_F(RowParts, OnePartIsTheWhole) {
  ASSERT_TRUE(join({part("a.exr", 0, kHeight)}).ok());
  EXPECT_EQ(read_file(folder_ / "whole.exr").value(), encode_matte(whole_).value());
}

TEST_F(RowParts, PartsOfOtherProcessorsAreNamed) {
  const auto joined =
      join({part("a.exr", 0, 9),
            part("b.exr", 9, kHeight, [](PartOrigin& origin, auto&) { origin.vectors = "AVX3"; })});
  ASSERT_TRUE(joined.ok()) << joined.status();
  EXPECT_NE(mixed_vectors(*joined).find("AVX2 and AVX3"), std::string::npos);
}

TEST_F(RowParts, RefuseWhatDoesNotGoTogether) {
  expect_refused([](PartOrigin& origin, auto&) { origin.archive = "xxh3:fedcba9876543210"; }, "archive");
  expect_refused([](auto&, v1::MatteMetadata& metadata) { metadata.set_session("t"); }, "\"t\"");
  expect_refused([](auto&, v1::MatteMetadata& metadata) { metadata.set_method("fringe"); }, "fringe");
  expect_refused([](auto&, v1::MatteMetadata& metadata) { (*metadata.mutable_options())["modes"] = "3"; },
                 "modes=3");
  expect_refused([](auto&, v1::MatteMetadata& metadata) { metadata.clear_options(); }, "no options");
  expect_refused([](PartOrigin& origin, auto&) { origin.computes = "gaussian/2 matte/1"; }, "gaussian/2");
  expect_refused([](PartOrigin& origin, auto&) { origin.as_recorded = true; }, "as recorded");
  expect_refused([](auto&, v1::MatteMetadata& metadata) { metadata.add_edits("flip x"); }, "edited");
}

TEST_F(RowParts, RefuseMissingAndDoubledRows) {
  const fs::path top = part("top.exr", 0, 10), middle = part("middle.exr", 10, 15),
                 bottom = part("bottom.exr", 15, kHeight), wide = part("wide.exr", 8, 15);
  const auto said = [&](const std::vector<fs::path>& parts) {
    const auto joined = join(parts);
    EXPECT_TRUE(absl::IsInvalidArgument(joined.status())) << joined.status();
    return std::string(joined.status().message());
  };
  EXPECT_NE(said({top, bottom}).find("rows 10 to 14 are in no file"), std::string::npos);
  EXPECT_NE(said({middle, bottom}).find("rows 0 to 9 are in no file"), std::string::npos);
  EXPECT_NE(said({top, middle}).find("rows 15 to 22 are in no file"), std::string::npos);
  const std::string doubled = said({top, wide, bottom});
  EXPECT_NE(doubled.find("rows 8 to 9 are in both"), std::string::npos) << doubled;
  EXPECT_NE(doubled.find("top.exr"), std::string::npos) << doubled;
  EXPECT_NE(doubled.find("wide.exr"), std::string::npos) << doubled;
  EXPECT_NE(said({top, middle, middle, bottom}).find("rows 10 to 14 are in both"), std::string::npos);
}

TEST_F(RowParts, RefuseWhatIsNoPart) {
  const fs::path top = part("top.exr", 0, 10);
  EXPECT_NE(std::string(join({write("matte.exr", encode_matte(whole_).value())}).status().message())
                .find("matte.exr is not a part"),
            std::string::npos);
  EXPECT_NE(std::string(join({top, write("text.exr", "text")}).status().message()).find("text.exr"),
            std::string::npos);
  EXPECT_TRUE(absl::IsNotFound(join({top, folder_ / "nowhere.exr"}).status()));
}

// A flipped byte of the pixels, wherever it lies.
TEST_F(RowParts, RefuseDamagedParts) {
  const fs::path top = part("top.exr", 0, 10), bottom = part("bottom.exr", 10, kHeight);
  const std::string bytes = read_file(bottom).value();
  for (const double at : {0.3, 0.6, 0.99}) {
    std::string damaged = bytes;
    damaged[static_cast<size_t>(at * static_cast<double>(bytes.size()))] ^= 0x10;
    const absl::Status status = join({top, write("bottom.exr", damaged)}).status();
    EXPECT_TRUE(absl::IsDataLoss(status)) << at << ": " << status;
    EXPECT_NE(std::string(status.message()).find("bottom.exr"), std::string::npos) << status;
  }
}

}  // namespace
}  // namespace glasswing
