#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/gaussian/joint_batch_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "solver/gaussian/joint_batch.h"
#include "solver/gaussian/line_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

constexpr int kChunk = 16;      // samples
constexpr double kReach = 5.0;  // of the samples around a start, in sigma_r
constexpr float kFar = 36.0f;   // z^2
constexpr int kIterations = 16, kPatience = 5;
constexpr int kMaxNormal = kMaxParameters * (kMaxParameters + 1) / 2;
constexpr float kFinestStep = 1.0f / 65535.0f;  // of the frames; a fit that moves by less has converged

// The samples of one sweep around the starts, by lane and mode: those near mode m that no earlier mode has.
// Padded with weight 0 to the longest lane.
struct Gathered {
  int first[kMaxFootprints + 1];                        // of each mode's samples
  bool reaches[kMaxFootprints][kMaxFootprints];         // [m][n]: n's light reaches samples near m
  std::vector<float> y, root_weight;                    // [sample][lane]; y times the weight's root
  std::vector<float> offset_px;                         // [sample][lane], from that of mode 0's start
  HWY_ALIGN float start_px[kMaxFootprints][kMaxLanes];  // c.s of each start, from that of mode 0's
};

// A point of the search and its sums over the samples.
struct Point {
  HWY_ALIGN float p[kMaxParameters][kMaxLanes];  // of each mode R, x and y from its start, l11, l21, l22
  HWY_ALIGN float gradient[kMaxParameters][kMaxLanes];
  HWY_ALIGN float normal[kMaxNormal][kMaxLanes];  // lower triangle, packed by rows
  HWY_ALIGN Row chi2, neighbours;
};

// One mode in one sweep.
struct InSweep {
  V amplitude, centre, inverse_sigma;
  V chain[6];  // of dy/dp_i over its column's sum
};
constexpr int kColumnOf[6] = {0, 1, 1, 2, 2, 2};

struct BatchSpace {
  std::vector<Gathered> sweeps;
  HWY_ALIGN Row sample_count;  // of all sweeps, with any weight
  Point best, trial;
  HWY_ALIGN float column[kMaxFootprints][3][kChunk * kMaxLanes];
  HWY_ALIGN float residual[kChunk * kMaxLanes];
  HWY_ALIGN float gram[kMaxFootprints][kMaxFootprints][9][kMaxLanes];
  HWY_ALIGN float gain[kMaxFootprints][3][kMaxLanes];
  HWY_ALIGN float factor[kMaxNormal][kMaxLanes];
  HWY_ALIGN float step[kMaxParameters][kMaxLanes];
};

struct Window {
  int first = 0, last = 0;
};

void GatherSweep(const SampleLayout::Sweep& sweep, const float* offset_px, size_t s, std::ptrdiff_t stride,
                 std::span<const BatchPixel> pixels, Gathered& gathered, Row& sample_count) {
  const auto lanes = static_cast<int>(hn::Lanes(D()));
  const auto count = static_cast<int>(pixels.size()), modes = pixels.front().start.size();
  const float* const end = offset_px + sweep.count;
  Window windows[kMaxLanes][kMaxFootprints];
  int most[kMaxFootprints] = {};
  for (auto& row : gathered.reaches) std::fill(std::begin(row), std::end(row), false);
  for (int lane = 0; lane < lanes; ++lane) {
    // Lanes without a pixel repeat the last one.
    const Footprints& start = pixels[static_cast<size_t>(std::min(lane, count - 1))].start;
    double centre[kMaxFootprints], reach[kMaxFootprints];
    for (int m = 0; m < modes; ++m) {
      centre[m] = start[m].x_px * sweep.axis.cos_phi + start[m].y_px * sweep.axis.sin_phi - sweep.first_r_px;
      reach[m] = kReach * std::sqrt(answered_variance(start[m], sweep.axis));
      const float* const from = std::lower_bound(offset_px, end, static_cast<float>(centre[m] - reach[m]));
      const float* const to = std::upper_bound(from, end, static_cast<float>(centre[m] + reach[m]));
      windows[lane][m] = {static_cast<int>(from - offset_px), static_cast<int>(to - offset_px)};
      most[m] = std::max(most[m], static_cast<int>(to - from));
      gathered.start_px[m][lane] = static_cast<float>(centre[m] - centre[0]);
      for (int n = 0; n <= m; ++n) {
        const bool near = std::abs(centre[m] - centre[n]) < reach[m] + reach[n];
        gathered.reaches[m][n] = gathered.reaches[n][m] = gathered.reaches[m][n] || near;
      }
    }
  }
  gathered.first[0] = 0;
  for (int m = 0; m < modes; ++m) gathered.first[m + 1] = gathered.first[m] + most[m];
  const auto size = static_cast<size_t>(gathered.first[modes] * lanes);
  gathered.y.assign(size, 0.0f);
  gathered.root_weight.assign(size, 0.0f);
  gathered.offset_px.assign(size, 0.0f);
  for (int lane = 0; lane < lanes; ++lane) {
    const BatchPixel& pixel = pixels[static_cast<size_t>(std::min(lane, count - 1))];
    const double origin = pixel.start[0].x_px * sweep.axis.cos_phi +
                          pixel.start[0].y_px * sweep.axis.sin_phi - sweep.first_r_px;
    const Window* own = windows[lane];
    for (int m = 0; m < modes; ++m) {
      int at = gathered.first[m] * lanes + lane;
      for (int i = own[m].first; i < own[m].last; ++i) {
        bool had = false;
        for (int n = 0; n < m; ++n) had = had || (i >= own[n].first && i < own[n].last);
        if (had) continue;
        const auto place = static_cast<size_t>(at);
        const float weight = pixel.weight[s] != nullptr ? pixel.weight[s][i * stride] : 1.0f;
        gathered.y[place] = pixel.y[s][i * stride];
        gathered.root_weight[place] = weight;
        gathered.offset_px[place] = static_cast<float>(static_cast<double>(offset_px[i]) - origin);
        at += lanes;
        if (weight > 0.0f) sample_count[lane] += 1.0f;
      }
    }
  }
  const D d;
  if (pixels.front().weight[s] == nullptr) return;
  for (size_t i = 0; i < size; i += static_cast<size_t>(lanes)) {
    const V root = hn::Sqrt(hn::LoadU(d, gathered.root_weight.data() + i));
    hn::StoreU(root, d, gathered.root_weight.data() + i);
    hn::StoreU(hn::Mul(root, hn::LoadU(d, gathered.y.data() + i)), d, gathered.y.data() + i);
  }
}

InSweep Place(const Row* p, const StripeAxis& axis, const Row& start_px) {
  const D d;
  const auto c = static_cast<float>(axis.cos_phi), s = static_cast<float>(axis.sin_phi),
             sigma_s = static_cast<float>(axis.sigma_px);
  const V weight = hn::Load(d, p[0]);
  const V a = hn::MulAdd(Set(c), hn::Load(d, p[3]), hn::Mul(Set(s), hn::Load(d, p[4])));
  const V b = hn::Mul(Set(s), hn::Load(d, p[5]));
  const V variance =
      hn::MulAdd(a, a, hn::MulAdd(b, b, Set(sigma_s * sigma_s + static_cast<float>(kFlatPixel_px2))));
  const V sigma = hn::Sqrt(variance);
  InSweep mode;
  mode.inverse_sigma = hn::Div(Set(1.0f), sigma);
  const V peak = hn::Mul(Set(sigma_s), mode.inverse_sigma);
  mode.amplitude = hn::Mul(weight, peak);
  mode.centre =
      hn::MulAdd(Set(c), hn::Load(d, p[1]), hn::MulAdd(Set(s), hn::Load(d, p[2]), hn::Load(d, start_px)));
  const V by_centre = hn::Mul(mode.amplitude, mode.inverse_sigma);
  const V by_variance =  // times dV/d(a^2 + b^2), 2
      hn::Mul(mode.amplitude, hn::Mul(mode.inverse_sigma, mode.inverse_sigma));
  const V by_a = hn::Mul(by_variance, a);
  mode.chain[0] = peak;
  mode.chain[1] = hn::Mul(by_centre, Set(c)), mode.chain[2] = hn::Mul(by_centre, Set(s));
  mode.chain[3] = hn::Mul(by_a, Set(c)), mode.chain[4] = hn::Mul(by_a, Set(s));
  mode.chain[5] = hn::Mul(hn::Mul(by_variance, b), Set(s));
  return mode;
}

// u = exp(-z^2 / 2) times the root of the weight. Beyond kFar it is set to 0: denormal numbers are slow.
HWY_INLINE V Peak(V zz, V root) {
  const D d;
  const hn::RebindToSigned<D> di;
  // 2^x = 2^n 2^f with |f| <= 1/2, 2^f by its Taylor series in f ln 2; relative error 2e-7.
  const V x = hn::Mul(zz, Set(-0.72134752f)), whole = hn::Round(x), f = hn::Sub(x, whole);
  V power = hn::MulAdd(Set(1.5403530e-4f), f, Set(1.3333558e-3f));
  power = hn::MulAdd(power, f, Set(9.6181291e-3f));
  power = hn::MulAdd(power, f, Set(5.5504109e-2f));
  power = hn::MulAdd(power, f, Set(2.4022651e-1f));
  power = hn::MulAdd(power, f, Set(6.9314718e-1f));
  power = hn::MulAdd(power, f, Set(1.0f));
  const auto exponent = hn::ShiftLeft<23>(hn::ConvertTo(di, whole));
  const V u = hn::BitCast(d, hn::Add(hn::BitCast(di, power), exponent));
  return hn::IfThenElseZero(hn::Lt(zz, Set(kFar)), hn::Mul(root, u));
}

// Adds samples that only one mode reaches.
void AddSingle(const Gathered& gathered, int first, int last, const InSweep& mode, float (*gain)[kMaxLanes],
               float (*gram)[kMaxLanes], V& chi2, V& neighbours) {
  const D d;
  const auto lanes = static_cast<int>(hn::Lanes(d));
  V before = hn::Zero(d);
  V g0 = hn::Load(d, gain[0]), g1 = hn::Load(d, gain[1]), g2 = hn::Load(d, gain[2]);
  V h00 = hn::Load(d, gram[0]), h01 = hn::Load(d, gram[1]), h02 = hn::Load(d, gram[2]),
    h11 = hn::Load(d, gram[4]), h12 = hn::Load(d, gram[5]), h22 = hn::Load(d, gram[8]);
  for (int i = first * lanes; i < last * lanes; i += lanes) {
    const V z = hn::Mul(hn::Sub(hn::LoadU(d, gathered.offset_px.data() + i), mode.centre),
                        mode.inverse_sigma),
            zz = hn::Mul(z, z);
    const V u = Peak(zz, hn::LoadU(d, gathered.root_weight.data() + i));
    const V zu = hn::Mul(z, u), zzu = hn::MulSub(zz, u, u);
    const V r = hn::NegMulAdd(mode.amplitude, u, hn::LoadU(d, gathered.y.data() + i));
    chi2 = hn::MulAdd(r, r, chi2);
    neighbours = hn::MulAdd(r, before, neighbours);
    before = r;
    g0 = hn::MulAdd(u, r, g0), g1 = hn::MulAdd(zu, r, g1), g2 = hn::MulAdd(zzu, r, g2);
    h00 = hn::MulAdd(u, u, h00), h01 = hn::MulAdd(u, zu, h01), h02 = hn::MulAdd(u, zzu, h02);
    h11 = hn::MulAdd(zu, zu, h11), h12 = hn::MulAdd(zu, zzu, h12), h22 = hn::MulAdd(zzu, zzu, h22);
  }
  hn::Store(g0, d, gain[0]), hn::Store(g1, d, gain[1]), hn::Store(g2, d, gain[2]);
  hn::Store(h00, d, gram[0]), hn::Store(h01, d, gram[1]), hn::Store(h02, d, gram[2]);
  hn::Store(h01, d, gram[3]), hn::Store(h11, d, gram[4]), hn::Store(h12, d, gram[5]);
  hn::Store(h02, d, gram[6]), hn::Store(h12, d, gram[7]), hn::Store(h22, d, gram[8]);
}

// Adds a chunk of samples that several modes reach.
void AddChunk(const Gathered& gathered, int first, int count, const InSweep* modes, const int* reaching,
              int reaching_count, BatchSpace& space, V& chi2, V& neighbours) {
  const D d;
  const auto lanes = static_cast<int>(hn::Lanes(d));
  V before = hn::Zero(d);
  for (int i = 0; i < count; ++i) {
    const int sample = (first + i) * lanes;
    const V root = hn::LoadU(d, gathered.root_weight.data() + sample);
    const V at = hn::LoadU(d, gathered.offset_px.data() + sample);
    V residual = hn::LoadU(d, gathered.y.data() + sample);
    for (int j = 0; j < reaching_count; ++j) {
      const int m = reaching[j];
      const V z = hn::Mul(hn::Sub(at, modes[m].centre), modes[m].inverse_sigma), zz = hn::Mul(z, z);
      const V u = Peak(zz, root);
      residual = hn::NegMulAdd(modes[m].amplitude, u, residual);
      hn::Store(u, d, space.column[m][0] + i * lanes);
      hn::Store(hn::Mul(z, u), d, space.column[m][1] + i * lanes);
      hn::Store(hn::MulSub(zz, u, u), d, space.column[m][2] + i * lanes);
    }
    hn::Store(residual, d, space.residual + i * lanes);
    chi2 = hn::MulAdd(residual, residual, chi2);
    neighbours = hn::MulAdd(residual, before, neighbours);
    before = residual;
  }
  for (int j = 0; j < reaching_count; ++j) {
    const int m = reaching[j];
    const float *u = space.column[m][0], *zu = space.column[m][1], *zzu = space.column[m][2];
    V g0 = hn::Load(d, space.gain[m][0]), g1 = hn::Load(d, space.gain[m][1]),
      g2 = hn::Load(d, space.gain[m][2]);
    for (int i = 0; i < count * lanes; i += lanes) {
      const V r = hn::Load(d, space.residual + i);
      g0 = hn::MulAdd(hn::Load(d, u + i), r, g0);
      g1 = hn::MulAdd(hn::Load(d, zu + i), r, g1);
      g2 = hn::MulAdd(hn::Load(d, zzu + i), r, g2);
    }
    hn::Store(g0, d, space.gain[m][0]), hn::Store(g1, d, space.gain[m][1]);
    hn::Store(g2, d, space.gain[m][2]);
    for (int k = 0; k <= j; ++k) {
      const int n = reaching[k];
      const float *v = space.column[n][0], *zv = space.column[n][1], *zzv = space.column[n][2];
      auto& gram = space.gram[m][n];
      V h[9];
      for (int q = 0; q < 9; ++q) h[q] = hn::Load(d, gram[q]);
      for (int i = 0; i < count * lanes; i += lanes) {
        const V a = hn::Load(d, u + i), b = hn::Load(d, zu + i), c = hn::Load(d, zzu + i);
        const V e = hn::Load(d, v + i), f = hn::Load(d, zv + i), g = hn::Load(d, zzv + i);
        h[0] = hn::MulAdd(a, e, h[0]), h[1] = hn::MulAdd(a, f, h[1]), h[2] = hn::MulAdd(a, g, h[2]);
        h[3] = hn::MulAdd(b, e, h[3]), h[4] = hn::MulAdd(b, f, h[4]), h[5] = hn::MulAdd(b, g, h[5]);
        h[6] = hn::MulAdd(c, e, h[6]), h[7] = hn::MulAdd(c, f, h[7]), h[8] = hn::MulAdd(c, g, h[8]);
      }
      for (int q = 0; q < 9; ++q) hn::Store(h[q], d, gram[q]);
    }
  }
}

HWY_INLINE void AddTo(Row& to, V value) {
  const D d;
  hn::Store(hn::Add(hn::Load(d, to), value), d, to);
}

void EvaluatePoint(const SampleLayout& layout, int mode_count, BatchSpace& space, Point& point) {
  const D d;
  const V zero = hn::Zero(d);
  const int parameters = 6 * mode_count;
  for (int i = 0; i < parameters; ++i) hn::Store(zero, d, point.gradient[i]);
  for (int i = 0; i < Packed(parameters, 0); ++i) hn::Store(zero, d, point.normal[i]);
  V chi2 = zero, neighbours = zero;
  for (size_t s = 0; s < layout.sweeps.size(); ++s) {
    const Gathered& gathered = space.sweeps[s];
    InSweep modes[kMaxFootprints];
    for (int m = 0; m < mode_count; ++m) {
      modes[m] = Place(point.p + 6 * m, layout.sweeps[s].axis, gathered.start_px[m]);
      for (int q = 0; q < 3; ++q) hn::Store(zero, d, space.gain[m][q]);
      for (int n = 0; n <= m; ++n)
        for (int q = 0; q < 9; ++q) hn::Store(zero, d, space.gram[m][n][q]);
    }
    for (int near = 0; near < mode_count; ++near) {
      int reaching[kMaxFootprints], reaching_count = 0;
      for (int m = 0; m < mode_count; ++m) {
        if (gathered.reaches[near][m]) reaching[reaching_count++] = m;
      }
      const int begin = gathered.first[near], end = gathered.first[near + 1];
      if (reaching_count == 1) {
        AddSingle(gathered, begin, end, modes[near], space.gain[near], space.gram[near][near], chi2,
                  neighbours);
        continue;
      }
      for (int first = begin; first < end; first += kChunk)
        AddChunk(gathered, first, std::min(kChunk, end - first), modes, reaching, reaching_count, space, chi2,
                 neighbours);
    }
    for (int m = 0; m < mode_count; ++m) {
      for (int i = 0; i < 6; ++i) {
        const V by_i = modes[m].chain[i];
        AddTo(point.gradient[6 * m + i], hn::Mul(by_i, hn::Load(d, space.gain[m][kColumnOf[i]])));
        for (int n = 0; n <= m; ++n) {
          for (int j = 0; j < (n == m ? i + 1 : 6); ++j) {
            const V sum = hn::Load(d, space.gram[m][n][3 * kColumnOf[i] + kColumnOf[j]]);
            AddTo(point.normal[Packed(6 * m + i, 6 * n + j)], hn::Mul(hn::Mul(by_i, modes[n].chain[j]), sum));
          }
        }
      }
    }
  }
  hn::Store(chi2, d, point.chi2), hn::Store(neighbours, d, point.neighbours);
}

// Factorises a point's normal matrix with its diagonal scaled by 1 + `damping`.
void FactorNormal(const Point& point, V damping, int mode_count, BatchSpace& space) {
  const D d;
  const int parameters = 6 * mode_count;
  for (int i = 0; i < Packed(parameters, 0); ++i) hn::Store(hn::Load(d, point.normal[i]), d, space.factor[i]);
  for (int m = 0; m < mode_count; ++m) {
    const auto diagonal = [&](int i) -> float* { return space.factor[Packed(6 * m + i, 6 * m + i)]; };
    // Near Sigma's boundary the derivative by an l vanishes: l counts as at least a twelfth of sigma_r, at
    // which its diagonal is a hundredth of the centre's.
    const V least = hn::Mul(Set(0.005f), hn::Add(hn::Load(d, diagonal(1)), hn::Load(d, diagonal(2))));
    for (int i = 3; i < 6; ++i) hn::Store(hn::Max(hn::Load(d, diagonal(i)), least), d, diagonal(i));
    for (int i = 0; i < 6; ++i) {
      const V value = hn::Load(d, diagonal(i));
      hn::Store(hn::MulAdd(damping, value, value), d, diagonal(i));
    }
  }
  FactorLower(space.factor, parameters);
}

void SetStarts(std::span<const BatchPixel> pixels, double narrowest_px, Point& point) {
  for (size_t lane = 0; lane < hn::Lanes(D()); ++lane) {
    const Footprints& start = pixels[std::min(lane, pixels.size() - 1)].start;
    for (int m = 0; m < start.size(); ++m) {
      // At least an eighth of a stripe: from zero an l could not grow.
      const Footprint mode = with_positive_covariance(start[m], narrowest_px * narrowest_px / 64.0);
      const double l11 = std::sqrt(mode.xx_px2), l21 = mode.xy_px2 / l11;
      const double l22 = std::sqrt(std::max(mode.yy_px2 - l21 * l21, 1e-12));
      const double own[6] = {mode.weight, 0.0, 0.0, l11, l21, l22};
      for (int i = 0; i < 6; ++i) point.p[6 * m + i][lane] = static_cast<float>(own[i]);
    }
  }
}

// Levenberg-Marquardt, each lane with its own damping. Returns the lanes that converged.
void Minimise(const SampleLayout& layout, int mode_count, float narrowest_px, BatchSpace& space,
              Row& settled_lanes) {
  const D d;
  const int parameters = 6 * mode_count;
  Point &best = space.best, &trial = space.trial;
  EvaluatePoint(layout, mode_count, space, best);
  const V samples = hn::Max(hn::Load(d, space.sample_count), Set(1.0f));
  V damping = Set(1e-3f);
  auto settled = hn::Lt(damping, hn::Zero(d));
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    FactorNormal(best, damping, mode_count, space);
    for (int i = 0; i < parameters; ++i) hn::Store(hn::Load(d, best.gradient[i]), d, space.step[i]);
    SolveLower(space.factor, parameters, space.step);
    // The predicted reduction relative to the noise of one sample, as in fit_jointly.
    V promise = hn::Zero(d);
    for (int i = 0; i < parameters; ++i) {
      const V step = hn::Load(d, space.step[i]), now = hn::Load(d, best.p[i]);
      const V most = i % 6 == 0 ? hn::Mul(Set(0.5f), now) : Set(0.5f * narrowest_px);
      promise = hn::MulAdd(hn::Load(d, best.gradient[i]), step, promise);
      hn::Store(hn::Add(now, hn::Max(hn::Min(step, most), hn::Neg(most))), d, trial.p[i]);
    }
    const V chi2 = hn::Load(d, best.chi2);
    const V little = hn::Max(hn::Div(hn::Mul(Set(0.01f), chi2), samples),
                             hn::Mul(samples, Set(kFinestStep * kFinestStep)));
    const auto bold = hn::Lt(damping, Set(0.1f)), last = hn::And(bold, hn::Le(promise, little));
    if (hn::AllTrue(d, hn::Or(settled, last))) {
      // Steps this small are accepted unchecked.
      for (int i = 0; i < parameters; ++i)
        hn::Store(hn::IfThenElse(last, hn::Load(d, trial.p[i]), hn::Load(d, best.p[i])), d, best.p[i]);
      settled = hn::Or(settled, last);
      break;
    }
    EvaluatePoint(layout, mode_count, space, trial);
    const V gained = hn::Sub(chi2, hn::Load(d, trial.chi2));
    const auto better = hn::Ge(gained, hn::Mul(Set(-1e-6f), chi2));
    const auto idle = hn::And(better, hn::Lt(gained, hn::Mul(Set(3e-4f), chi2)));
    settled = hn::Or(settled, hn::Or(last, hn::And(bold, idle)));
    // Damping follows the accuracy of the quadratic model.
    const V scale =
        hn::IfThenElse(hn::Gt(gained, hn::Mul(Set(0.9f), promise)), Set(0.1f),
                       hn::IfThenElse(hn::Lt(gained, hn::Mul(Set(0.2f), promise)), Set(3.0f), Set(0.5f)));
    damping = hn::Max(hn::Mul(damping, hn::IfThenElse(better, scale, Set(4.0f))), Set(1e-6f));
    const auto take = [&](Row& to, const Row& from) {
      hn::Store(hn::IfThenElse(better, hn::Load(d, from), hn::Load(d, to)), d, to);
    };
    for (int i = 0; i < parameters; ++i) {
      take(best.p[i], trial.p[i]);
      take(best.gradient[i], trial.gradient[i]);
    }
    for (int i = 0; i < Packed(parameters, 0); ++i) take(best.normal[i], trial.normal[i]);
    take(best.chi2, trial.chi2), take(best.neighbours, trial.neighbours);
    // Stop before the last few lanes converge: all would have to iterate with them.
    const size_t left = hn::CountTrue(d, hn::Not(settled));
    if (left == 0 || (iteration >= kPatience && 4 * left <= hn::Lanes(d))) break;
  }
  hn::Store(hn::IfThenElseZero(settled, Set(1.0f)), d, settled_lanes);
}

// The variance of parameter i for noise of standard deviation 1: the square of L^-1 e_i.
V VarianceOf(int i, int parameters, BatchSpace& space) {
  const D d;
  V sum = hn::Zero(d);
  for (int j = i; j < parameters; ++j) {
    V value = j == i ? Set(1.0f) : hn::Zero(d);
    for (int k = i; k < j; ++k)
      value = hn::NegMulAdd(hn::Load(d, space.factor[Packed(j, k)]), hn::Load(d, space.step[k]), value);
    value = hn::Mul(value, hn::Load(d, space.factor[Packed(j, j)]));
    hn::Store(value, d, space.step[j]);
    sum = hn::MulAdd(value, value, sum);
  }
  return sum;
}

void FitLanes(const SampleLayout& layout, std::ptrdiff_t stride, std::span<const BatchPixel> pixels,
              std::span<JointFit> fits, BatchSpace& space) {
  const int mode_count = pixels.front().start.size(), parameters = 6 * mode_count;
  space.sweeps.resize(std::max(space.sweeps.size(), layout.sweeps.size()));
  hn::Store(hn::Zero(D()), D(), space.sample_count);
  double narrowest_px = 1e30;
  for (size_t s = 0; s < layout.sweeps.size(); ++s) {
    const SampleLayout::Sweep& sweep = layout.sweeps[s];
    GatherSweep(sweep, layout.offset_px.data() + sweep.first, s, stride, pixels, space.sweeps[s],
                space.sample_count);
    narrowest_px = std::min(narrowest_px, sweep.axis.sigma_px);
  }
  SetStarts(pixels, narrowest_px, space.best);
  HWY_ALIGN Row settled;
  Minimise(layout, mode_count, static_cast<float>(narrowest_px), space, settled);

  HWY_ALIGN float weight_variance[kMaxFootprints][kMaxLanes], centre_variance[kMaxFootprints][kMaxLanes];
  FactorNormal(space.best, Set(0.0f), mode_count, space);
  for (int m = 0; m < mode_count; ++m) {
    hn::Store(VarianceOf(6 * m, parameters, space), D(), weight_variance[m]);
    hn::Store(hn::Mul(Set(0.5f), hn::Add(VarianceOf(6 * m + 1, parameters, space),
                                         VarianceOf(6 * m + 2, parameters, space))),
              D(), centre_variance[m]);
  }
  for (size_t lane = 0; lane < pixels.size(); ++lane) {
    JointFit& fit = fits[lane];
    fit = {};
    fit.chi2 = fit.near_chi2 = static_cast<double>(space.best.chi2[lane]);
    fit.near_neighbours = static_cast<double>(space.best.neighbours[lane]);
    fit.near_count = static_cast<int>(space.sample_count[lane]);
    fit.converged = settled[lane] > 0.0f && std::isfinite(fit.chi2);
    const double variance = fit.near_chi2 / std::max(fit.near_count - parameters, 1);
    for (int m = 0; m < mode_count; ++m) {
      const auto p = [&](int i) { return static_cast<double>(space.best.p[6 * m + i][lane]); };
      const Footprint& start = pixels[lane].start[m];
      fit.modes.push_back({.weight = p(0),
                           .x_px = start.x_px + p(1),
                           .y_px = start.y_px + p(2),
                           .xx_px2 = p(3) * p(3),
                           .xy_px2 = p(3) * p(4),
                           .yy_px2 = p(4) * p(4) + p(5) * p(5)});
      const auto at = static_cast<size_t>(m);
      fit.weight_sd[at] = std::sqrt(variance * static_cast<double>(weight_variance[m][lane]));
      fit.centre_sd_px[at] = std::sqrt(variance * static_cast<double>(centre_variance[m][lane]));
      fit.light_sd = std::hypot(fit.light_sd, fit.weight_sd[at]);  // modes apart from each other
    }
  }
}

void FitBatch(const SampleLayout& layout, std::ptrdiff_t stride, std::span<const BatchPixel> pixels,
              std::span<JointFit> fits) {
  const auto space = std::make_unique_for_overwrite<BatchSpace>();
  const size_t lanes = hn::Lanes(D());
  for (size_t first = 0; first < pixels.size(); first += lanes) {
    const size_t count = std::min(lanes, pixels.size() - first);
    FitLanes(layout, stride, pixels.subspan(first, count), fits.subspan(first, count), *space);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing {

HWY_EXPORT(FitBatch);

void fit_batch(const SampleLayout& layout, std::ptrdiff_t stride, std::span<const BatchPixel> pixels,
               std::span<JointFit> fits) {
  if (!pixels.empty()) HWY_DYNAMIC_DISPATCH(FitBatch)(layout, stride, pixels, fits);
}

}  // namespace glasswing
#endif
