#include "display-node/playback/program.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/image/image_file.h"
#include "core/pattern/id_patch.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

constexpr size_t kMaxImages = 4096;
constexpr int kMaxSteps = 20000;

size_t bytes_of(const Image16& image) {
  return image.samples.size() * sizeof(std::uint16_t);
}

size_t bytes_of(const ScreenInfo& screen) {
  return sizeof(std::uint16_t) * 3 * static_cast<size_t>(screen.width_px) * screen.height_px;
}

}  // namespace

absl::StatusOr<std::string> ImageStore::add(const std::string& png) {
  std::string name = checksum_of(png);
  std::erase(name, ':');
  {
    const std::lock_guard lock(mutex_);
    if (images_.contains(name)) {
      std::erase(sent_, name);
      sent_.push_back(name);
      return name;
    }
  }
  GW_ASSIGN_OR_RETURN(Image16 decoded, decode_png(png));
  auto image = std::make_shared<const Image16>(std::move(decoded));
  const size_t bytes = bytes_of(*image);
  if (bytes > capacity_bytes_) {
    return absl::ResourceExhaustedError(fmt::format(
        "the photo takes {} bytes; this display holds photos of {} bytes in all", bytes, capacity_bytes_));
  }
  const std::lock_guard lock(mutex_);
  if (!images_.emplace(name, image).second) return name;  // sent twice at once
  sent_.push_back(name);
  held_bytes_ += bytes;
  while (images_.size() > kMaxImages || held_bytes_ > capacity_bytes_) {
    const auto oldest = images_.find(sent_.front());
    held_bytes_ -= bytes_of(*oldest->second);
    images_.erase(oldest);  // a program that shows it keeps it
    sent_.pop_front();
  }
  return name;
}

std::shared_ptr<const Image16> ImageStore::find(const std::string& name) const {
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
  program.screens_ = screens;
  GW_ASSIGN_OR_RETURN(program.dithers_, dithers_of(request.calibrations(), screens));
  for (const v1::ProgramStep& wanted : request.steps()) {
    GW_ASSIGN_OR_RETURN(Step step, program.checked(wanted, images));
    program.steps_.push_back(std::move(step));
  }
  program.draw_ahead(request);
  return program;
}

void Program::draw_ahead(const v1::LoadProgramRequest& request) {
  // A picture that is shown more than once, such as a video's ramp, is drawn once.
  std::map<std::pair<std::string, bool>, Picture>
      shared;  // by stimulus, and by whether there is a patch below
  size_t bytes = 0;
  for (size_t s = 0; s < steps_.size(); ++s) {
    for (const v1::Stimulus& stimulus : request.steps(static_cast<int>(s)).stimuli()) {
      const auto found = std::ranges::find(screens_, stimulus.panel(), &ScreenInfo::name);
      const size_t screen = found - screens_.begin();
      Shown& shown = steps_[s].shown[screen];
      if (!shown.pattern && shown.photo == nullptr) continue;
      Picture& picture = shared[{stimulus.SerializeAsString(), shown.patch_id.has_value()}];
      if (picture == nullptr) {
        bytes += bytes_of(screens_[screen]);
        if (bytes > kAheadBytes) continue;
        picture = shown.ahead = drawn(shown, screen);
      } else if (shown.patch_id) {
        shown.above_patch = picture;
      } else {
        shown.ahead = picture;
      }
    }
  }
}

absl::StatusOr<Program::Step> Program::checked(const v1::ProgramStep& wanted,
                                               const ImageStore& images) const {
  const auto bad = [&](const std::string& what) {
    return absl::InvalidArgumentError(fmt::format("step {}: {}", wanted.step(), what));
  };
  constexpr std::uint32_t kMaxId = std::numeric_limits<std::uint16_t>::max();
  Step step{.number = wanted.step(), .shown = std::vector<Shown>(screens_.size())};
  if (wanted.patch_id() > kMaxId)
    return bad(fmt::format("patch_id is {}; it must be 0 to {}", wanted.patch_id(), kMaxId));
  for (size_t i = 0; i < screens_.size(); ++i) {
    if (wanted.has_patch_id() && screens_[i].patch_rows > 0)
      step.shown[i].patch_id = static_cast<std::uint16_t>(wanted.patch_id());
  }
  std::set<size_t> lit;
  for (const v1::Stimulus& stimulus : wanted.stimuli()) {
    const auto screen = std::find_if(screens_.begin(), screens_.end(),
                                     [&](const ScreenInfo& s) { return s.name == stimulus.panel(); });
    if (screen == screens_.end()) {
      return bad(
          fmt::format("there is no monitor \"{}\"; there are: {}", stimulus.panel(), names_of(screens_)));
    }
    const size_t index = screen - screens_.begin();
    Shown& shown = step.shown[index];
    if (!lit.insert(index).second)
      return bad(fmt::format("monitor \"{}\" is lit twice; it must have one stimulus", screen->name));
    shown.are_codes = stimulus.codes();
    const MonitorSize size = pattern_size_of(*screen);
    if (kind_of(stimulus) == StimulusKind::kPhoto) {
      shown.photo = images.find(stimulus.image());
      if (shown.photo == nullptr) {
        return absl::FailedPreconditionError(fmt::format(
            "step {}: image \"{}\" is not here; send it first (only the most recent ones that fit are kept)",
            wanted.step(), stimulus.image()));
      }
      if (shown.photo->width_px != size.width_px || shown.photo->height_px != size.height_px) {
        return bad(fmt::format("image \"{}\" is {}x{}; monitor \"{}\" is {}x{}", stimulus.image(),
                               shown.photo->width_px, shown.photo->height_px, screen->name, size.width_px,
                               size.height_px));
      }
    } else if (kind_of(stimulus) == StimulusKind::kPatch) {
      if (screen->patch_rows == 0) {
        return bad(fmt::format("monitor \"{}\" shows no id patch; start its display with --patch-rows",
                               screen->name));
      }
      if (stimulus.patch_id() > kMaxId)
        return bad(fmt::format("stimulus patch_id is {}; it must be 0 to {}", stimulus.patch_id(), kMaxId));
      shown.patch_id = static_cast<std::uint16_t>(stimulus.patch_id());
    } else {
      absl::StatusOr<Pattern> pattern = Pattern::create(stimulus, size);
      if (!pattern.ok()) return bad(std::string(pattern.status().message()));
      shown.pattern = *pattern;
    }
  }
  return step;
}

Picture Program::drawn(const Shown& shown, size_t index) const {
  if (shown.ahead != nullptr) return shown.ahead;
  if (!shown.pattern && shown.photo == nullptr && !shown.patch_id) return nullptr;
  const ScreenInfo& screen = screens_[index];
  auto whole = std::make_shared<Image<std::uint16_t>>(screen.width_px, screen.height_px);
  const size_t row_size = 3 * static_cast<size_t>(screen.width_px);
  const size_t above_patch = row_size * static_cast<size_t>(pattern_size_of(screen).height_px);
  const std::span<std::uint16_t> codes(whole->samples);
  const auto draw = [&](const Dither::Rows& radiance) {
    if (dithers_[index] && !shown.are_codes)
      dithers_[index]->codes(radiance, screen.width_px, codes.first(above_patch));
    else
      round_to_codes(radiance, screen.width_px, screen.bits, codes.first(above_patch));
  };
  if (shown.above_patch != nullptr) {
    const std::span<const std::uint16_t> above(shown.above_patch->samples);
    std::ranges::copy(above.first(above_patch), codes.begin());
  } else if (shown.pattern) {
    draw([&](int y_px, std::span<float> row) { shown.pattern->rasterise(y_px, row); });
  } else if (shown.photo != nullptr) {
    draw([&](int y_px, std::span<float> row) {
      const std::uint16_t* const from = shown.photo->samples.data() + static_cast<size_t>(y_px) * row_size;
      std::transform(from, from + row_size, row.begin(), radiance_of);
    });
  }
  if (shown.patch_id) {
    RadianceImage strip(screen.width_px, screen.patch_rows);
    IdPatch{.width_px = screen.width_px, .first_row = 0, .rows = screen.patch_rows}.draw(*shown.patch_id,
                                                                                         strip);
    const auto highest = static_cast<std::uint16_t>((1 << screen.bits) - 1);
    std::transform(strip.samples.begin(), strip.samples.end(), codes.begin() + above_patch,
                   [&](float lit) { return lit > 0.0f ? highest : std::uint16_t{0}; });
  }
  return whole;
}

size_t Program::bytes_of_pictures() const {
  size_t bytes = 0;
  for (const ScreenInfo& screen : screens_) bytes += bytes_of(screen);
  return bytes;
}

std::vector<Picture> Program::pictures(size_t index) const {
  std::vector<Picture> pictures;
  for (size_t i = 0; i < screens_.size(); ++i) pictures.push_back(drawn(steps_[index].shown[i], i));
  return pictures;
}

}  // namespace glasswing
