#include "solver/ramp/ramp_extractor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/for_rows.h"
#include "core/base/status.h"
#include "solver/background/mask_cleaning.h"
#include "solver/method/sample_noise.h"
#include "solver/ramp/byte_runs.h"
#include "solver/ramp/highlights.h"
#include "solver/ramp/moved_background.h"
#include "solver/ramp/partial_cover.h"
#include "solver/ramp/ramp_matte.h"
#include "solver/ramp/ramp_stage.h"

namespace glasswing {
namespace {

// Below this many standard deviations of the noise the origin of light is unknown.
constexpr float kMinLight_sd = 3.0f;
constexpr double kUsualLight = 0.5;       // of the ramp
constexpr double kHighlightReach = 0.04;  // of the picture's diagonal

SampleNoise noise_of(const RampStage& stage, const FrameView& view) {
  SampleNoise noise = stage.noise;
  if (!stage.noise_known) noise.read_sd = std::max(noise.read_sd, roughness(view));
  return noise;
}

// The cleaned mask: 255 where the light differs from the empty stage's.
std::vector<std::uint8_t> object_of(const RampStage& stage, const RampLight& light, const SampleNoise& noise,
                                    const RampOptions& options, const MaskCleaning& cleaning,
                                    int thread_count) {
  const double least = options.min_difference / options.threshold_sd;
  const auto threshold = static_cast<float>(options.threshold_sd * options.threshold_sd);
  const auto share = static_cast<float>(1.0 + stage.empty_share);
  const float read = static_cast<float>(noise.read_sd * noise.read_sd) * share;
  const float gain = static_cast<float>(noise.gain) * share, floor = static_cast<float>(least * least);
  std::vector<std::uint8_t> object(stage.behind.size());
  for_rows(stage.height_px, thread_count, [&](int first, int last) {
    const size_t width = stage.width_px;
    std::vector<float> squares(3 * width);
    for (int y = first; y < last; ++y) {
      const size_t from = static_cast<size_t>(y) * width;
      for (size_t i = 0; i < 3 * width; ++i) {
        const float empty = stage.average[3 * from + i], difference = light[3 * from + i] - empty;
        const float variance = read + gain * (empty > 0.0f ? empty : 0.0f);
        squares[i] = difference * difference / (variance > floor ? variance : floor);
      }
      const float* square = squares.data();
      const Behind* const behind = stage.behind.data() + from;
      std::uint8_t* const to = object.data() + from;
      for (size_t x = 0; x < width; ++x, square += 3) {
        const bool differs = square[0] + square[1] + square[2] > threshold;
        to[x] = differs && behind[x] != Behind::kPatch ? 255 : 0;
      }
    }
  });
  clean_mask(object, stage.width_px, stage.height_px, cleaning);
  return object;
}

// Fills in values for pixels off the object, except alpha.
void put_empty_stage(const RampStage& stage, size_t begin, size_t end, RampFrame& frame) {
  const auto from = static_cast<std::ptrdiff_t>(begin), to = static_cast<std::ptrdiff_t>(end);
  std::copy(stage.x_px.begin() + from, stage.x_px.begin() + to, frame.x_px.begin() + from);
  std::copy(stage.y_px.begin() + from, stage.y_px.begin() + to, frame.y_px.begin() + from);
  for (std::vector<float>* plane :
       {&frame.rho, &frame.highlight, &frame.info_xx, &frame.info_xy, &frame.info_yy})
    std::fill(plane->begin() + from, plane->begin() + to, 0.0f);
  std::transform(stage.behind.begin() + from, stage.behind.begin() + to, frame.flags.begin() + from,
                 [](Behind behind) { return behind == Behind::kPatch ? kFlagNoData : kFlagNone; });
}

// Finds c, rho and the information of pixels on the object.
class ObjectPixels {
 public:
  static constexpr size_t kMax = ColourManifold::Colours::kMax;

  ObjectPixels(const RampStage& stage, const SampleNoise& noise, const FrameView& view,
               const RampLight& light)
      : stage_(stage),
        view_(view),
        light_(light),
        read_(static_cast<float>(noise.read_sd * noise.read_sd)),
        gain_(static_cast<float>(noise.gain)) {}

  // Handles `count` pixels from `first` on, at most kMax.
  void find(size_t first, size_t count, RampFrame& frame) {
    const ColourManifold& manifold = stage_.manifold;
    for (size_t c = 0; c < 3; ++c) {
      for (size_t i = 0; i < count; ++i) {
        const size_t at = 3 * (first + i) + c;
        const float seen = light_[at];
        colours_.light[c][i] = seen - (1.0f - frame.alpha[first + i]) * stage_.average[at];
        colours_.variance[c][i] = read_ + gain_ * (seen > 0.0f ? seen : 0.0f);
      }
    }
    manifold.find(colours_, count);
    for (size_t i = 0; i < count; ++i) {
      const size_t at = first + i;
      const auto of = [&](const std::array<ColourManifold::Colours::Values, 3>& channels) {
        return std::array<float, 3>{channels[0][i], channels[1][i], channels[2][i]};
      };
      const std::array<float, 3> own = of(colours_.light);
      const float level = manifold.level(own[0], own[1], own[2]);
      const float darkest = kMinLight_sd * kMinLight_sd * manifold.level_variance(of(colours_.variance));
      if (!(level > 0.0f && level * level > darkest) || frame.alpha[at] == 0.0f) {
        frame.rho[at] = std::max(level, 0.0f);
        continue;
      }
      frame.x_px[at] = colours_.x_px[i];
      frame.y_px[at] = colours_.y_px[i];
      frame.rho[at] = colours_.rho[i];
      frame.info_xx[at] = colours_.information_per_px2[0][i];
      frame.info_xy[at] = colours_.information_per_px2[1][i];
      frame.info_yy[at] = colours_.information_per_px2[2][i];
    }
  }

  // 255 in certain highlights.
  void mark_highlights(size_t first, size_t count, float rho, const RampFrame& frame,
                       std::span<std::uint8_t> sure) const {
    const auto covered = [&](size_t at) { return frame.alpha[at] > kHighlightCover; };
    for (size_t at = first; at < first + count; ++at) sure[at] = frame.rho[at] > rho && covered(at) ? 255 : 0;
    const auto samples = view_.samples.subspan(3 * first, 3 * count);
    std::uint16_t most = 0;
    for (const std::uint16_t sample : samples) most = std::max(most, sample);
    if (most < kSaturatedCode) return;
    for (size_t i = 0; i < samples.size(); ++i) {
      if (samples[i] >= kSaturatedCode && covered(first + i / 3)) sure[first + i / 3] = 255;
    }
  }

 private:
  const RampStage& stage_;
  const FrameView& view_;
  const RampLight& light_;
  float read_, gain_;
  ColourManifold::Colours colours_{};
};

}  // namespace

struct RampExtractor::Prepared {
  RampStage stage;
  RampOptions options;
  MaskCleaning cleaning;
  int highlight_reach_px = 1;
  v1::MatteMetadata metadata;
};

absl::StatusOr<RampExtractor> RampExtractor::create(const v1::CaptureManifest& manifest,
                                                    const VideoLayout& layout,
                                                    std::span<const FrameView> empties,
                                                    const RampOptions& options,
                                                    std::span<const FrameView> black) {
  GW_ASSIGN_OR_RETURN(RampStage stage, RampStage::measure(manifest, layout, empties, black));
  MaskCleaning cleaning =
      usual_cleaning(stage.width_px, stage.height_px, options.dilation_px, options.erosion_px);
  cleaning.fill_holes = options.fill_holes;
  const double diagonal = std::hypot(stage.width_px, stage.height_px);
  v1::MatteMetadata metadata;
  metadata.set_format_version(1);
  metadata.set_session(manifest.session());
  metadata.set_method("ramp");
  *metadata.mutable_monitors() = manifest.monitors();
  metadata.set_width_px(stage.width_px);
  metadata.set_height_px(stage.height_px);
  metadata.set_generator("glasswing");
  metadata.set_footprint(std::string(kBoxFootprint));
  for (const std::string& warning : stage.warnings) metadata.add_warnings(warning);
  const int reach = std::max(2, static_cast<int>(std::lround(kHighlightReach * diagonal)));
  return RampExtractor(
      std::make_shared<Prepared>(Prepared{.stage = std::move(stage),
                                          .options = options,
                                          .cleaning = cleaning,
                                          .highlight_reach_px = options.highlight_reach_px.value_or(reach),
                                          .metadata = std::move(metadata)}));
}

absl::StatusOr<RampFrame> RampExtractor::extract(const FrameView& view, int thread_count,
                                                 RampFrame spent) const {
  const RampStage& stage = prepared_->stage;
  if (view.width_px != stage.width_px || view.height_px != stage.height_px) {
    return absl::InvalidArgumentError(fmt::format("the frame is {}x{}; the empty stage is {}x{}",
                                                  view.width_px, view.height_px, stage.width_px,
                                                  stage.height_px));
  }
  const SampleNoise noise = noise_of(stage, view);
  const RampLight light(view, stage.black);
  GW_RETURN_IF_ERROR(check_shows_ramp(stage, light));
  const std::vector<std::uint8_t> object =
      object_of(stage, light, noise, prepared_->options, prepared_->cleaning, thread_count);
  RampFrame frame = std::move(spent);
  frame.resize(stage.width_px, stage.height_px);
  const double usual_variance = noise.variance(kUsualLight);
  const auto usual = static_cast<float>(usual_variance);
  frame.rho_sd = std::sqrt(stage.manifold.level_variance({usual, usual, usual}));
  partial_cover({.width_px = stage.width_px,
                 .height_px = stage.height_px,
                 .light = light,
                 .empty = stage.average,
                 .object = object},
                prepared_->options.edge_px, usual_variance, thread_count, frame.alpha);
  const HighlightRule rule{.delta = prepared_->options.delta,
                           .rise = prepared_->options.highlight_rise,
                           .rho_sd = frame.rho_sd,
                           .reach_px = prepared_->highlight_reach_px};
  std::vector<std::uint8_t> sure(stage.behind.size());
  for_rows(stage.height_px, thread_count, [&](int first, int last) {
    ObjectPixels pixels(stage, noise, view, light);
    const size_t row = stage.width_px;
    for (int y = first; y < last; ++y) {
      const size_t begin = static_cast<size_t>(y) * row;
      put_empty_stage(stage, begin, begin + row, frame);
      const std::uint8_t *run = object.data() + begin, *const end = run + row;
      while ((run = next_set(run, end)) != end) {
        const std::uint8_t* const run_end =
            next_clear(run, run + std::min(end - run, std::ptrdiff_t{ObjectPixels::kMax}));
        const auto at = static_cast<size_t>(run - object.data()), count = static_cast<size_t>(run_end - run);
        pixels.find(at, count, frame);
        pixels.mark_highlights(at, count, rule.sure_rho(), frame, sure);
        run = run_end;
      }
    }
  });
  // Both checks read the frame.
  absl::Status stands;
  std::vector<std::uint8_t> highlights;
  for_rows(2, std::min(thread_count, 2), [&](int first, int last) {
    if (first == 0) stands = check_background_stands(stage, light, frame);
    if (last < 2 || !prepared_->options.highlights) return;
    highlights = find_highlights(frame, sure, rule);
  });
  GW_RETURN_IF_ERROR(stands);
  if (!highlights.empty()) bridge_highlights(highlights, prepared_->options.highlight_blur_px, frame);
  return frame;
}

void RampExtractor::finish(const FrameView& view, RampFrame& frame, int thread_count) const {
  const RampStage& stage = prepared_->stage;
  const RampOptions& options = prepared_->options;
  for_rows(stage.height_px, thread_count, [&](int first, int last) {
    const size_t end = static_cast<size_t>(last) * stage.width_px;
    for (size_t at = static_cast<size_t>(first) * stage.width_px; at < end; ++at) {
      frame.rho[at] = std::clamp(frame.rho[at], 0.0f, 1.0f);
      if (frame.highlight[at] == 0.0f) continue;
      const ColourManifold::Light ramp =
          stage.manifold.light(static_cast<double>(frame.x_px[at]), static_cast<double>(frame.y_px[at]));
      float most = 0.0f;
      bool all_clipped = true;
      for (size_t c = 0; c < 3; ++c) {
        const std::uint16_t sample = view.samples[3 * at + c];
        const float seen = (static_cast<float>(sample) - view.zero) * view.unit -
                           (stage.black.empty() ? 0.0f : stage.black[3 * at + c]);
        most = std::max(most, seen - (1.0f - frame.alpha[at]) * stage.average[3 * at + c] -
                                  frame.rho[at] * static_cast<float>(ramp[c]));
        all_clipped = all_clipped && sample >= kSaturatedCode;
      }
      if (all_clipped) {
        most = std::max(most, static_cast<float>(options.clipped_highlight));
        frame.flags[at] |= kFlagSaturated;
      }
      frame.highlight[at] = most * static_cast<float>(options.highlight_gain);
    }
  });
}

Matte RampExtractor::matte(const RampFrame& frame, int thread_count) const {
  return matte_of(prepared_->stage, prepared_->metadata, frame, thread_count);
}

const std::vector<std::string>& RampExtractor::warnings() const {
  return prepared_->stage.warnings;
}

}  // namespace glasswing
