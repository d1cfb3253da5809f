#include "solver/frames/frame_report.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>

#include "core/base/median.h"
#include "core/base/status.h"
#include "core/pattern/stimulus_kind.h"
#include "solver/frames/beside_object.h"
#include "solver/frames/frame_fit.h"

namespace glasswing {
namespace {

constexpr size_t kMinBeside = 25;  // pixels
constexpr double kCertain = 6.0;   // standard deviations of a ghost or flare that is removed
constexpr double kMinGhost = 0.004, kMinFlare = 0.006, kMinRest = 0.0005;
constexpr double kMaxLeft = 0.5;  // of a picture that is left in the next one, or spread as flare
constexpr int kGhostRounds = 6;
constexpr double kMinOffset = 0.001;
constexpr double kFull = 0.6;     // of the bright samples; noise around full scale saturates half of them
constexpr float kBright = 0.97f;  // light that noise may lift to full scale
constexpr float kBlackLevel = 0.008f;
constexpr float kOverExposed = 1.02f;            // white, according to the grays,
constexpr std::ptrdiff_t kSomeOf = 10;           // at one of this many samples
constexpr double kCutOff = 0.2, kNoNoise = 0.7;  // shares of black samples at the lowest code
constexpr float kDark = 4.0f;                    // standard deviations
constexpr double kMinMeans = 0.15;               // difference of two pictures' means that reveals flare
constexpr size_t kMinFlares = 8;                 // pictures
constexpr double kFlareExplained = 4.0;          // ratio of what flare explains to what it does not

}  // namespace

std::vector<int> by_time(const v1::CaptureManifest& manifest) {
  std::vector<int> order(manifest.frames_size());
  std::iota(order.begin(), order.end(), 0);
  const bool timed = std::ranges::all_of(
      manifest.frames(), [](const v1::Frame& frame) { return frame.exposure_start_ns() > 0; });
  if (timed)
    std::ranges::stable_sort(order, {}, [&](int i) { return manifest.frames(i).exposure_start_ns(); });
  return order;
}

namespace {

// By the median of the slopes between distant points (Theil and Sen).
struct SteadyLine {
  double slope = 0.0, slope_sd = INFINITY;
  double range = 0.0;    // of x
  double scatter = 0.0;  // of y, a standard deviation
};

SteadyLine steady_line(const std::vector<double>& x, const std::vector<double>& y) {
  std::vector<double> slopes;
  for (size_t i = 0; i < x.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      if (std::abs(x[i] - x[j]) > kMinMeans) slopes.push_back((y[i] - y[j]) / (x[i] - x[j]));
    }
  }
  if (slopes.size() < kMinFlares * kMinFlares) return {};
  SteadyLine line{.slope = median(slopes)};
  std::vector<double> rests;
  for (size_t i = 0; i < x.size(); ++i) rests.push_back(y[i] - line.slope * x[i]);
  const double middle = median(rests),
               x_middle = std::accumulate(x.begin(), x.end(), 0.0) / static_cast<double>(x.size());
  double squares = 0.0;
  for (const double own : x) squares += (own - x_middle) * (own - x_middle);
  for (double& rest : rests) rest = std::abs(rest - middle);
  line.scatter = 1.4826 * median(rests);
  line.slope_sd = 1.2533 * line.scatter / std::sqrt(squares);
  line.range = std::ranges::max(x) - std::ranges::min(x);
  return line;
}

class Reporter {
 public:
  Reporter(const v1::CaptureManifest& manifest, const ComparedFrames& compared,
           const std::vector<bool>& beside, const Removed& removed)
      : manifest_(manifest), samples_(compared.samples), noise_sd_(compared.noise_sd), removed_(removed) {
    report_.frames.resize(manifest.frames_size());
    report_.order = by_time(manifest);
    report_.radius_px = std::hypot(samples_.middle_x_px, samples_.middle_y_px);
    const bool full = grays_say_full(beside);
    for (std::vector<float>& light : samples_.light) clipped_.push_back(count_as_full(beside, full, light));
    report_.before.resize(report_.frames.size());
    for (size_t i = 0; i < report_.order.size(); ++i) {
      for (size_t k = 1; k <= kGhosts; ++k)
        report_.before[report_.order[i]][k - 1] = k <= i ? report_.order[i - k] : -1;
    }
  }

  void see(const EmptyMonitor& monitor, const SmoothStage& stage, const std::vector<bool>& beside) {
    LitView view(samples_, beside, monitor, stage);
    if (view.pixels().size() < kMinBeside) return;
    report_.beside += view.pixels().size();
    seen_.emplace(
        monitor.texture,
        SeenMonitor{
            .monitor = monitor, .view = std::move(view), .black = {}, .contrast = {}, .cut_off_sd = 0.0});
  }

  FrameReport measure() {
    if (seen_.empty()) return report_;
    lay_out_fits();
    measure_all();
    if ((report_.has_ghosts = remove_ghosts())) measure_all();
    if ((report_.has_flare = remove_flare())) measure_all();
    measure_flat_again();
    judge_solids();
    return report_;
  }

 private:
  struct Fit {
    size_t frame;
    const SeenMonitor* seen;
    LitView::Picture picture;
  };

  void lay_out_fits() {
    for (size_t f = 0; f < report_.frames.size(); ++f) {
      const v1::Frame& frame = manifest_.frames(static_cast<int>(f));
      const auto seen = seen_.find(texture_of(manifest_, frame.stimulus().panel()));
      if (samples_.light[f].empty() || seen == seen_.end() || !is_pattern(frame)) continue;
      auto picture = LitView::Picture::of(frame.stimulus());
      if (picture) fits_.push_back({.frame = f, .seen = &seen->second, .picture = *std::move(picture)});
    }
  }

  void measure_all() {
    for (auto& [texture, seen] : seen_) measure_contrast(seen);
    for (const Fit& fit : fits_) {
      FrameFit own(samples_, *fit.seen, fit.picture, noise_sd_);
      const std::array<double, kChannels> mean = report_.frames[fit.frame].mean;
      report_.frames[fit.frame] = own.fit(samples_.light[fit.frame]);
      report_.frames[fit.frame].mean = mean;
      report_.frames[fit.frame].clipped = clipped_[fit.frame];
      if (clipped_[fit.frame] && !fit.picture.is_stripe()) report_.frames[fit.frame].measured = false;
    }
  }

  // Pictures without dark parts, with the offset of the frames beside them in time.
  void measure_flat_again() {
    std::map<size_t, const Fit*> fit_of;
    for (const Fit& fit : fits_) fit_of[fit.frame] = &fit;
    for (const Fit& fit : fits_) {
      if (report_.frames[fit.frame].dark || fit.picture.has_dark_parts()) continue;
      const std::array<double, kChannels> offset = offset_beside(fit.frame);
      if (std::ranges::all_of(offset, [](double own) { return std::abs(own) < kMinOffset; })) continue;
      const std::array<double, kChannels> mean = report_.frames[fit.frame].mean;
      FrameFit own(samples_, *fit.seen, fit.picture, noise_sd_);
      report_.frames[fit.frame] = own.fit(samples_.light[fit.frame], offset);
      report_.frames[fit.frame].mean = mean;
    }
  }

  // The light of solids of the empty stage that the camera cannot measure.
  void judge_solids() {
    for (const auto& [texture, seen] : seen_) {
      const int black = seen.monitor.black, white = seen.monitor.white;
      if (black >= 0) {
        std::vector<float> light = samples_.light[black];
        std::ranges::sort(light);
        const float low = light[light.size() / 100], high = light[light.size() * 99 / 100];
        if (low > kBlackLevel && high - low < 6.0f * static_cast<float>(noise_sd_) + 0.5f * low) {
          report_.black_warning = fmt::format(
              "the black of the empty stage is {:.1f} % of full scale everywhere: the camera's black level, "
              "which the archive does not state, or a light in the room; it counts as the object's own light "
              "F",
              100.0f * 0.5f * (low + high));
        }
      }
      const auto above = std::ranges::count_if(seen.contrast, [](float own) { return own > kOverExposed; });
      if (white >= 0 && is_clipped(white) && kSomeOf * above > std::ssize(seen.contrast)) {
        report_.white_warning = fmt::format(
            "white on monitor \"{}\" is over-exposed beside the object, where composites will be too dark: "
            "reduce the exposure",
            manifest_.monitors(texture).name());
      }
    }
  }

  std::array<double, kChannels> offset_beside(size_t frame) const {
    constexpr int kWanted = 2;  // each way
    const auto at = std::ranges::find(report_.order, static_cast<int>(frame));
    std::array<std::vector<double>, kChannels> offsets;
    for (const int way : {-1, 1}) {
      int found = 0;
      for (auto i = at;
           found < kWanted && (way > 0 ? std::next(i) != report_.order.end() : i != report_.order.begin());) {
        i += way;
        const FrameMeasure& measure = report_.frames[*i];
        if (manifest_.frames(*i).object() != manifest_.frames(static_cast<int>(frame)).object()) break;
        if (!measure.dark) continue;
        for (size_t c = 0; c < kChannels; ++c) offsets[c].push_back(measure.offset[c]);
        ++found;
      }
    }
    std::array<double, kChannels> beside{};
    for (size_t c = 0; c < kChannels; ++c) beside[c] = median(offsets[c]);
    return beside;
  }

  // Whether the brightest gray picture that is not saturated shows that white is at full scale and not above
  // it.
  bool grays_say_full(const std::vector<bool>& beside) const {
    double brightest = 0.0;
    bool full = false;
    for (size_t f = 0; f < samples_.light.size(); ++f) {
      const v1::Frame& frame = manifest_.frames(static_cast<int>(f));
      const double level = gray_of(frame.stimulus());
      if (kind_of(frame.stimulus()) != StimulusKind::kSolid || !is_pattern(frame) || !(level > brightest) ||
          !(level < 1.0) || samples_.light[f].empty())
        continue;
      std::ptrdiff_t count = 0, saturated = 0, above = 0;
      for (size_t lane = 0; lane < samples_.lane_count(); ++lane) {
        if (!beside[samples_.pixel_of(lane)]) continue;
        const float light = samples_.light[f][lane];
        ++count;
        saturated += std::isnan(light);
        above += light > kOverExposed * static_cast<float>(level);
      }
      if (kSomeOf * saturated > count) continue;
      brightest = level;
      full = kSomeOf * above <= count;
    }
    return full;
  }

  // Whether saturated samples exceed noise around full scale. Otherwise it counts as 1: without it the rest
  // would be too dark.
  bool count_as_full(const std::vector<bool>& beside, bool full, std::vector<float>& light) const {
    int saturated = 0, bright = 0;
    for (size_t lane = 0; lane < light.size(); ++lane) {
      if (!beside[samples_.pixel_of(lane)]) continue;
      saturated += std::isnan(light[lane]);
      bright += light[lane] > kBright;
    }
    const double count = saturated + bright;
    if (!full && saturated > kFull * count + 2.0 * std::sqrt(count)) return true;
    for (float& own : light) own = std::isnan(own) ? 1.0f : own;
    return false;
  }

  bool is_clipped(int frame) const { return clipped_[frame]; }

  // Saturated samples count as 1.
  std::array<double, kChannels> mean_of(const std::vector<float>& light) const {
    std::array<double, kChannels> sum{}, count{};
    for (size_t lane = 0; lane < light.size(); ++lane) {
      const size_t c = samples_.channel[lane];
      sum[c] += std::isnan(light[lane]) ? 1.0 : static_cast<double>(light[lane]);
      count[c] += 1.0;
    }
    for (size_t c = 0; c < kChannels; ++c) sum[c] /= std::max(count[c], 1.0);
    return sum;
  }

  // The sd of noise that the camera clipped below black; 0: it clipped nothing.
  double cut_off_sd(const SeenMonitor& seen) const {
    if (seen.monitor.black < 0) return 0.0;
    const std::vector<float>& light = samples_.light[seen.monitor.black];
    const size_t lanes = samples_.lanes_per_pixel;
    const float lowest = std::ranges::min(light);
    double count = 0.0, low = 0.0, squares = 0.0;
    for (const LitPixel& lit : seen.view.pixels()) {
      for (size_t lane = lit.pixel * lanes; lane < (lit.pixel + 1) * lanes; ++lane) {
        const double above = light[lane] - lowest;
        count += 1.0;
        low += above < 1e-5;
        squares += above * above;
      }
    }
    return low > kCutOff * count && low < kNoNoise * count ? std::sqrt(2.0 * squares / count) : 0.0;
  }

  // The gray solids of the empty stage, brightest first, with their levels.
  std::map<double, int, std::greater<>> grays_of(int texture) const {
    std::map<double, int, std::greater<>> grays;
    for (int f = 0; f < manifest_.frames_size(); ++f) {
      const v1::Frame& frame = manifest_.frames(f);
      if (frame.object() || kind_of(frame.stimulus()) != StimulusKind::kSolid || !is_pattern(frame)) continue;
      if (texture_of(manifest_, frame.stimulus().panel()) != texture || gray_of(frame.stimulus()) <= 0.0)
        continue;
      if (!samples_.light[f].empty()) grays.emplace(gray_of(frame.stimulus()), f);
    }
    return grays;
  }

  void measure_contrast(SeenMonitor& seen) const {
    const std::map<double, int, std::greater<>> grays = grays_of(seen.monitor.texture);
    const size_t lanes = samples_.lanes_per_pixel;
    const auto light = [&](int frame, size_t lane) { return samples_.light[frame][lane]; };
    // Noise that the camera clipped at 0 makes dark areas too bright.
    seen.cut_off_sd = cut_off_sd(seen);
    const float dark = kDark * static_cast<float>(seen.cut_off_sd);
    const auto unclipped = [&](float own) { return own < dark ? 0.0f : own; };
    seen.black.clear();
    seen.contrast.clear();
    for (const LitPixel& lit : seen.view.pixels()) {
      for (size_t lane = lit.pixel * lanes; lane < (lit.pixel + 1) * lanes; ++lane) {
        const float black = seen.monitor.black < 0 ? 0.0f : unclipped(light(seen.monitor.black, lane));
        float sum = 0.0f, count = 0.0f;
        for (const std::vector<BarFrames>& bars : seen.monitor.bars) {
          for (const BarFrames& known : bars) {
            if (known.inverse < 0 || is_clipped(known.frame) || is_clipped(known.inverse)) continue;
            const float both = unclipped(light(known.frame, lane)) + unclipped(light(known.inverse, lane));
            if (std::isnan(both)) continue;
            sum += (both - 2.0f * black) / static_cast<float>(known.light);
            count += 1.0f;
          }
        }
        for (const auto& [level, frame] : grays) {
          if (count > 0.0f || std::isnan(light(frame, lane))) continue;
          sum = (light(frame, lane) - black) / static_cast<float>(level);
          count = 1.0f;
        }
        seen.black.push_back(black);
        seen.contrast.push_back(sum / count);
      }
    }
  }

  // Shares of the last pictures, from pictures that differ from them by more than one step of a stripe, until
  // they settle: at first a ghost looks like an outlier of the frame's fit.
  bool remove_ghosts() {
    const std::vector<std::vector<float>> recorded = samples_.light;
    Ghosts share = Ghosts::Zero();
    for (int round = 0; round < kGhostRounds; ++round) {
      const Ghosts step = ghost_step(recorded, 1.0 - share.sum());
      share += step;
      const bool certain = report_.ghost[0].value >
                           std::max(removed_.again ? kMinRest : kMinGhost, kCertain * report_.ghost[0].sd);
      if ((round == 0 && !(certain && removed_.ghosts)) || !(share.cwiseAbs().maxCoeff() < kMaxLeft)) {
        samples_.light = recorded;
        for (auto& [texture, seen] : seen_) measure_contrast(seen);
        return false;
      }
      clear(recorded, share);
      if (step.cwiseAbs().maxCoeff() < 1e-4) break;
      for (auto& [texture, seen] : seen_) measure_contrast(seen);
    }
    for (size_t k = 0; k < kGhosts; ++k) report_.ghost[k].value = share[k];
    return true;
  }

  using Ghosts = Eigen::Matrix<double, kGhosts, 1>;

  // What is left of them in samples_, whose light is recorded light less ghosts over `left`; of that light.
  Ghosts ghost_step(const std::vector<std::vector<float>>& recorded, double left) {
    FrameFit::GhostEquations all;
    for (const Fit& fit : fits_) {
      std::vector<std::vector<float>> last;
      for (const int before : report_.before[fit.frame]) {
        if (before < 0 || recorded[before].empty()) continue;
        last.push_back(recorded[before]);
        for (float& light : last.back()) light /= static_cast<float>(left);
      }
      if (last.size() < kGhosts || fit.picture.is_stripe()) continue;
      FrameFit own(samples_, *fit.seen, fit.picture, noise_sd_);
      own.fit(samples_.light[fit.frame]);
      const std::vector<std::span<const float>> spans(last.begin(), last.end());
      const FrameFit::GhostEquations ghosts = own.ghosts(samples_.light[fit.frame], spans);
      all.normal += ghosts.normal;
      all.right += ghosts.right;
      all.chi_square += ghosts.chi_square;
      all.count += ghosts.count;
    }
    if (all.count == 0.0) return Ghosts::Zero();
    all.normal.diagonal().array() += 1.0;
    const Eigen::LDLT<Eigen::Matrix<double, kGhosts, kGhosts>> solver(all.normal);
    const Ghosts share = solver.solve(all.right);
    const auto inverse = solver.solve(Eigen::Matrix<double, kGhosts, kGhosts>::Identity()).eval();
    const double scale = std::max(1.0, std::sqrt(all.chi_square / all.count));
    for (size_t k = 0; k < kGhosts; ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      report_.ghost[k] = {.value = share[i], .sd = scale * std::sqrt(inverse(i, i))};
    }
    return share;
  }

  void clear(const std::vector<std::vector<float>>& recorded, const Ghosts& share) {
    const auto left = static_cast<float>(1.0 - share.sum());
    samples_.light = recorded;
    for (size_t f = 0; f < recorded.size(); ++f) {
      for (size_t k = 0; k < kGhosts; ++k) {
        const int before = report_.before[f][k];
        if (before < 0 || recorded[before].empty()) continue;
        const auto part = static_cast<float>(share[k]);
        for (size_t lane = 0; lane < recorded[f].size(); ++lane)
          samples_.light[f][lane] -= part * recorded[before][lane];
      }
      for (float& light : samples_.light[f]) light /= left;
    }
  }

  // The slope of offsets over means of pictures with dark parts: what they all have in common is not flare.
  bool remove_flare() {
    for (size_t f = 0; f < report_.frames.size(); ++f) report_.frames[f].mean = mean_of(samples_.light[f]);
    std::vector<double> means, offsets;
    for (const Fit& fit : fits_) {
      const FrameMeasure& measure = report_.frames[fit.frame];
      if (!measure.measured || !measure.dark) continue;
      means.push_back((measure.mean[0] + measure.mean[1] + measure.mean[2]) / kChannels);
      offsets.push_back((measure.offset[0] + measure.offset[1] + measure.offset[2]) / kChannels);
    }
    const SteadyLine line = steady_line(means, offsets);
    report_.flare = {.value = line.slope, .sd = line.slope_sd};
    const double share = line.slope;
    if (!removed_.flare ||
        !(share > std::max(removed_.again ? kMinRest : kMinFlare, kCertain * line.slope_sd)) ||
        share > kMaxLeft)
      return false;
    if (share * line.range < kFlareExplained * line.scatter) return false;
    for (size_t f = 0; f < samples_.light.size(); ++f) {
      std::vector<float>& light = samples_.light[f];
      const std::array<double, kChannels>& mean = report_.frames[f].mean;
      for (size_t lane = 0; lane < light.size(); ++lane) {
        const auto veil = static_cast<float>(share * mean[samples_.channel[lane]]);
        light[lane] = (light[lane] - veil) / static_cast<float>(1.0 - share);
      }
    }
    return true;
  }

  const v1::CaptureManifest& manifest_;
  SessionSamples samples_;
  const double noise_sd_;
  const Removed removed_;
  std::map<int, SeenMonitor> seen_;  // by texture
  std::vector<Fit> fits_;
  std::vector<bool> clipped_;  // by frame
  FrameReport report_;
};

}  // namespace

absl::StatusOr<ComparedFrames> compare_frames(const v1::CaptureManifest& manifest,
                                              const std::vector<int>& frames, const LightReader& read,
                                              bool sweeps) {
  ComparedFrames compared;
  GW_ASSIGN_OR_RETURN(const Exposures exposures, Exposures::of(manifest));
  compared.layout = lay_out_stage(manifest, exposures);
  const std::vector<int> areas = frames_of(compared.layout);
  std::vector<int> all = areas;
  all.insert(all.end(), frames.begin(), frames.end());
  std::ranges::sort(all);
  all.erase(std::unique(all.begin(), all.end()), all.end());
  FrameSampler sampler(manifest, std::move(all));
  // Both together from the top, so that each strip of a compressed frame is unpacked once.
  const LightReader with_samples = [&](int row,
                                       const std::vector<int>& wanted) -> absl::StatusOr<FrameStack> {
    GW_RETURN_IF_ERROR(sampler.read_to(row + 1, read));
    return read(row, wanted);
  };
  GW_ASSIGN_OR_RETURN(compared.maps, measure_stage_maps(manifest, sweeps ? frames : areas, with_samples));
  GW_RETURN_IF_ERROR(sampler.read_to(manifest.camera().height_px(), read));
  compared.samples = std::move(sampler).take();
  compared.noise_sd = std::sqrt(sample_noise(manifest.camera(), kUsualNoise).variance(0.25));
  compared.beside = beside_object(compared.samples, manifest, compared.layout, compared.noise_sd);
  return compared;
}

std::array<std::vector<bool>, 4> quarters_of(const SessionSamples& samples, const std::vector<bool>& beside) {
  std::vector<size_t> pixels;
  for (size_t p = 0; p < beside.size(); ++p) {
    if (beside[p]) pixels.push_back(p);
  }
  std::array<std::vector<bool>, 4> quarters;
  quarters.fill(std::vector<bool>(beside.size()));
  const auto by_place = [&](auto begin, auto end, int SessionSamples::Pixel::*axis) {
    std::sort(begin, end,
              [&](size_t a, size_t b) { return samples.pixels[a].*axis < samples.pixels[b].*axis; });
  };
  const auto half = static_cast<std::ptrdiff_t>(pixels.size() / 2), quarter = half / 2;
  const auto first = pixels.begin();
  by_place(first, pixels.end(), &SessionSamples::Pixel::x);
  by_place(first, first + half, &SessionSamples::Pixel::y);
  by_place(first + half, pixels.end(), &SessionSamples::Pixel::y);
  const std::array<std::ptrdiff_t, 5> bounds{0, quarter, half, half + quarter, std::ssize(pixels)};
  for (size_t q = 0; q < quarters.size(); ++q) {
    for (auto p = first + bounds[q]; p != first + bounds[q + 1]; ++p) quarters[q][*p] = true;
  }
  return quarters;
}

FrameReport report_frames(const v1::CaptureManifest& manifest, const ComparedFrames& compared,
                          const std::vector<bool>& beside, const Removed& removed) {
  Reporter reporter(manifest, compared, beside, removed);
  for (const EmptyMonitor& monitor : compared.layout.monitors) {
    const auto& stage = compared.maps.of_monitor[monitor.texture];
    if (stage) reporter.see(monitor, *stage, beside);
  }
  return reporter.measure();
}

}  // namespace glasswing
