#include "tests/results/rendered_scene.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "core/base/status.h"
#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/image/image_file.h"
#include "core/import/foreign_manifest.h"
#include "core/pattern/pattern.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

RadianceImage picture(const fs::path& path) {
  return read_radiance(path, Encoding::kLinear).value();
}

Image16 degraded(const RadianceImage& light, const Degradation& degradation, unsigned frame) {
  std::mt19937 random(degradation.seed * 100003 + frame);
  std::normal_distribution<double> normal;  // a width of 0 would be undefined
  const double levels = std::exp2(degradation.bits) - 1.0;
  Image16 image(light.width_px, light.height_px, light.channels);
  for (size_t i = 0; i < light.samples.size(); ++i) {
    const double seen = light.samples[i];
    const double photons = degradation.full_well > 0.0 ? std::max(seen, 0.0) / degradation.full_well : 0.0;
    const double sd = std::sqrt(degradation.noise_sd * degradation.noise_sd + photons);
    const double value = std::clamp(seen + (sd > 0.0 ? sd * normal(random) : 0.0), 0.0, 1.0);
    image.samples[i] = static_cast<std::uint16_t>(std::lround(std::round(value * levels) / levels * 65535.0));
  }
  return image;
}

}  // namespace

RenderedScene::RenderedScene(fs::path directory)
    : directory_(std::move(directory)),
      name_(directory_.filename().string()),
      manifest_(read_any_manifest(directory_).value()),
      mask_(read_frame_file(directory_ / "mask_true.png").value()) {
  nlohmann::json::parse(read_file(directory_ / "manifest.json").value())
      .at("cam_to_mon_affine")
      .get_to(monitor_from_camera_);
}

void RenderedScene::calibrate(const Degradation& degradation) {
  manifest_.mutable_camera()->set_read_sd(degradation.noise_sd);
  manifest_.mutable_camera()->set_gain(degradation.full_well > 0.0 ? 1.0 / degradation.full_well : 0.0);
  manifest_.mutable_camera()->set_bits(degradation.bits);
}

std::vector<std::string> RenderedScene::photograph_names() const {
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory_ / "ref")) {
    const std::string file = entry.path().filename().string();
    // clean_black and clean_white are solids without noise.
    if (file.ends_with("_obj.png") && !file.starts_with("clean_"))
      names.push_back(file.substr(0, file.size() - 8));
  }
  std::sort(names.begin(), names.end());
  return names;
}

// Names are the renderer's: left_X shows X on the monitor "left" alone; some show a picture on each.
Photograph RenderedScene::photograph(const std::string& name) const {
  Photograph photograph{.name = name,
                        .backgrounds = std::vector<RadianceImage>(manifest_.monitors_size()),
                        .seen = picture(directory_ / "ref" / (name + "_obj.png")),
                        .bare = {}};
  // Without the object the camera does not see a monitor at the side.
  const fs::path bare = directory_ / "ref" / (name + "_bg.png");
  photograph.bare =
      fs::exists(bare) ? picture(bare) : RadianceImage(photograph.seen.width_px, photograph.seen.height_px);
  const auto show = [&](size_t monitor, const std::string& on_it) {
    const std::string panel = monitor == 0 ? "" : manifest_.monitors(static_cast<int>(monitor)).name() + "_";
    photograph.backgrounds[monitor] = picture(directory_ / "stim" / (panel + "photo_" + on_it + ".png"));
  };
  const std::map<std::string, std::vector<std::string>> several{
      {"both", {"stilllife", "stone"}},
      {"all", {"stilllife", "stone", "landscape"}},
      {"all2", {"landscape", "stilllife", "stone"}}};
  if (const auto found = several.find(name); found != several.end()) {
    for (size_t monitor = 0; monitor < found->second.size(); ++monitor) show(monitor, found->second[monitor]);
    return photograph;
  }
  for (size_t monitor = photograph.backgrounds.size(); monitor-- > 1;) {
    const std::string prefix = manifest_.monitors(static_cast<int>(monitor)).name() + "_";
    if (!name.starts_with(prefix)) continue;
    show(monitor, name.substr(prefix.size()));
    return photograph;
  }
  show(0, name);
  return photograph;
}

Photograph RenderedScene::white() const {
  const std::string& panel = manifest_.monitors(0).name();
  const auto frame = std::ranges::find_if(manifest_.frames(), [&](const v1::Frame& each) {
    const v1::Stimulus& shown = each.stimulus();
    return each.object() && shown.kind() == "solid" && (shown.panel().empty() || shown.panel() == panel) &&
           std::ranges::all_of(shown.colour(), [](double light) { return light == 1.0; });
  });
  Photograph photograph{.name = "white",
                        .backgrounds = std::vector<RadianceImage>(manifest_.monitors_size()),
                        .seen = picture(directory_ / frame->file()),
                        .bare = {}};
  photograph.backgrounds[0] =
      RadianceImage(manifest_.monitors(0).width_px(), manifest_.monitors(0).height_px());
  std::ranges::fill(photograph.backgrounds[0].samples, 1.0f);
  return photograph;
}

const Image16& RenderedScene::recorded(int frame) const {
  const auto known = recorded_.find(frame);
  if (known != recorded_.end()) return known->second;
  return recorded_[frame] =
             read_frame_file(directory_ / manifest_.frames(frame).file(), shape_of(manifest_.camera()))
                 .value();
}

// With several monitors the camera looks at the first.
RadianceImage RenderedScene::seen_straight(const v1::Stimulus& stimulus) const {
  constexpr int kRays = 4;  // across a pixel, as in the renderer
  RadianceImage seen(manifest_.camera().width_px(), manifest_.camera().height_px());
  const v1::Monitor& monitor = manifest_.monitors(0);
  if (stimulus.panel() != monitor.name()) return seen;
  const RadianceImage shown =
      Pattern::create(stimulus, {monitor.width_px(), monitor.height_px()}).value().rasterised();
  for (int y = 0; y < seen.height_px; ++y) {
    for (int x = 0; x < seen.width_px; ++x) {
      for (int ray = 0; ray < kRays * kRays; ++ray) {
        const double u = x + (ray % kRays + 0.5) / kRays, v = y + (ray / kRays + 0.5) / kRays;
        std::array<int, 2> at{};
        for (size_t axis = 0; axis < 2; ++axis) {
          const auto& [xx, xy, x0] = monitor_from_camera_[axis];
          at[axis] = static_cast<int>(std::floor(xx * u + xy * v + x0));
        }
        if (at[0] < 0 || at[1] < 0 || at[0] >= shown.width_px || at[1] >= shown.height_px) continue;
        for (int c = 0; c < 3; ++c) seen.at(x, y, c) += shown.at(at[0], at[1], c) / (kRays * kRays);
      }
    }
  }
  return seen;
}

RadianceImage RenderedScene::made(const v1::Frame& frame, const std::vector<Part>& parts) const {
  if (parts.empty()) return seen_straight(frame.stimulus());
  const FrameShape shape = shape_of(manifest_.camera());
  RadianceImage light(shape.width_px, shape.height_px, shape.channels);
  std::vector<double> sum(light.samples.size());
  for (const Part& part : parts) {
    const std::vector<std::uint16_t>& samples = recorded(part.frame).samples;
    for (size_t i = 0; i < sum.size(); ++i) sum[i] += part.weight * samples[i];
  }
  for (size_t i = 0; i < sum.size(); ++i) light.samples[i] = static_cast<float>(sum[i] / 65535.0);
  return light;
}

absl::StatusOr<FrameStack> RenderedScene::stack(const Method& method, const SynthesizedCapture& capture,
                                                const Degradation& degradation) const {
  FrameStack stack{.width_px = manifest_.camera().width_px(),
                   .first_row = 0,
                   .row_count = manifest_.camera().height_px(),
                   .rows = {},
                   .owner = nullptr,
                   .mosaic = mosaic_of(manifest_.camera())};
  stack.rows.resize(capture.manifest.frames_size());
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<PreparedMethod> prepared, method.prepare(capture.manifest));
  const std::vector<int>& needed = prepared->frames_needed();
  const auto frames = std::make_shared<std::vector<Image16>>();
  stack.owner = frames;
  for (const int frame : needed) {
    const RadianceImage light = made(capture.manifest.frames(frame), capture.parts[frame]);
    frames->push_back(degraded(light, degradation, static_cast<unsigned>(frame)));
  }
  for (size_t i = 0; i < needed.size(); ++i) stack.rows[needed[i]] = (*frames)[i].samples;
  return stack;
}

double RenderedScene::psnr(const RadianceImage& composite, const RadianceImage& seen) const {
  return psnr(composite, seen, std::nullopt);
}

double RenderedScene::native_psnr(const RadianceImage& composite, const RadianceImage& seen) const {
  return psnr(composite, seen, mosaic_of(manifest_.camera()));
}

double RenderedScene::psnr(const RadianceImage& composite, const RadianceImage& seen,
                           const std::optional<Mosaic>& sites) const {
  double sum = 0.0, count = 0.0;
  const size_t row = seen.samples.size() / static_cast<size_t>(seen.height_px);
  for (size_t i = 0; i < seen.samples.size(); ++i) {
    if (mask_.samples[i] <= 32767) continue;
    if (sites &&
        sites->channel(static_cast<int>(i % row / 3), static_cast<int>(i / row)) != static_cast<int>(i % 3))
      continue;
    const double clipped = std::clamp(static_cast<double>(composite.samples[i]), 0.0, 1.0);
    const double difference = clipped - static_cast<double>(seen.samples[i]);
    sum += difference * difference;
    count += 1.0;
  }
  return -10.0 * std::log10(sum / count);
}

}  // namespace glasswing
