#include "tests/results/rendered_video.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/status.h"
#include "core/composite/compositor.h"
#include "core/image/image_file.h"
#include "solver/methods.h"
#include "solver/ramp/video_layout.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> pictures_in(const fs::path& directory, const std::string& prefix) {
  std::vector<fs::path> paths;
  for (const auto& entry : fs::directory_iterator(directory)) {
    if (entry.path().filename().string().starts_with(prefix)) paths.push_back(entry.path());
  }
  std::ranges::sort(paths);
  return paths;
}

class Pictures final : public VideoSource {
 public:
  Pictures(v1::CaptureManifest manifest, std::vector<fs::path> paths)
      : manifest_(std::move(manifest)), paths_(std::move(paths)) {}
  const v1::CaptureManifest& manifest() const override { return manifest_; }
  absl::StatusOr<VideoFrame> read(int frame) override {
    GW_ASSIGN_OR_RETURN(Image16 image, read_frame_file(paths_.at(static_cast<size_t>(frame))));
    const auto owner = std::make_shared<const Image16>(std::move(image));
    return VideoFrame{
        .view = {.width_px = owner->width_px, .height_px = owner->height_px, .samples = owner->samples},
        .owner = owner};
  }

 private:
  v1::CaptureManifest manifest_;
  std::vector<fs::path> paths_;
};

double psnr_inside(const RadianceImage& composite, const Image16& photograph, const Image16& coverage) {
  double squares = 0.0;
  size_t count = 0;
  for (size_t i = 0; i < composite.samples.size(); ++i) {
    if (!(radiance_of(coverage.samples[i]) > 0.5f)) continue;
    const double error = static_cast<double>(radiance_of(code16_of(composite.samples[i]))) -
                         radiance_of(photograph.samples[i]);
    squares += error * error;
    ++count;
  }
  return -10.0 * std::log10(squares / static_cast<double>(count));
}

}  // namespace

absl::StatusOr<std::unique_ptr<VideoSource>> rendered_video(const fs::path& directory,
                                                            const std::string& sequence) {
  const bool noisy = sequence.ends_with("_noise");
  const std::vector<fs::path> empty =
      noisy ? pictures_in(directory / "bg", "ramp_noise") : std::vector<fs::path>{directory / "bg/ramp.png"};
  std::vector<fs::path> paths = empty;
  for (const fs::path& path : pictures_in(directory / sequence, "")) paths.push_back(path);
  GW_ASSIGN_OR_RETURN(const Image16 first, read_frame_file(paths.front()));
  GW_ASSIGN_OR_RETURN(const Image16 shown, read_frame_file(directory / "stim/ramp.png"));
  v1::CaptureManifest manifest;
  manifest.set_format_version(1);
  manifest.set_session(sequence);
  manifest.mutable_camera()->set_width_px(first.width_px);
  manifest.mutable_camera()->set_height_px(first.height_px);
  manifest.mutable_camera()->set_bits(16);
  manifest.mutable_camera()->set_response("linear");
  v1::Monitor& monitor = *manifest.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(shown.width_px);
  monitor.set_height_px(shown.height_px);
  for (size_t i = 0; i < paths.size(); ++i) {
    v1::Frame& frame = *manifest.add_frames();
    frame.set_file(paths[i].string());
    frame.set_object(i >= empty.size());
    frame.set_step(-1);
    frame.mutable_stimulus()->set_kind("ramp");
    frame.mutable_stimulus()->set_panel("back");
  }
  return std::make_unique<Pictures>(std::move(manifest), std::move(paths));
}

absl::StatusOr<std::vector<VideoScore>> score_video(const fs::path& directory, const MethodOptions& options) {
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<VideoMethod> method, make_video_method("ramp", options));
  std::vector<VideoScore> scores;
  for (const fs::path& sequence : pictures_in(directory, "ramp_")) {
    const std::string name = sequence.filename().string();
    const std::string light = name.find("dark") != std::string::npos ? "dark" : "light";
    std::vector<fs::path> photographs;
    for (const auto& entry : fs::directory_iterator(directory)) {
      const std::string other = entry.path().filename().string();
      if (other.ends_with("_" + light) && !other.starts_with("ramp_")) photographs.push_back(entry.path());
    }
    std::ranges::sort(photographs);
    GW_ASSIGN_OR_RETURN(const std::unique_ptr<VideoSource> source, rendered_video(directory, name));
    GW_ASSIGN_OR_RETURN(const VideoLayout layout, lay_out_video(source->manifest()));
    std::vector<Matte> mattes;
    GW_RETURN_IF_ERROR(method->solve(*source, 0, static_cast<int>(layout.frames.size()), 0, {},
                                     [&](int, absl::StatusOr<Matte> matte) {
                                       if (matte.ok()) mattes.push_back(*std::move(matte));
                                       return matte.status();
                                     }));
    for (const fs::path& photograph : photographs) {
      const std::string of = photograph.filename().string();
      GW_ASSIGN_OR_RETURN(
          const RadianceImage background,
          read_radiance(directory / "bg" / (of.substr(0, of.find('_')) + ".png"), Encoding::kLinear));
      double sum = 0.0;
      for (size_t i = 0; i < mattes.size(); ++i) {
        const std::string file = fmt::format("{:02}.png", i);
        GW_ASSIGN_OR_RETURN(const RadianceImage composited, composite(mattes[i], {background}));
        GW_ASSIGN_OR_RETURN(const Image16 truth, read_frame_file(photograph / file));
        GW_ASSIGN_OR_RETURN(const Image16 coverage, read_frame_file(directory / "mask_true" / file));
        sum += psnr_inside(composited, truth, coverage);
      }
      scores.push_back({name, of, sum / static_cast<double>(mattes.size())});
    }
  }
  return scores;
}

}  // namespace glasswing
