#include "display-node/program.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/file.h"
#include "core/base/status.h"
#include "core/frame/image_file.h"

namespace glasswing {
namespace {

constexpr size_t kMaxImages = 64;
constexpr int kMaxSteps = 20000;
constexpr size_t kAheadBytes = 256u << 20;  // rasterised when the program is loaded; the rest as it plays

}  // namespace

absl::StatusOr<std::string> ImageStore::add(const std::string& png) {
  GW_ASSIGN_OR_RETURN(const Image16 image, decode_png(png));
  auto radiance = std::make_shared<RadianceImage>(image.width_px, image.height_px);
  std::transform(image.samples.begin(), image.samples.end(), radiance->samples.begin(), radiance_of);
  std::string name = checksum_of(png);
  std::erase(name, ':');
  const size_t bytes = radiance->samples.size() * sizeof(float);
  const std::lock_guard lock(mutex_);
  if (images_.contains(name)) return name;
  if (images_.size() >= kMaxImages || held_bytes_ + bytes > capacity_bytes_) {
    return absl::ResourceExhaustedError(fmt::format(
        "this display holds {} images, {} bytes; one of {} bytes does not fit: it takes {} images, {} bytes",
        images_.size(), held_bytes_, bytes, kMaxImages, capacity_bytes_));
  }
  held_bytes_ += bytes;
  images_[name] = std::move(radiance);
  return name;
}

Picture ImageStore::find(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const auto found = images_.find(name);
  return found == images_.end() ? nullptr : found->second;
}

absl::StatusOr<Program> Program::create(const v1::LoadProgramRequest& request,
                                        const std::vector<ScreenInfo>& screens, const ImageStore& images) {
  if (request.program().empty()) {
    return absl::InvalidArgumentError("program is empty; it must be a name");
  }
  if (request.hold_refreshes() < 2 || request.hold_refreshes() > 600) {
    return absl::InvalidArgumentError(
        fmt::format("hold_refreshes is {}; it must be 2 to 600", request.hold_refreshes()));
  }
  if (request.steps().empty() || request.steps_size() > kMaxSteps) {
    return absl::InvalidArgumentError(
        fmt::format("the program has {} steps; it must have 1 to {}", request.steps_size(), kMaxSteps));
  }
  Program program;
  program.name_ = request.program();
  program.hold_refreshes_ = request.hold_refreshes();
  program.screen_count_ = screens.size();
  size_t ahead_bytes = 0;
  for (const v1::ProgramStep& wanted : request.steps()) {
    Step step{.number = wanted.step(), .lit = {}};
    for (const v1::Stimulus& stimulus : wanted.stimuli()) {
      const auto screen = std::find_if(screens.begin(), screens.end(),
                                       [&](const ScreenInfo& s) { return s.name == stimulus.panel(); });
      if (screen == screens.end()) {
        std::string names;
        for (const ScreenInfo& each : screens) names += (names.empty() ? "" : ", ") + each.name;
        return absl::InvalidArgumentError(fmt::format("step {}: there is no monitor \"{}\"; there are: {}",
                                                      wanted.step(), stimulus.panel(), names));
      }
      const auto index = static_cast<size_t>(screen - screens.begin());
      if (std::any_of(step.lit.begin(), step.lit.end(),
                      [&](const Lit& lit) { return lit.screen == index; })) {
        return absl::InvalidArgumentError(fmt::format(
            "step {}: monitor \"{}\" is lit twice; it must have one stimulus", wanted.step(), screen->name));
      }
      const MonitorSize size{.width_px = screen->width_px, .height_px = screen->height_px};
      Lit lit{.screen = index, .pattern = std::nullopt, .picture = nullptr};
      if (stimulus.kind() == "photo") {
        lit.picture = images.find(stimulus.image());
        if (lit.picture == nullptr) {
          return absl::FailedPreconditionError(fmt::format("step {}: image \"{}\" is not here; send it first",
                                                           wanted.step(), stimulus.image()));
        }
        if (lit.picture->width_px != size.width_px || lit.picture->height_px != size.height_px) {
          return absl::InvalidArgumentError(fmt::format(
              "step {}: image \"{}\" is {}x{}; monitor \"{}\" is {}x{}", wanted.step(), stimulus.image(),
              lit.picture->width_px, lit.picture->height_px, screen->name, size.width_px, size.height_px));
        }
      } else {
        absl::StatusOr<Pattern> pattern = Pattern::create(stimulus, size);
        if (!pattern.ok()) {
          return absl::InvalidArgumentError(
              fmt::format("step {}: {}", wanted.step(), std::string(pattern.status().message())));
        }
        lit.pattern = *pattern;
        ahead_bytes +=
            sizeof(float) * 3 * static_cast<size_t>(size.width_px) * static_cast<size_t>(size.height_px);
        if (ahead_bytes <= kAheadBytes) lit.picture = std::make_shared<RadianceImage>(pattern->rasterised());
      }
      step.lit.push_back(std::move(lit));
    }
    program.steps_.push_back(std::move(step));
  }
  return program;
}

std::vector<Picture> Program::pictures(size_t index) const {
  std::vector<Picture> pictures(screen_count_);
  for (const Lit& lit : steps_[index].lit) {
    pictures[lit.screen] =
        lit.picture != nullptr ? lit.picture : std::make_shared<RadianceImage>(lit.pattern->rasterised());
  }
  return pictures;
}

}  // namespace glasswing
