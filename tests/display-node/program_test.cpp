#include "display-node/program.h"

#include <absl/strings/match.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/frame/image_file.h"
#include "core/pattern/id_patch.h"

namespace glasswing {
namespace {

const std::vector<ScreenInfo>& screens() {
  static const std::vector<ScreenInfo> list{{.name = "back", .width_px = 16, .height_px = 8},
                                            {.name = "left", .width_px = 6, .height_px = 4}};
  return list;
}

v1::LoadProgramRequest good_request() {
  v1::LoadProgramRequest request;
  request.set_program("p");
  request.set_hold_refreshes(2);
  v1::ProgramStep& step = *request.add_steps();
  step.set_step(17);
  v1::Stimulus& stripe = *step.add_stimuli();
  stripe.set_kind("gauss_stripe");
  stripe.set_panel("left");
  stripe.set_sigma_px(2.0);
  stripe.set_peak(1.0);
  return request;
}

std::string png_of(int width_px, int height_px, std::uint16_t code) {
  Image16 image(width_px, height_px);
  image.samples.assign(image.samples.size(), code);
  return encode_png16(image);
}

absl::StatusOr<Program> create(const v1::LoadProgramRequest& request) {
  return Program::create(request, screens(), ImageStore());
}

void expect_refused(const v1::LoadProgramRequest& request, const std::string& message) {
  const absl::Status status = create(request).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_TRUE(absl::StrContains(status.message(), message)) << status;
}

TEST(Program, RastersItsPatternsOnTheirMonitorAndLeavesOthersBlack) {
  const v1::LoadProgramRequest request = good_request();
  const Program program = create(request).value();
  ASSERT_EQ(program.size(), 1u);
  EXPECT_EQ(program.number(0), 17);
  const std::vector<Picture> pictures = program.pictures(0);
  ASSERT_EQ(pictures.size(), 2u);
  EXPECT_EQ(pictures[0], nullptr);
  const Pattern pattern =
      Pattern::create(request.steps(0).stimuli(0), {.width_px = 6, .height_px = 4}).value();
  EXPECT_EQ(pictures[1]->samples, pattern.rasterised().samples);
}

TEST(Program, RefusesWhatItCannotShowAndSaysWhy) {
  v1::LoadProgramRequest request = good_request();
  for (const int hold : {1, 0, -2, 601}) {
    request.set_hold_refreshes(hold);
    expect_refused(request, "hold_refreshes is " + std::to_string(hold) + "; it must be 2 to 600");
  }
  request = good_request();
  request.clear_program();
  expect_refused(request, "program");
  request = good_request();
  request.clear_steps();
  expect_refused(request, "1 to 20000");
  for (int i = 0; i <= 20000; ++i) request.add_steps();
  expect_refused(request, "20001 steps");
  request = good_request();
  request.mutable_steps(0)->mutable_stimuli(0)->set_panel("bakc");
  expect_refused(request, "step 17: there is no monitor \"bakc\"; there are: back, left");
  request = good_request();
  request.mutable_steps(0)->mutable_stimuli(0)->set_sigma_px(-1.0);
  expect_refused(request, "step 17: stimulus sigma_px is -1");
  request = good_request();
  *request.mutable_steps(0)->add_stimuli() = request.steps(0).stimuli(0);
  expect_refused(request, "step 17: monitor \"left\" is lit twice");
}

TEST(Program, ShowsPicturesThatWereSentAndFit) {
  ImageStore images;
  const std::string name = images.add(png_of(16, 8, 13107)).value();
  v1::LoadProgramRequest request = good_request();
  v1::Stimulus& photo = *request.mutable_steps(0)->mutable_stimuli(0);
  photo.set_kind("photo");
  photo.set_panel("back");
  photo.set_image(name);
  const Program program = Program::create(request, screens(), images).value();
  EXPECT_EQ(program.pictures(0)[0]->samples[5], 13107.0f / 65535.0f);

  photo.set_panel("left");
  const absl::Status misfit = Program::create(request, screens(), images).status();
  EXPECT_TRUE(absl::IsInvalidArgument(misfit)) << misfit;
  EXPECT_TRUE(absl::StrContains(misfit.message(), "is 16x8; monitor \"left\" is 6x4")) << misfit;

  photo.set_image("nowhere");
  const absl::Status missing = Program::create(request, screens(), images).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(missing)) << missing;
  EXPECT_TRUE(absl::StrContains(missing.message(), "image \"nowhere\" is not here")) << missing;
}

TEST(Program, DrawsThePatchBelowThePattern) {
  ImageStore images;
  const std::string photo = images.add(png_of(64, 32, 13107)).value();
  const std::vector<ScreenInfo> patched{{.name = "back", .width_px = 64, .height_px = 40, .patch_rows = 8},
                                        {.name = "left", .width_px = 32, .height_px = 40, .patch_rows = 8}};
  v1::LoadProgramRequest request = good_request();
  v1::ProgramStep& step = *request.mutable_steps(0);
  step.set_patch_id(0x1234);
  for (const std::string kind : {"gauss_stripe", "photo", "patch"}) {
    v1::Stimulus& stimulus = *step.mutable_stimuli(0);
    stimulus.set_panel("back");
    stimulus.set_kind(kind);
    stimulus.set_image(photo);
    stimulus.set_patch_id(0x4321);
    const Program program = Program::create(request, patched, images).value();
    const std::vector<Picture> pictures = program.pictures(0);
    RadianceImage back(64, 40), left(32, 40);
    if (kind == "gauss_stripe") {
      const RadianceImage pattern =
          Pattern::create(stimulus, {.width_px = 64, .height_px = 32}).value().rasterised();
      std::copy(pattern.samples.begin(), pattern.samples.end(), back.samples.begin());
    } else if (kind == "photo") {
      std::fill_n(back.samples.begin(), 64 * 32 * 3, 13107.0f / 65535.0f);
    }
    IdPatch{.width_px = 64, .first_row = 32, .rows = 8}.draw(kind == "patch" ? 0x4321 : 0x1234, back);
    IdPatch{.width_px = 32, .first_row = 32, .rows = 8}.draw(0x1234, left);
    EXPECT_EQ(pictures[0]->samples, back.samples) << kind;
    EXPECT_EQ(pictures[1]->samples, left.samples) << kind;
  }
  step.clear_patch_id();
  EXPECT_EQ(Program::create(request, patched, images)->pictures(0)[1], nullptr) << "dark is black";
  step.mutable_stimuli(0)->set_patch_id(65536);
  EXPECT_TRUE(absl::StrContains(Program::create(request, patched, images).status().message(),
                                "patch_id is 65536; it must be 0 to 65535"));
  step.mutable_stimuli(0)->set_patch_id(1);
  expect_refused(request, "monitor \"back\" shows no id patch; start its display with --patch-rows");
}

TEST(ImageStore, NamesPicturesByContent) {
  ImageStore images;
  const std::string a = images.add(png_of(4, 4, 1)).value();
  EXPECT_EQ(images.add(png_of(4, 4, 1)).value(), a);
  EXPECT_NE(images.add(png_of(4, 4, 2)).value(), a);
  EXPECT_NE(images.find(a), nullptr);
  EXPECT_EQ(images.find("other"), nullptr);
}

TEST(ImageStore, RefusesWhatIsNoPicture) {
  ImageStore images;
  const std::string png = png_of(16, 16, 500);
  std::string flipped = png;
  flipped[png.size() / 2] = static_cast<char>(flipped[png.size() / 2] ^ 0x10);
  for (const std::string& bytes : {std::string(), std::string("hello"), png.substr(0, 20), flipped}) {
    EXPECT_TRUE(absl::IsInvalidArgument(images.add(bytes).status())) << bytes.size();
  }
}

TEST(ImageStore, IsBoundedByCountAndBytes) {
  ImageStore few;
  absl::Status status;
  int stored = 0;
  std::string first;
  for (std::uint16_t code = 0; status.ok() && code < 1000; ++code) {
    const absl::StatusOr<std::string> name = few.add(png_of(2, 2, code));
    status = name.status();
    if (code == 0) first = *name;
    if (status.ok()) ++stored;
  }
  EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
  EXPECT_EQ(stored, 64);
  EXPECT_EQ(few.add(png_of(2, 2, 0)).value(), first) << "what is there may be sent again";

  ImageStore small(300);  // a picture of 4x4 takes 192
  ASSERT_TRUE(small.add(png_of(4, 4, 1)).ok());
  EXPECT_TRUE(absl::IsResourceExhausted(small.add(png_of(4, 4, 2)).status()));
  EXPECT_TRUE(small.add(png_of(3, 3, 2)).ok()) << "exactly full";
}

}  // namespace
}  // namespace glasswing
