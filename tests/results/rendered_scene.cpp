#include "tests/results/rendered_scene.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <random>
#include <thread>

#include "core/frame/archive.h"
#include "core/frame/image_file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

RadianceImage picture(const fs::path& path) {
  return read_radiance(path, Encoding::kLinear).value();
}

void degrade(Image16& image, const Degradation& degradation, unsigned frame) {
  if (degradation.noise_sd == 0.0 && degradation.bits == 16) return;
  std::mt19937 random(degradation.seed * 100003 + frame);
  std::normal_distribution<double> noise(0.0, degradation.noise_sd);
  const double levels = std::exp2(degradation.bits) - 1.0;
  for (std::uint16_t& sample : image.samples) {
    const double value = std::clamp(sample / 65535.0 + noise(random), 0.0, 1.0);
    sample = static_cast<std::uint16_t>(std::lround(std::round(value * levels) / levels * 65535.0));
  }
}

}  // namespace

RenderedScene::RenderedScene(fs::path directory)
    : directory_(std::move(directory)),
      name_(directory_.filename().string()),
      manifest_(read_any_manifest(directory_).value()),
      mask_(read_frame_file(directory_ / "mask_true.png").value()) {}

std::vector<std::string> RenderedScene::photograph_names() const {
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory_ / "ref")) {
    const std::string file = entry.path().filename().string();
    if (file.ends_with("_obj.png")) names.push_back(file.substr(0, file.size() - 8));
  }
  std::sort(names.begin(), names.end());
  return names;
}

// Names are as the renderer gave them: left_X shows X on the second monitor, both shows the first photograph
// behind and the second at the left.
Photograph RenderedScene::photograph(const std::string& name) const {
  Photograph photograph{
      .name = name,
      .backgrounds = std::vector<RadianceImage>(static_cast<size_t>(manifest_.monitors_size())),
      .seen = picture(directory_ / "ref" / (name + "_obj.png"))};
  const auto shown = [&](const std::string& file) { return picture(directory_ / "stim" / file); };
  if (name == "both") {
    photograph.backgrounds[0] = shown("photo_stilllife.png");
    photograph.backgrounds[1] = shown("left_photo_stone.png");
  } else if (name.starts_with("left_")) {
    photograph.backgrounds[1] = shown("left_photo_" + name.substr(5) + ".png");
  } else {
    photograph.backgrounds[0] = shown("photo_" + name + ".png");
  }
  return photograph;
}

FrameStack RenderedScene::stack(const Method& method, const Degradation& degradation) const {
  FrameStack stack{.manifest = manifest_,
                   .first_row = 0,
                   .row_count = manifest_.camera().height_px(),
                   .rows = {},
                   .owner = nullptr};
  stack.rows.resize(static_cast<size_t>(manifest_.frames_size()));
  const std::vector<int> needed = method.frames_needed(manifest_).value();
  const auto frames = std::make_shared<std::vector<Image16>>();
  stack.owner = frames;
  for (const int frame : needed) {
    Image16 image = read_frame_file(directory_ / manifest_.frames(frame).file()).value();
    degrade(image, degradation, static_cast<unsigned>(frame));
    frames->push_back(std::move(image));
  }
  for (size_t i = 0; i < needed.size(); ++i)
    stack.rows[static_cast<size_t>(needed[i])] = (*frames)[i].samples;
  return stack;
}

double RenderedScene::psnr(const RadianceImage& composite, const RadianceImage& seen) const {
  double sum = 0.0, count = 0.0;
  for (size_t i = 0; i < seen.samples.size(); ++i) {
    if (mask_.samples[i] <= 32767) continue;
    const double clipped = std::clamp(static_cast<double>(composite.samples[i]), 0.0, 1.0);
    const double difference = clipped - static_cast<double>(seen.samples[i]);
    sum += difference * difference;
    count += 1.0;
  }
  return -10.0 * std::log10(sum / count);
}

}  // namespace glasswing
