#include "solver/background/empty_stage.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/pattern/stimulus_kind.h"
#include "solver/background/stage_layout.h"

namespace glasswing {
namespace {

constexpr double kFalsePositiveRate = 1e-4;
constexpr double kFourSd = 6e-5;  // the probability beyond four standard deviations
constexpr double kMinPlaceSd_px = 0.05, kLogSigmaError = 0.15;  // of a pixel about a smooth map

bool tells_of_the_empty_stage(const v1::Frame& frame) {
  const StimulusKind kind = kind_of(frame.stimulus());
  return !frame.object() && !frame.stimulus().reference() && frame.also_lit_size() == 0 &&
         (kind == StimulusKind::kSolid || kind == StimulusKind::kSquare);
}

double usual_exposure_ms(const v1::CaptureManifest& manifest) {
  std::map<double, int> counts;
  for (const v1::Frame& frame : manifest.frames()) {
    if (tells_of_the_empty_stage(frame)) ++counts[frame.exposure_ms()];
  }
  const auto most = std::ranges::max_element(counts, {}, [](const auto& entry) { return entry.second; });
  return most == counts.end() ? 0.0 : most->first;
}

void add_solid(const v1::Stimulus& stimulus, int frame, EmptyMonitor& monitor) {
  const double gray = gray_of(stimulus);
  if (gray <= 0.0 || (monitor.white >= 0 && gray <= monitor.white_light)) return;
  monitor.white = frame;
  monitor.white_light = gray;
}

void add_bars(const v1::Stimulus& stimulus, int frame, EmptyMonitor& monitor) {
  const bool vertical = stimulus.orient() == "vertical_bars";
  const double gray = gray_of(stimulus);
  if (!(stimulus.bar_width_px() >= 1.0) || !(gray > 0.0)) return;
  if (!vertical && stimulus.orient() != "horizontal_bars") return;
  if (stimulus.offset_px() != 0.0) return;  // BarDecoder's waves begin at the edge
  std::vector<BarFrames>& bars = monitor.bars[vertical ? 0 : 1];
  auto found = std::ranges::find_if(bars, [&](const BarFrames& known) {
    return known.width_px == stimulus.bar_width_px() && known.light == gray;
  });
  if (found == bars.end()) {
    bars.push_back({.width_px = stimulus.bar_width_px(), .light = gray});
    found = bars.end() - 1;
  }
  int& slot = stimulus.inverse() ? found->inverse : found->frame;
  if (slot < 0) slot = frame;
}

// Drops bars that cannot be normalised and repeated widths; sorts wide to narrow.
void settle(EmptyMonitor& monitor) {
  for (std::vector<BarFrames>& bars : monitor.bars) {
    const bool solids = monitor.white >= 0 && monitor.black >= 0;
    std::erase_if(bars,
                  [&](const BarFrames& known) { return known.frame < 0 || (known.inverse < 0 && !solids); });
    std::ranges::stable_sort(bars, [](const BarFrames& a, const BarFrames& b) {
      return a.width_px != b.width_px ? a.width_px > b.width_px : a.inverse > b.inverse;
    });
    const auto same_width = [](const BarFrames& a, const BarFrames& b) { return a.width_px == b.width_px; };
    bars.erase(std::unique(bars.begin(), bars.end(), same_width), bars.end());
  }
}

std::vector<double> widths_of(const std::vector<BarFrames>& bars) {
  std::vector<double> widths_px;
  for (const BarFrames& known : bars) widths_px.push_back(known.width_px);
  return widths_px;
}

Samples3 pixel_of(const FrameStack& stack, int frame, int x, int y) {
  Samples3 samples{};
  if (frame < 0) return samples;
  for (const int c : stack.channels(x, y)) {
    samples[c] = static_cast<double>(stack.at(frame, x, y, c));
  }
  return samples;
}

// The footprint of a camera pixel's box of `scale` monitor pixels.
double box_sigma_px(double scale) {
  return scale / std::sqrt(12.0);
}

}  // namespace

std::vector<EmptyMonitor> lay_out_empty_stage(const v1::CaptureManifest& manifest) {
  std::vector<EmptyMonitor> monitors;
  std::map<std::string, int> texture_of;
  for (const v1::Monitor& monitor : manifest.monitors()) {
    const int texture = static_cast<int>(monitors.size());
    texture_of.emplace(monitor.name(), texture);
    EmptyMonitor& empty = monitors.emplace_back();
    empty.texture = texture;
    empty.width_px = monitor.width_px();
    empty.height_px = monitor.height_px();
    empty.patch_rows = monitor.patch_rows();
  }
  const double exposure_ms = usual_exposure_ms(manifest);
  int black = -1;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    const auto texture = texture_of.find(frame.stimulus().panel());
    if (!tells_of_the_empty_stage(frame) || frame.exposure_ms() != exposure_ms) continue;
    if (texture == texture_of.end()) continue;
    EmptyMonitor& monitor = monitors[texture->second];
    if (kind_of(frame.stimulus()) == StimulusKind::kSquare) {
      add_bars(frame.stimulus(), i, monitor);
    } else if (gray_of(frame.stimulus()) == 0.0) {
      if (black < 0) black = i;
    } else {
      add_solid(frame.stimulus(), i, monitor);
    }
  }
  for (EmptyMonitor& monitor : monitors) {
    monitor.black = black;
    settle(monitor);
  }
  return monitors;
}

std::vector<int> frames_of(const std::vector<EmptyMonitor>& monitors) {
  std::set<int> frames;
  for (const EmptyMonitor& monitor : monitors) {
    frames.insert({monitor.black, monitor.white});
    for (const std::vector<BarFrames>& bars : monitor.bars) {
      for (const BarFrames& known : bars) frames.insert({known.frame, known.inverse});
    }
  }
  frames.erase(-1);
  return {frames.begin(), frames.end()};
}

void gather(const FrameStack& stack, const EmptyMonitor& monitor, int x, int y, EmptyPixel& pixel) {
  const ChannelRange measured = stack.channels(x, y);
  pixel.first_channel = static_cast<size_t>(measured.first);
  pixel.last_channel = static_cast<size_t>(measured.last);
  pixel.black = pixel_of(stack, monitor.black, x, y);
  pixel.white = pixel_of(stack, monitor.white, x, y);
  for (size_t axis = 0; axis < 2; ++axis) {
    pixel.bars[axis].clear();
    for (const BarFrames& known : monitor.bars[axis]) {
      pixel.bars[axis].push_back(
          {.lit = pixel_of(stack, known.frame, x, y), .inverse = pixel_of(stack, known.inverse, x, y)});
    }
  }
}

StraightView straight_view(const v1::Camera& camera, const EmptyMonitor& monitor, int x, int y) {
  StraightView view;
  view.scale = {static_cast<double>(monitor.width_px) / camera.width_px(),
                static_cast<double>(monitor.height_px + monitor.patch_rows) / camera.height_px()};
  view.centre_px = {(x + 0.5) * view.scale[0], (y + 0.5) * view.scale[1]};
  return view;
}

Mode BackgroundPoint::mode(int channel, int texture) const {
  const auto variance = [](double sigma_px) { return static_cast<float>(sigma_px * sigma_px); };
  return {.weight = static_cast<float>(std::max(weight[channel], 0.0)),
          .x_px = static_cast<float>(axis[0].centre_px),
          .y_px = static_cast<float>(axis[1].centre_px),
          .xx_px2 = variance(axis[0].sigma_px),
          .xy_px2 = 0.0f,
          .yy_px2 = variance(axis[1].sigma_px),
          .texture = texture};
}

BackgroundMap::BackgroundMap(const EmptyMonitor& monitor, const SampleNoise& noise, int channel_count)
    : monitor_(monitor),
      noise_(noise),
      decoders_{BarDecoder(widths_of(monitor.bars[0]), monitor.width_px),
                BarDecoder(widths_of(monitor.bars[1]), monitor.height_px)} {
  const size_t waves = monitor.bars[0].size() + monitor.bars[1].size();
  const size_t samples = static_cast<size_t>(channel_count) * (waves + (has_solids() ? 1 : 0));
  if (samples > 0) seen_threshold_ = chi_square_quantile(static_cast<double>(samples), kFalsePositiveRate);
  if (waves > 0) refuted_threshold_ = chi_square_quantile(static_cast<double>(waves), kFourSd);
}

BackgroundMap::Contrast BackgroundMap::difference_of(const EmptyPixel& pixel, size_t axis,
                                                     size_t level) const {
  const BarFrames& frames = monitor_.bars[axis][level];
  const BarSamples& bars = pixel.bars[axis][level];
  Contrast result;
  for (size_t c = pixel.first_channel; c < pixel.last_channel; ++c) {
    double difference = bars.lit[c] - bars.inverse[c];
    double variance = noise_.variance(bars.lit[c]) + noise_.variance(bars.inverse[c]);
    if (frames.inverse < 0) {
      // The complement would be black + the whole light - (lit - black).
      const double share = frames.light / monitor_.white_light;
      difference = 2.0 * (bars.lit[c] - pixel.black[c]) - share * (pixel.white[c] - pixel.black[c]);
      variance = 4.0 * noise_.variance(bars.lit[c]) + share * share * noise_.variance(pixel.white[c]) +
                 (2.0 - share) * (2.0 - share) * noise_.variance(pixel.black[c]);
    }
    result.radiance[c] = difference / frames.light;
    result.variance[c] = variance / (frames.light * frames.light);
  }
  return result;
}

// White - black per light 1. Without these frames, the mean of those bar differences that equal the largest
// within noise; this is too small only where the edges of every wave are in view.
BackgroundMap::Contrast BackgroundMap::contrast_of(const EmptyPixel& pixel) const {
  Contrast result;
  if (monitor_.white >= 0 && monitor_.black >= 0) {
    for (size_t c = pixel.first_channel; c < pixel.last_channel; ++c) {
      const double light = monitor_.white_light;
      result.radiance[c] = (pixel.white[c] - pixel.black[c]) / light;
      result.variance[c] =
          (noise_.variance(pixel.white[c]) + noise_.variance(pixel.black[c])) / (light * light);
    }
    return result;
  }
  std::vector<Contrast> differences;
  for (size_t axis = 0; axis < 2; ++axis) {
    for (size_t level = 0; level < monitor_.bars[axis].size(); ++level) {
      differences.push_back(difference_of(pixel, axis, level));
    }
  }
  for (size_t c = pixel.first_channel; c < pixel.last_channel; ++c) {
    double most = 0.0;
    for (const Contrast& difference : differences) most = std::max(most, std::abs(difference.radiance[c]));
    double sum = 0.0, variance = 0.0, count = 0.0;
    for (const Contrast& difference : differences) {
      const double size = std::abs(difference.radiance[c]);
      if (size < most - 4.0 * std::sqrt(difference.variance[c])) continue;
      sum += size;
      variance += difference.variance[c];
      count += 1.0;
    }
    if (count == 0.0) continue;
    result.radiance[c] = sum / count;
    result.variance[c] = variance / (count * count);
  }
  return result;
}

bool BackgroundMap::sees(const EmptyPixel& pixel, const Contrast& contrast) const {
  double chi_square = 0.0, signal = 0.0, variance = 0.0;
  const auto add = [&](const Contrast& light) {
    for (size_t c = pixel.first_channel; c < pixel.last_channel; ++c) {
      chi_square += light.radiance[c] * light.radiance[c] / std::max(light.variance[c], 1e-20);
    }
  };
  for (size_t axis = 0; axis < 2; ++axis) {
    for (size_t level = 0; level < monitor_.bars[axis].size(); ++level) {
      add(difference_of(pixel, axis, level));
    }
  }
  if (monitor_.white >= 0 && monitor_.black >= 0) add(contrast);
  for (size_t c = pixel.first_channel; c < pixel.last_channel; ++c) {
    signal += contrast.radiance[c];
    variance += contrast.variance[c];
  }
  // Light within the noise has no position worth finding.
  return chi_square > seen_threshold_ && signal > 4.0 * std::sqrt(variance);
}

bool BackgroundMap::usable(const EmptyPixel& pixel, const Contrast& contrast) const {
  if (!has_bars() && monitor_.texture != 0) return false;
  return (!has_bars() && !has_solids()) || sees(pixel, contrast);
}

// One v for all channels, each weighted by its contrast over its noise.
std::vector<BarDecoder::Sample> BackgroundMap::waves(const EmptyPixel& pixel, size_t axis,
                                                     const Contrast& contrast) const {
  std::vector<BarDecoder::Sample> samples;
  for (size_t level = 0; level < monitor_.bars[axis].size(); ++level) {
    const Contrast difference = difference_of(pixel, axis, level);
    double top = 0.0, bottom = 0.0;
    for (size_t c = pixel.first_channel; c < pixel.last_channel; ++c) {
      const double information = 1.0 / std::max(difference.variance[c] + contrast.variance[c], 1e-20);
      top += information * contrast.radiance[c] * difference.radiance[c];
      bottom += information * contrast.radiance[c] * contrast.radiance[c];
    }
    samples.push_back({.value = top / bottom, .sd = 1.0 / std::sqrt(bottom)});
  }
  return samples;
}

// Fits F and R per channel by least squares to  sample = F + R Z light h,  h = 0 for black, 1 for white, (1 +
// v) / 2 for bars and (1 - v) / 2 for their complement, with the v that were fitted.
void BackgroundMap::weigh(const EmptyPixel& pixel, const Contrast& contrast, BackgroundPoint& point) const {
  if (!has_bars()) {
    for (size_t c = pixel.first_channel; c < pixel.last_channel; ++c)
      point.weight[c] = has_solids() ? std::max(contrast.radiance[c], 0.0) : 1.0;
    return;
  }
  struct Sums {
    double n = 0.0, h = 0.0, hh = 0.0, i = 0.0, ih = 0.0;
  };
  std::array<Sums, kChannels> sums;
  const auto add = [&](const Samples3& sample, double h) {
    for (size_t c = pixel.first_channel; c < pixel.last_channel; ++c) {
      const double information = 1.0 / std::max(noise_.variance(sample[c]), 1e-20);
      sums[c].n += information;
      sums[c].h += information * h;
      sums[c].hh += information * h * h;
      sums[c].i += information * sample[c];
      sums[c].ih += information * sample[c] * h;
    }
  };
  if (monitor_.black >= 0) add(pixel.black, 0.0);
  if (monitor_.white >= 0) add(pixel.white, monitor_.white_light);
  for (size_t axis = 0; axis < 2; ++axis) {
    const AxisFit& fit = point.axis[axis];
    for (size_t level = 0; level < monitor_.bars[axis].size(); ++level) {
      const BarFrames& frames = monitor_.bars[axis][level];
      const double v = decoders_[axis].value(level, fit.centre_px, fit.sigma_px).v;
      add(pixel.bars[axis][level].lit, 0.5 * frames.light * (1.0 + v));
      if (frames.inverse >= 0) add(pixel.bars[axis][level].inverse, 0.5 * frames.light * (1.0 - v));
    }
  }
  const double inside = std::max(point.axis[0].inside * point.axis[1].inside, 0.05);
  for (size_t c = pixel.first_channel; c < pixel.last_channel; ++c) {
    const Sums& s = sums[c];
    const double determinant = s.n * s.hh - s.h * s.h;
    const double light = (s.n * s.ih - s.h * s.i) / determinant;
    point.weight[c] = std::max(light / inside, 0.0);
    point.foreground[c] = std::max((s.i - std::max(light, 0.0) * s.h) / s.n, 0.0);
  }
}

BackgroundPoint BackgroundMap::point(const EmptyPixel& pixel, const StraightView& straight) const {
  BackgroundPoint point;
  const Contrast contrast = contrast_of(pixel);
  point.foreground = pixel.black;
  if (!usable(pixel, contrast)) return point;
  point.seen = true;
  for (size_t axis = 0; axis < 2; ++axis) {
    const double scale = straight.scale[axis];
    if (decoders_[axis].wave_count() == 0) {
      // A camera pixel's box minus the monitor's own flat pixel.
      point.axis[axis].centre_px = straight.centre_px[axis];
      point.axis[axis].sigma_px = std::sqrt(std::max(scale * scale - 1.0, 0.0) / 12.0);
      point.axis[axis].centre_sd_px = 0.25 * (axis == 0 ? monitor_.width_px : monitor_.height_px);
      continue;
    }
    point.measured[axis] = true;
    const std::vector<BarDecoder::Sample> samples = waves(pixel, axis, contrast);
    const BarDecoder::Guess guess{.centre_px = straight.centre_px[axis], .sigma_px = box_sigma_px(scale)};
    point.axis[axis] = decoders_[axis].fit(samples, guess);
    point.ambiguous = point.ambiguous || point.axis[axis].ambiguous;
    point.chi_square += point.axis[axis].chi_square;
    point.degrees += static_cast<int>(samples.size());
  }
  weigh(pixel, contrast, point);
  return point;
}

BackgroundMap::Waves BackgroundMap::waves_of(const EmptyPixel& pixel) const {
  const Contrast contrast = contrast_of(pixel);
  return {waves(pixel, 0, contrast), waves(pixel, 1, contrast)};
}

BackgroundMap::Misses BackgroundMap::misses(const Waves& waves, const StagePoint& place) const {
  Misses all;
  for (size_t axis = 0; axis < 2; ++axis) {
    const double centre_px = axis == 0 ? place.x_px : place.y_px;
    const double sigma_px = BarDecoder::shown_sigma_px(axis == 0 ? place.xx_px2 : place.yy_px2);
    const std::vector<BarDecoder::Sample>& samples = waves[axis];
    for (size_t level = 0; level < samples.size(); ++level) {
      const BarDecoder::Value value = decoders_[axis].value(level, centre_px, sigma_px);
      all[axis].push_back({.value = samples[level].value - value.v,
                           .sd = samples[level].sd,
                           .by_centre = value.by_centre,
                           .by_log_sigma = value.by_log_sigma});
    }
  }
  return all;
}

BackgroundPoint BackgroundMap::point_on(const SmoothStage& map, const EmptyPixel& pixel, double x_px,
                                        double y_px) const {
  BackgroundPoint point;
  const Contrast contrast = contrast_of(pixel);
  point.foreground = pixel.black;
  if (!usable(pixel, contrast)) return point;
  point.seen = true;
  const StagePoint place = map.map.at(x_px, y_px);
  const Misses all = misses(pixel, place);
  const double place_sd_px = std::hypot(std::max(map.place_sd_px, kMinPlaceSd_px), map.sd_px);
  for (size_t axis = 0; axis < 2; ++axis) {
    AxisFit& fit = point.axis[axis];
    point.measured[axis] = true;
    const double variance_px2 = axis == 0 ? place.xx_px2 : place.yy_px2;
    fit.centre_px = axis == 0 ? place.x_px : place.y_px;
    // Without bars, a camera pixel's box minus the monitor's own flat pixel.
    fit.sigma_px = BarDecoder::shown_sigma_px(all[axis].empty() ? variance_px2 - 1.0 / 12.0 : variance_px2);
    fit.centre_sd_px = map.sd_px;
    fit.inside = decoders_[axis].inside(fit.centre_px, fit.sigma_px).v;
    for (size_t level = 0; level < all[axis].size(); ++level) {
      const Miss& miss = all[axis][level];
      double variance = miss.sd * miss.sd;
      for (const double error : {BarDecoder::kShapeSd, place_sd_px * miss.by_centre,
                                 kLogSigmaError * miss.by_log_sigma, map.wave_sd[axis][level]})
        variance += error * error;
      fit.chi_square += miss.value * miss.value / variance;
    }
    point.chi_square += fit.chi_square;
    point.degrees += static_cast<int>(all[axis].size());
  }
  weigh(pixel, contrast, point);
  return point;
}

BackgroundPoint BackgroundMap::point_near(const SmoothStage& map, const EmptyPixel& pixel, double x_px,
                                          double y_px) const {
  BackgroundPoint point = point_on(map, pixel, x_px, y_px);
  if (!point.seen) return point;
  constexpr double kMapInformation = 1.0 / (0.25 * 0.25);  // 1/px^2: of the map, where bars tell nothing
  const StagePoint on_map = map.map.at(x_px, y_px);
  StagePoint place = on_map;
  const Waves waves = waves_of(pixel);
  for (int round = 0; round < 2; ++round) {
    const Misses all = misses(waves, place);
    for (size_t axis = 0; axis < 2; ++axis) {
      double& centre_px = axis == 0 ? place.x_px : place.y_px;
      double information = kMapInformation;
      double pull = kMapInformation * ((axis == 0 ? on_map.x_px : on_map.y_px) - centre_px);
      for (size_t level = 0; level < all[axis].size(); ++level) {
        const Miss& miss = all[axis][level];
        const double usual = map.wave_sd[axis][level];
        const double variance =
            miss.sd * miss.sd + usual * usual + BarDecoder::kShapeSd * BarDecoder::kShapeSd;
        information += miss.by_centre * miss.by_centre / variance;
        pull += miss.by_centre * miss.value / variance;
      }
      centre_px += pull / information;
      point.axis[axis].centre_px = centre_px;
      point.axis[axis].centre_sd_px = 1.0 / std::sqrt(information);
    }
  }
  return point;
}

bool BackgroundMap::refutes(const BackgroundPoint& on_map) const {
  return on_map.degrees > 0 && on_map.chi_square > refuted_threshold_;
}

}  // namespace glasswing
