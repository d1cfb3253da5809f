#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/gaussian/kernels/joint_batch_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "solver/gaussian/kernels/batch_answers-inl.h"
#include "solver/gaussian/kernels/joint_batch.h"
#include "solver/gaussian/kernels/line_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

constexpr int kChunk = 16;      // samples
constexpr double kReach = 5.0;  // of the samples around a start, in sigma_r
constexpr float kFar = 36.0f;   // z^2
constexpr int kIterations = 24,
              kPatience = 8;                  // one pixel alone costs as much as ten iterations of all lanes
constexpr int kMaxFree = kMaxParameters + 1;  // the modes' and F, which comes last
constexpr int kMaxNormal = kMaxFree * (kMaxFree + 1) / 2;
constexpr float kFinestStep = static_cast<float>(kMinStep);  // a fit that moves by less has converged
constexpr float kMaxFloorWeight = 1e12f;

// The samples of one sweep around the starts, by lane and mode: those near mode m that no earlier mode has.
// Padded with weight 0 to the longest lane.
struct Gathered {
  int first[kMaxFootprints + 1];                        // of each mode's samples
  bool reaches[kMaxFootprints][kMaxFootprints];         // [m][n]: n's light reaches samples near m
  std::vector<float> y, root_weight;                    // [sample][lane]; y times the weight's root
  std::vector<float> floor;                             // u times the weight's root
  std::vector<float> offset_px;                         // [sample][lane], from that of mode 0's start
  HWY_ALIGN float start_px[kMaxFootprints][kMaxLanes];  // c.s of each start, from that of mode 0's
};

// White or bars, per light of 1.
struct AreaLanes {
  const LitArea* lit = nullptr;
  float light = 1.0f;
  HWY_ALIGN Row y, seen, variance, weight;  // y: seen, or what is expected of it where it was cut off
  HWY_ALIGN float place[kMaxFootprints][kMaxLanes];  // of each start, in bars from where a lit one begins
};

// A point of the search and its sums over the samples.
struct Point {
  HWY_ALIGN float p[kMaxFree][kMaxLanes];  // of each mode R, x and y from its start, l11, l21, l22; then F
  HWY_ALIGN float gradient[kMaxFree][kMaxLanes];
  HWY_ALIGN float normal[kMaxNormal][kMaxLanes];         // lower triangle, packed by rows
  HWY_ALIGN float sharpness[kMaxFootprints][kMaxLanes];  // of the place that stripes see: its mean diagonal
  HWY_ALIGN Row chi2, near, neighbours;  // chi2 without what F cannot change; near: of gathered samples
};

// One mode in one sweep.
struct InSweep {
  V amplitude, centre, inverse_sigma;
  V chain[6];  // of dy by R and by c and Sigma as stripes see them, over their column's sum
};
constexpr int kColumnOf[6] = {0, 1, 1, 2, 2, 2};

// A mode as flat pixels let stripes see it.
struct SeenMode {
  SeenLane x, y;
  V turn;  // of xy
  V xx, xy, yy, l11, l21, l22;
};

struct BatchSpace {
  std::vector<Gathered> sweeps;
  std::vector<AreaLanes> areas;
  HWY_ALIGN Row sample_count;  // of all sweeps, with any weight
  HWY_ALIGN Row noise;         // variance of a sample of weight 1
  HWY_ALIGN Row floor_weight, black, all_floor_squares;
  HWY_ALIGN Row floor_squares, floor_products;  // of samples that no mode reaches
  HWY_ALIGN Row bound_weight, baseline;
  HWY_ALIGN float start_x[kMaxFootprints][kMaxLanes], start_y[kMaxFootprints][kMaxLanes];  // within pixels
  bool bounded = false;
  Point best, trial;
  SeenMode seen[kMaxFootprints];
  HWY_ALIGN float column[kMaxFootprints][3][kChunk * kMaxLanes];
  HWY_ALIGN float residual[kChunk * kMaxLanes];
  HWY_ALIGN float gram[kMaxFootprints][kMaxFootprints][9][kMaxLanes];
  HWY_ALIGN float gain[kMaxFootprints][3][kMaxLanes];
  HWY_ALIGN float with_floor[kMaxFootprints][3][kMaxLanes];
  HWY_ALIGN float factor[kMaxNormal][kMaxLanes];
  HWY_ALIGN float step[kMaxFree][kMaxLanes];
};

struct Window {
  int first = 0, last = 0;
};

HWY_INLINE void AddTo(Row& to, V value) {
  const D d;
  hn::Store(hn::Add(hn::Load(d, to), value), d, to);
}

// The windows of a sweep around the starts of all lanes; sets what does not depend on samples.
void PlaceWindows(const SampleLayout::Sweep& sweep, const float* offset_px,
                  std::span<const BatchPixel> pixels, Gathered& gathered, Window (*windows)[kMaxFootprints]) {
  const auto lanes = static_cast<int>(hn::Lanes(D()));
  const auto count = static_cast<int>(pixels.size()), modes = pixels.front().start.size();
  const float* const end = offset_px + sweep.count;
  int most[kMaxFootprints] = {};
  for (auto& row : gathered.reaches) std::fill(std::begin(row), std::end(row), false);
  for (int lane = 0; lane < lanes; ++lane) {
    // Lanes without a pixel repeat the last one.
    const Footprints& start = pixels[std::min(lane, count - 1)].start;
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
}

void GatherSweep(const SampleLayout::Sweep& sweep, const float* offset_px, size_t s, std::ptrdiff_t stride,
                 std::span<const BatchPixel> pixels, BatchSpace& space) {
  const auto lanes = static_cast<int>(hn::Lanes(D()));
  const auto count = static_cast<int>(pixels.size()), modes = pixels.front().start.size();
  Gathered& gathered = space.sweeps[s];
  Window windows[kMaxLanes][kMaxFootprints];
  PlaceWindows(sweep, offset_px, pixels, gathered, windows);
  const size_t size = gathered.first[modes] * lanes;
  for (auto* const column : {&gathered.y, &gathered.root_weight, &gathered.floor, &gathered.offset_px})
    column->assign(size, 0.0f);
  for (int lane = 0; lane < lanes; ++lane) {
    const BatchPixel& pixel = pixels[std::min(lane, count - 1)];
    const Window* own = windows[lane];
    const double origin = modes == 0 ? 0.0
                                     : pixel.start[0].x_px * sweep.axis.cos_phi +
                                           pixel.start[0].y_px * sweep.axis.sin_phi - sweep.first_r_px;
    for (int m = 0; m < modes; ++m) {
      int at = gathered.first[m] * lanes + lane;
      for (int i = own[m].first; i < own[m].last; ++i) {
        bool had = false;
        for (int n = 0; n < m; ++n) had = had || (i >= own[n].first && i < own[n].last);
        if (had) continue;
        const size_t place = at;
        const float weight = pixel.weight[s] != nullptr ? pixel.weight[s][i * stride] : 1.0f;
        gathered.y[place] = pixel.y[s][i * stride];
        gathered.root_weight[place] = weight;
        gathered.floor[place] = pixel.floor_answer[s] != nullptr ? pixel.floor_answer[s][i * stride] : 1.0f;
        gathered.offset_px[place] = static_cast<float>(offset_px[i] - origin);
        at += lanes;
        if (weight > 0.0f) space.sample_count[lane] += 1.0f;
      }
    }
  }
  const D d;
  V squares = hn::Zero(d), products = hn::Zero(d);
  for (size_t i = 0; i < size; i += static_cast<size_t>(lanes)) {
    const V root = hn::Sqrt(hn::LoadU(d, gathered.root_weight.data() + i));
    const V y = hn::Mul(root, hn::LoadU(d, gathered.y.data() + i)),
            floor = hn::Mul(root, hn::LoadU(d, gathered.floor.data() + i));
    hn::StoreU(root, d, gathered.root_weight.data() + i);
    hn::StoreU(y, d, gathered.y.data() + i);
    hn::StoreU(floor, d, gathered.floor.data() + i);
    squares = hn::MulAdd(floor, floor, squares);
    products = hn::MulAdd(floor, y, products);
  }
  AddTo(space.floor_squares, hn::Neg(squares));
  AddTo(space.floor_products, hn::Neg(products));
}

void GatherAreas(const BatchModel& model, std::span<const BatchPixel> pixels, BatchSpace& space) {
  const auto lanes = hn::Lanes(D());
  space.areas.resize(std::max(space.areas.size(), model.areas.size()));
  for (size_t a = 0; a < model.areas.size(); ++a) {
    AreaLanes& own = space.areas[a];
    const LitArea& lit = model.areas[a].lit;
    own.lit = &lit;
    own.light = static_cast<float>(model.areas[a].light);
    for (size_t lane = 0; lane < lanes; ++lane) {
      const BatchPixel& pixel = pixels[std::min(lane, pixels.size() - 1)];
      const auto at = static_cast<std::ptrdiff_t>(a) * model.stride;
      own.y[lane] = own.seen[lane] = (pixel.area[at] - static_cast<float>(pixel.baseline)) / own.light;
      own.variance[lane] = pixel.area_variance[at] / (own.light * own.light);
      own.weight[lane] = 0.0f;
      for (int m = 0; lit.bars && m < pixel.start.size(); ++m) {
        const double centre = lit.horizontal ? pixel.start[m].y_px : pixel.start[m].x_px;
        const double bars = (centre - lit.offset_px) / lit.bar_px;
        own.place[m][lane] = static_cast<float>(bars - 2.0 * std::floor(0.5 * bars));
      }
    }
  }
}

void Gather(const BatchModel& model, std::span<const BatchPixel> pixels, BatchSpace& space) {
  space.bounded = false;
  for (size_t lane = 0; lane < hn::Lanes(D()); ++lane) {
    const BatchPixel& pixel = pixels[std::min(lane, pixels.size() - 1)];
    const auto set = [&](Row& row, double value) { row[lane] = static_cast<float>(value); };
    set(space.sample_count, 0.0);
    set(space.noise, pixel.noise_sd * pixel.noise_sd);
    set(space.floor_weight, std::min(pixel.floor_weight, static_cast<double>(kMaxFloorWeight)));
    set(space.black, pixel.black);
    set(space.all_floor_squares, pixel.floor_squares);
    set(space.floor_squares, pixel.floor_squares), set(space.floor_products, pixel.floor_products);
    set(space.bound_weight, pixel.bound_weight), set(space.baseline, pixel.baseline);
    space.bounded = space.bounded || pixel.bound_weight > 0.0;
    for (int m = 0; m < pixel.start.size(); ++m) {
      const auto place = [](double px) { return px - std::floor(px) - 0.5; };
      set(space.start_x[m], place(pixel.start[m].x_px)), set(space.start_y[m], place(pixel.start[m].y_px));
    }
  }
  space.sweeps.resize(std::max(space.sweeps.size(), model.layout.sweeps.size()));
  for (size_t s = 0; s < model.layout.sweeps.size(); ++s) {
    const SampleLayout::Sweep& sweep = model.layout.sweeps[s];
    GatherSweep(sweep, model.layout.offset_px.data() + sweep.first, s, model.stride, pixels, space);
  }
  GatherAreas(model, pixels, space);
}

void SeeMode(const Row* p, const Row& start_x, const Row& start_y, SeenMode& mode) {
  const D d;
  mode.l11 = hn::Load(d, p[3]), mode.l21 = hn::Load(d, p[4]), mode.l22 = hn::Load(d, p[5]);
  const V xx = hn::Mul(mode.l11, mode.l11), yy = hn::MulAdd(mode.l21, mode.l21, hn::Mul(mode.l22, mode.l22));
  const V x = hn::Load(d, p[1]), y = hn::Load(d, p[2]);
  mode.x = SeenThroughPixels(hn::Add(hn::Load(d, start_x), x), xx);
  mode.y = SeenThroughPixels(hn::Add(hn::Load(d, start_y), y), yy);
  mode.x.centre = hn::Add(mode.x.centre, x), mode.y.centre = hn::Add(mode.y.centre, y);
  mode.turn = hn::Mul(mode.x.centre_by_centre, mode.y.centre_by_centre);
  mode.xx = mode.x.variance, mode.yy = mode.y.variance;
  mode.xy = hn::Mul(mode.turn, hn::Mul(mode.l11, mode.l21));
}

InSweep Place(const Row& weight, const SeenMode& seen, const StripeAxis& axis, const Row& start_px) {
  const D d;
  const auto c = static_cast<float>(axis.cos_phi), s = static_cast<float>(axis.sin_phi),
             sigma_s = static_cast<float>(axis.sigma_px);
  const V own =
      hn::MulAdd(Set(c * c), seen.xx, hn::MulAdd(Set(2.0f * c * s), seen.xy, hn::Mul(Set(s * s), seen.yy)));
  const V variance = hn::Add(own, Set(sigma_s * sigma_s + static_cast<float>(kFlatPixel_px2)));
  const V sigma = hn::Sqrt(hn::Max(variance, Set(0.25f * sigma_s * sigma_s)));
  InSweep mode;
  mode.inverse_sigma = hn::Div(Set(1.0f), sigma);
  const V peak = hn::Mul(Set(sigma_s), mode.inverse_sigma);
  mode.amplitude = hn::Mul(hn::Load(d, weight), peak);
  mode.centre = hn::MulAdd(Set(c), seen.x.centre, hn::MulAdd(Set(s), seen.y.centre, hn::Load(d, start_px)));
  const V by_centre = hn::Mul(mode.amplitude, mode.inverse_sigma);
  const V by_variance =
      hn::Mul(hn::Mul(Set(0.5f), mode.amplitude), hn::Mul(mode.inverse_sigma, mode.inverse_sigma));
  mode.chain[0] = peak;
  mode.chain[1] = hn::Mul(by_centre, Set(c)), mode.chain[2] = hn::Mul(by_centre, Set(s));
  mode.chain[3] = hn::Mul(by_variance, Set(c * c)), mode.chain[4] = hn::Mul(by_variance, Set(2.0f * c * s)),
  mode.chain[5] = hn::Mul(by_variance, Set(s * s));
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

// Sums over samples that belong to no mode alone.
struct Residuals {
  V near, neighbours, by_floor;
};

// Adds samples that only one mode reaches.
void AddSingle(const Gathered& gathered, int first, int last, const InSweep& mode, V floor,
               float (*gain)[kMaxLanes], float (*gram)[kMaxLanes], float (*with_floor)[kMaxLanes],
               Residuals& sums) {
  const D d;
  const auto lanes = static_cast<int>(hn::Lanes(d));
  V before = hn::Zero(d);
  V g0 = hn::Load(d, gain[0]), g1 = hn::Load(d, gain[1]), g2 = hn::Load(d, gain[2]);
  V f0 = hn::Load(d, with_floor[0]), f1 = hn::Load(d, with_floor[1]), f2 = hn::Load(d, with_floor[2]);
  V h00 = hn::Load(d, gram[0]), h01 = hn::Load(d, gram[1]), h02 = hn::Load(d, gram[2]),
    h11 = hn::Load(d, gram[4]), h12 = hn::Load(d, gram[5]), h22 = hn::Load(d, gram[8]);
  for (int i = first * lanes; i < last * lanes; i += lanes) {
    const V z = hn::Mul(hn::Sub(hn::LoadU(d, gathered.offset_px.data() + i), mode.centre),
                        mode.inverse_sigma),
            zz = hn::Mul(z, z);
    const V u = Peak(zz, hn::LoadU(d, gathered.root_weight.data() + i));
    const V zu = hn::Mul(z, u), zzu = hn::MulSub(zz, u, u), v = hn::LoadU(d, gathered.floor.data() + i);
    const V r =
        hn::NegMulAdd(floor, v, hn::NegMulAdd(mode.amplitude, u, hn::LoadU(d, gathered.y.data() + i)));
    sums.near = hn::MulAdd(r, r, sums.near);
    sums.neighbours = hn::MulAdd(r, before, sums.neighbours);
    sums.by_floor = hn::MulAdd(r, v, sums.by_floor);
    before = r;
    g0 = hn::MulAdd(u, r, g0), g1 = hn::MulAdd(zu, r, g1), g2 = hn::MulAdd(zzu, r, g2);
    f0 = hn::MulAdd(u, v, f0), f1 = hn::MulAdd(zu, v, f1), f2 = hn::MulAdd(zzu, v, f2);
    h00 = hn::MulAdd(u, u, h00), h01 = hn::MulAdd(u, zu, h01), h02 = hn::MulAdd(u, zzu, h02);
    h11 = hn::MulAdd(zu, zu, h11), h12 = hn::MulAdd(zu, zzu, h12), h22 = hn::MulAdd(zzu, zzu, h22);
  }
  hn::Store(g0, d, gain[0]), hn::Store(g1, d, gain[1]), hn::Store(g2, d, gain[2]);
  hn::Store(f0, d, with_floor[0]), hn::Store(f1, d, with_floor[1]), hn::Store(f2, d, with_floor[2]);
  hn::Store(h00, d, gram[0]), hn::Store(h01, d, gram[1]), hn::Store(h02, d, gram[2]);
  hn::Store(h01, d, gram[3]), hn::Store(h11, d, gram[4]), hn::Store(h12, d, gram[5]);
  hn::Store(h02, d, gram[6]), hn::Store(h12, d, gram[7]), hn::Store(h22, d, gram[8]);
}

// Sets the columns of a chunk of samples and their residuals.
void SetColumns(const Gathered& gathered, int first, int count, const InSweep* modes, V floor,
                const int* reaching, int reaching_count, BatchSpace& space, Residuals& sums) {
  const D d;
  const auto lanes = static_cast<int>(hn::Lanes(d));
  V before = hn::Zero(d);
  for (int i = 0; i < count; ++i) {
    const int sample = (first + i) * lanes;
    const V root = hn::LoadU(d, gathered.root_weight.data() + sample);
    const V at = hn::LoadU(d, gathered.offset_px.data() + sample);
    const V v = hn::LoadU(d, gathered.floor.data() + sample);
    V residual = hn::NegMulAdd(floor, v, hn::LoadU(d, gathered.y.data() + sample));
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
    sums.near = hn::MulAdd(residual, residual, sums.near);
    sums.neighbours = hn::MulAdd(residual, before, sums.neighbours);
    sums.by_floor = hn::MulAdd(residual, v, sums.by_floor);
    before = residual;
  }
}

// Adds a chunk of samples that several modes reach.
void AddChunk(const Gathered& gathered, int first, int count, const InSweep* modes, V floor,
              const int* reaching, int reaching_count, BatchSpace& space, Residuals& sums) {
  const D d;
  const auto lanes = static_cast<int>(hn::Lanes(d));
  SetColumns(gathered, first, count, modes, floor, reaching, reaching_count, space, sums);
  const float* const v = gathered.floor.data() + first * lanes;
  for (int j = 0; j < reaching_count; ++j) {
    const int m = reaching[j];
    for (int q = 0; q < 3; ++q) {
      const float* const own = space.column[m][q];
      V g = hn::Load(d, space.gain[m][q]), f = hn::Load(d, space.with_floor[m][q]);
      for (int i = 0; i < count * lanes; i += lanes) {
        g = hn::MulAdd(hn::Load(d, own + i), hn::Load(d, space.residual + i), g);
        f = hn::MulAdd(hn::Load(d, own + i), hn::LoadU(d, v + i), f);
      }
      hn::Store(g, d, space.gain[m][q]), hn::Store(f, d, space.with_floor[m][q]);
    }
    for (int k = 0; k <= j; ++k) {
      const int n = reaching[k];
      auto& gram = space.gram[m][n];
      V h[9];
      for (int q = 0; q < 9; ++q) h[q] = hn::Load(d, gram[q]);
      const float *u = space.column[m][0], *zu = space.column[m][1], *zzu = space.column[m][2];
      const float *o = space.column[n][0], *zo = space.column[n][1], *zzo = space.column[n][2];
      for (int i = 0; i < count * lanes; i += lanes) {
        const V a = hn::Load(d, u + i), b = hn::Load(d, zu + i), c = hn::Load(d, zzu + i);
        const V e = hn::Load(d, o + i), f = hn::Load(d, zo + i), g = hn::Load(d, zzo + i);
        h[0] = hn::MulAdd(a, e, h[0]), h[1] = hn::MulAdd(a, f, h[1]), h[2] = hn::MulAdd(a, g, h[2]);
        h[3] = hn::MulAdd(b, e, h[3]), h[4] = hn::MulAdd(b, f, h[4]), h[5] = hn::MulAdd(b, g, h[5]);
        h[6] = hn::MulAdd(c, e, h[6]), h[7] = hn::MulAdd(c, f, h[7]), h[8] = hn::MulAdd(c, g, h[8]);
      }
      for (int q = 0; q < 9; ++q) hn::Store(h[q], d, gram[q]);
    }
  }
}

// Adds one sweep to the sums, by R, c and Sigma as stripes see them.
void AddSweep(const SampleLayout::Sweep& sweep, const Gathered& gathered, int mode_count, BatchSpace& space,
              Point& point, Residuals& sums) {
  const D d;
  const V zero = hn::Zero(d), floor = hn::Load(d, point.p[6 * mode_count]);
  InSweep modes[kMaxFootprints];
  for (int m = 0; m < mode_count; ++m) {
    modes[m] = Place(point.p[6 * m], space.seen[m], sweep.axis, gathered.start_px[m]);
    for (int q = 0; q < 3; ++q)
      hn::Store(zero, d, space.gain[m][q]), hn::Store(zero, d, space.with_floor[m][q]);
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
      AddSingle(gathered, begin, end, modes[near], floor, space.gain[near], space.gram[near][near],
                space.with_floor[near], sums);
      continue;
    }
    for (int first = begin; first < end; first += kChunk)
      AddChunk(gathered, first, std::min(kChunk, end - first), modes, floor, reaching, reaching_count, space,
               sums);
  }
  for (int m = 0; m < mode_count; ++m) {
    for (int i = 0; i < 6; ++i) {
      const V by_i = modes[m].chain[i];
      AddTo(point.gradient[6 * m + i], hn::Mul(by_i, hn::Load(d, space.gain[m][kColumnOf[i]])));
      AddTo(point.normal[Packed(6 * mode_count, 6 * m + i)],
            hn::Mul(by_i, hn::Load(d, space.with_floor[m][kColumnOf[i]])));
      for (int n = 0; n <= m; ++n) {
        for (int j = 0; j < (n == m ? i + 1 : 6); ++j) {
          const V sum = hn::Load(d, space.gram[m][n][3 * kColumnOf[i] + kColumnOf[j]]);
          AddTo(point.normal[Packed(6 * m + i, 6 * n + j)], hn::Mul(hn::Mul(by_i, modes[n].chain[j]), sum));
        }
      }
    }
  }
}

// Turns derivatives by R and by c and Sigma as seen into those by R, c and L.
void ToParameters(const SeenMode& mode, V (&by)[6]) {
  const V x = by[1], y = by[2], xx = by[3], xy = hn::Mul(mode.turn, by[4]), yy = by[5];
  const V by_xx = hn::Add(hn::MulAdd(mode.x.centre_by_variance, x, hn::Mul(mode.x.variance_by_variance, xx)),
                          hn::MulAdd(mode.x.centre_by_variance, x, hn::Mul(mode.x.variance_by_variance, xx)));
  const V half_yy = hn::MulAdd(mode.y.centre_by_variance, y, hn::Mul(mode.y.variance_by_variance, yy));
  const V by_yy = hn::Add(half_yy, half_yy);
  by[1] = hn::MulAdd(mode.x.centre_by_centre, x, hn::Mul(mode.x.variance_by_centre, xx));
  by[2] = hn::MulAdd(mode.y.centre_by_centre, y, hn::Mul(mode.y.variance_by_centre, yy));
  by[3] = hn::MulAdd(mode.l11, by_xx, hn::Mul(mode.l21, xy));
  by[4] = hn::MulAdd(mode.l21, by_yy, hn::Mul(mode.l11, xy));
  by[5] = hn::Mul(mode.l22, by_yy);
}

void ToParameters(int mode_count, BatchSpace& space, Point& point) {
  const D d;
  for (int m = 0; m < mode_count; ++m) {
    const V diagonal = hn::Add(hn::Load(d, point.normal[Packed(6 * m + 1, 6 * m + 1)]),
                               hn::Load(d, point.normal[Packed(6 * m + 2, 6 * m + 2)]));
    hn::Store(hn::Mul(Set(0.5f), diagonal), d, point.sharpness[m]);
    const auto turn_row = [&](auto at) {
      V by[6];
      for (int j = 0; j < 6; ++j) by[j] = hn::Load(d, at(j));
      ToParameters(space.seen[m], by);
      for (int j = 0; j < 6; ++j) hn::Store(by[j], d, at(j));
    };
    turn_row([&](int j) -> float* { return point.gradient[6 * m + j]; });
    turn_row([&](int j) -> float* { return point.normal[Packed(6 * mode_count, 6 * m + j)]; });
    for (int n = 0; n <= m; ++n) {
      V block[6][6];
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) {
          const int row = n == m ? std::max(i, j) : i, column = n == m ? std::min(i, j) : j;
          block[i][j] = hn::Load(d, point.normal[Packed(6 * m + row, 6 * n + column)]);
        }
        ToParameters(space.seen[n], block[i]);
      }
      for (int j = 0; j < 6; ++j) {
        V by[6];
        for (int i = 0; i < 6; ++i) by[i] = block[i][j];
        ToParameters(space.seen[m], by);
        for (int i = n == m ? j : 0; i < 6; ++i)
          hn::Store(by[i], d, point.normal[Packed(6 * m + i, 6 * n + j)]);
      }
    }
  }
}

// Samples that no mode reaches, black, widths, and weights above 1.
void AddPriors(int mode_count, BatchSpace& space, Point& point) {
  const D d;
  const int last = 6 * mode_count;
  const V floor = hn::Load(d, point.p[last]), squares = hn::Load(d, space.floor_squares),
          products = hn::Load(d, space.floor_products), weight = hn::Load(d, space.floor_weight);
  const V above = hn::Sub(floor, hn::Load(d, space.black));
  V chi2 = hn::Mul(hn::Mul(weight, above), above);
  chi2 = hn::MulAdd(floor, hn::MulSub(floor, squares, hn::Add(products, products)), chi2);
  AddTo(point.gradient[last], hn::NegMulAdd(floor, squares, hn::NegMulAdd(weight, above, products)));
  AddTo(point.normal[Packed(last, last)], hn::Add(weight, hn::Load(d, space.all_floor_squares)));
  const V narrow = hn::Mul(Set(static_cast<float>(kWidthWeight)),
                           hn::Max(hn::Load(d, space.noise), Set(static_cast<float>(kMinNoise * kMinNoise))));
  for (int m = 0; m < mode_count; ++m) {
    for (const int l : {3, 5}) {
      const V below = hn::Max(
          hn::Sub(Set(static_cast<float>(kUsualWidth_px)), hn::Load(d, point.p[6 * m + l])), hn::Zero(d));
      const V pull = hn::Mul(narrow, below);
      chi2 = hn::MulAdd(pull, below, chi2);
      AddTo(point.gradient[6 * m + l], pull);
      AddTo(point.normal[Packed(6 * m + l, 6 * m + l)],
            hn::IfThenElseZero(hn::Gt(below, hn::Zero(d)), narrow));
    }
  }
  if (space.bounded) {
    const V bound = hn::Load(d, space.bound_weight);
    for (int m = 0; m < mode_count; ++m) {
      const V beyond = hn::Max(hn::Sub(hn::Load(d, point.p[6 * m]), Set(1.0f)), hn::Zero(d));
      const V pull = hn::Mul(bound, beyond);
      chi2 = hn::MulAdd(pull, beyond, chi2);
      AddTo(point.gradient[6 * m], hn::Neg(pull));
      AddTo(point.normal[Packed(6 * m, 6 * m)], hn::IfThenElseZero(hn::Gt(beyond, hn::Zero(d)), bound));
    }
  }
  AddTo(point.chi2, chi2);
}

// What an area shows of each mode; of bars' inverse, from the bars before it.
void ShareModes(const AreaLanes& area, const AreaLanes* before, int mode_count, const BatchSpace& space,
                const Point& point, LitLane* shares) {
  const D d;
  const LitArea& lit = *area.lit;
  if (!lit.bars) {
    for (int m = 0; m < mode_count; ++m) shares[m] = {Set(1.0f), hn::Zero(d), hn::Zero(d)};
    return;
  }
  const bool known = before != nullptr && same_bars(*before->lit, lit);
  const auto bar_px = static_cast<float>(lit.bar_px);
  for (int m = 0; m < mode_count; ++m) {
    const SeenMode& mode = space.seen[m];
    if (!known) {
      const V moved = hn::Load(d, point.p[6 * m + (lit.horizontal ? 2 : 1)]);
      const V variance = lit.horizontal ? hn::MulAdd(mode.l21, mode.l21, hn::Mul(mode.l22, mode.l22))
                                        : hn::Mul(mode.l11, mode.l11);
      const V place = hn::MulAdd(moved, Set(1.0f / bar_px), hn::Load(d, area.place[m]));
      shares[m] = LitByBars(place, variance, bar_px);
    }
    if (known ? lit.inverse != before->lit->inverse : lit.inverse)
      shares[m] = {hn::Sub(Set(1.0f), shares[m].share), hn::Neg(shares[m].by_centre),
                   hn::Neg(shares[m].by_variance)};
  }
}

// Adds white and bars; by R, c, L and F.
void AddAreas(size_t area_count, int mode_count, BatchSpace& space, Point& point) {
  const D d;
  const int last = 6 * mode_count;
  const V floor = hn::Load(d, point.p[last]);
  LitLane shares[kMaxFootprints];
  V chi2 = hn::Zero(d);
  for (size_t a = 0; a < area_count; ++a) {
    const AreaLanes& area = space.areas[a];
    ShareModes(area, a > 0 ? &space.areas[a - 1] : nullptr, mode_count, space, point, shares);
    int place[4 * kMaxFootprints + 1], count = 0;
    V by[4 * kMaxFootprints + 1];
    const V answer = Set(1.0f / area.light);
    V rest = hn::NegMulAdd(floor, answer, hn::Load(d, area.y));
    const auto add = [&](int parameter, V derivative) { place[count] = parameter, by[count++] = derivative; };
    for (int m = 0; m < mode_count; ++m) {
      const LitLane& own = shares[m];
      const V weight = hn::Load(d, point.p[6 * m]);
      rest = hn::NegMulAdd(weight, own.share, rest);
      add(6 * m, own.share);
      if (!area.lit->bars) continue;
      const V by_c = hn::Mul(weight, own.by_centre),
              by_v = hn::Mul(weight, hn::Add(own.by_variance, own.by_variance));
      add(6 * m + (area.lit->horizontal ? 2 : 1), by_c);
      const SeenMode& mode = space.seen[m];
      if (!area.lit->horizontal) {
        add(6 * m + 3, hn::Mul(by_v, mode.l11));
      } else {
        add(6 * m + 4, hn::Mul(by_v, mode.l21));
        add(6 * m + 5, hn::Mul(by_v, mode.l22));
      }
    }
    add(last, answer);
    const V weight = hn::Load(d, area.weight);
    chi2 = hn::MulAdd(hn::Mul(weight, rest), rest, chi2);
    for (int i = 0; i < count; ++i) {
      const V weighted = hn::Mul(weight, by[i]);
      AddTo(point.gradient[place[i]], hn::Mul(weighted, rest));
      for (int j = 0; j <= i; ++j) AddTo(point.normal[Packed(place[i], place[j])], hn::Mul(weighted, by[j]));
    }
  }
  AddTo(point.chi2, chi2);
  AddTo(point.near, chi2);
}

// `area_count`: of those that count; 0: sweeps and F alone.
void EvaluatePoint(const SampleLayout& layout, size_t area_count, int mode_count, BatchSpace& space,
                   Point& point) {
  const D d;
  const V zero = hn::Zero(d);
  const int free = 6 * mode_count + 1;
  for (int i = 0; i < free; ++i) hn::Store(zero, d, point.gradient[i]);
  for (int i = 0; i < Packed(free, 0); ++i) hn::Store(zero, d, point.normal[i]);
  for (int m = 0; m < mode_count; ++m)
    SeeMode(point.p + 6 * m, space.start_x[m], space.start_y[m], space.seen[m]);
  Residuals sums{zero, zero, zero};
  for (size_t s = 0; s < layout.sweeps.size(); ++s)
    AddSweep(layout.sweeps[s], space.sweeps[s], mode_count, space, point, sums);
  ToParameters(mode_count, space, point);
  hn::Store(sums.near, d, point.chi2), hn::Store(sums.near, d, point.near);
  hn::Store(sums.neighbours, d, point.neighbours);
  AddTo(point.gradient[6 * mode_count], sums.by_floor);
  AddPriors(mode_count, space, point);
  if (area_count > 0) AddAreas(area_count, mode_count, space, point);
}

// Factorises a point's normal matrix with its diagonal scaled by 1 + `damping`.
void FactorNormal(const Point& point, V damping, int mode_count, BatchSpace& space) {
  const D d;
  const int free = 6 * mode_count + 1;
  for (int i = 0; i < Packed(free, 0); ++i) hn::Store(hn::Load(d, point.normal[i]), d, space.factor[i]);
  for (int m = 0; m < mode_count; ++m) {
    const auto diagonal = [&](int i) -> float* { return space.factor[Packed(6 * m + i, 6 * m + i)]; };
    // Within a pixel the derivative by a place vanishes, and near Sigma's boundary that by an l: each counts
    // as if it moved what stripes see by a tenth of itself.
    const V least = hn::Mul(Set(0.01f), hn::Load(d, point.sharpness[m]));
    for (int i = 1; i < 6; ++i) hn::Store(hn::Max(hn::Load(d, diagonal(i)), least), d, diagonal(i));
    for (int i = 0; i < 6; ++i) {
      const V value = hn::Load(d, diagonal(i));
      hn::Store(hn::MulAdd(damping, value, value), d, diagonal(i));
    }
  }
  FactorLower(space.factor, free);
}

void SetStarts(std::span<const BatchPixel> pixels, double narrowest_px, Point& point) {
  for (size_t lane = 0; lane < hn::Lanes(D()); ++lane) {
    const BatchPixel& pixel = pixels[std::min(lane, pixels.size() - 1)];
    const Footprints& start = pixel.start;
    for (int m = 0; m < start.size(); ++m) {
      // At least an eighth of a stripe: from zero an l could not grow.
      const Footprint mode = with_positive_covariance(start[m], narrowest_px * narrowest_px / 64.0);
      const double l11 = std::sqrt(mode.xx_px2), l21 = mode.xy_px2 / l11;
      const double l22 = std::sqrt(std::max(mode.yy_px2 - l21 * l21, 1e-12));
      const double own[6] = {mode.weight, 0.0, 0.0, l11, l21, l22};
      for (int i = 0; i < 6; ++i) point.p[6 * m + i][lane] = static_cast<float>(own[i]);
    }
    point.p[6 * start.size()][lane] = static_cast<float>(pixel.floor_weight < 1e12 ? pixel.black : 0.0);
  }
}

// A damped step from `best` to `trial`. Returns the predicted reduction of chi2.
V TakeStep(V damping, int mode_count, float narrowest_px, BatchSpace& space) {
  const D d;
  const Point& best = space.best;
  const int free = 6 * mode_count + 1;
  FactorNormal(best, damping, mode_count, space);
  for (int i = 0; i < free; ++i) hn::Store(hn::Load(d, best.gradient[i]), d, space.step[i]);
  SolveLower(space.factor, free, space.step);
  V promise = hn::Zero(d);
  for (int i = 0; i < free; ++i) {
    const V step = hn::Load(d, space.step[i]), now = hn::Load(d, best.p[i]);
    promise = hn::MulAdd(hn::Load(d, best.gradient[i]), step, promise);
    const V most = i + 1 == free ? Set(1.0f)
                   : i % 6 == 0  ? hn::Mul(Set(0.5f), now)
                                 : Set(0.5f * narrowest_px);
    hn::Store(hn::Add(now, hn::Max(hn::Min(step, most), hn::Neg(most))), d, space.trial.p[i]);
  }
  return promise;
}

// Takes the better ones of `trial`.
template <typename Mask>
void Take(Mask better, int mode_count, BatchSpace& space) {
  const D d;
  const int free = 6 * mode_count + 1;
  Point &best = space.best, &trial = space.trial;
  const auto take = [&](Row& to, const Row& from) {
    hn::Store(hn::IfThenElse(better, hn::Load(d, from), hn::Load(d, to)), d, to);
  };
  for (int i = 0; i < free; ++i) {
    take(best.p[i], trial.p[i]);
    take(best.gradient[i], trial.gradient[i]);
  }
  for (int i = 0; i < Packed(free, 0); ++i) take(best.normal[i], trial.normal[i]);
  for (int m = 0; m < mode_count; ++m) take(best.sharpness[m], trial.sharpness[m]);
  take(best.chi2, trial.chi2), take(best.near, trial.near), take(best.neighbours, trial.neighbours);
}

// Levenberg-Marquardt, each lane with its own damping. Sets the lanes that converged.
void Minimise(const SampleLayout& layout, size_t area_count, int mode_count, float narrowest_px,
              BatchSpace& space, Row& settled_lanes) {
  const D d;
  Point &best = space.best, &trial = space.trial;
  EvaluatePoint(layout, area_count, mode_count, space, best);
  const V samples = hn::Max(hn::Load(d, space.sample_count), Set(1.0f));
  V damping = Set(1e-3f);
  auto settled = hn::Lt(damping, hn::Zero(d));
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    // The predicted reduction relative to the noise of one sample, as in fit_jointly.
    const V promise = TakeStep(damping, mode_count, narrowest_px, space);
    const V chi2 = hn::Load(d, best.chi2), near = hn::Load(d, best.near);
    const V little = hn::Max(hn::Div(hn::Mul(Set(0.01f), near), samples),
                             hn::Mul(samples, Set(0.01f * kFinestStep * kFinestStep)));
    const auto bold = hn::Lt(damping, Set(0.1f)), last = hn::And(bold, hn::Le(promise, little));
    if (hn::AllTrue(d, hn::Or(settled, last))) {
      settled = hn::Or(settled, last);
      break;
    }
    EvaluatePoint(layout, area_count, mode_count, space, trial);
    const V gained = hn::Sub(chi2, hn::Load(d, trial.chi2));
    const auto better = hn::Ge(gained, hn::Mul(Set(-1e-6f), near));
    const auto idle = hn::And(better, hn::Lt(gained, hn::Mul(Set(3e-4f), near)));
    settled = hn::Or(settled, hn::Or(last, hn::And(bold, idle)));
    // Damping follows the accuracy of the quadratic model.
    const V scale =
        hn::IfThenElse(hn::Gt(gained, hn::Mul(Set(0.9f), promise)), Set(0.1f),
                       hn::IfThenElse(hn::Lt(gained, hn::Mul(Set(0.2f), promise)), Set(3.0f), Set(0.5f)));
    damping = hn::Max(hn::Mul(damping, hn::IfThenElse(better, scale, Set(4.0f))), Set(1e-6f));
    Take(better, mode_count, space);
    // Stop before the last few lanes converge: all would have to iterate with them.
    const size_t left = hn::CountTrue(d, hn::Not(settled));
    if (left == 0 || (iteration >= kPatience && 4 * left <= hn::Lanes(d))) break;
  }
  hn::Store(hn::IfThenElseZero(settled, Set(1.0f)), d, settled_lanes);
}

// How far white and bars can be trusted, given `best`: they count less where they may show that modes are not
// exactly Gaussian, and white more where sweeps leave more than noise, as it is right for footprints of any
// shape. Samples that were clipped at black get their expected values.
void WeighAreas(size_t area_count, int mode_count, V sweep_residual, BatchSpace& space) {
  const D d;
  const V zero = hn::Zero(d), noise = hn::Load(d, space.noise);
  const V floor = hn::Load(d, space.best.p[6 * mode_count]), baseline = hn::Load(d, space.baseline);
  const V residual = hn::Max(noise, sweep_residual);
  LitLane shares[kMaxFootprints];
  for (int m = 0; m < mode_count; ++m)
    SeeMode(space.best.p + 6 * m, space.start_x[m], space.start_y[m], space.seen[m]);
  for (size_t a = 0; a < area_count; ++a) {
    AreaLanes& area = space.areas[a];
    const bool bars = area.lit->bars;
    ShareModes(area, a > 0 ? &space.areas[a - 1] : nullptr, mode_count, space, space.best, shares);
    V light = zero, shape = zero;
    for (int m = 0; m < mode_count; ++m) {
      const V weight = hn::Load(d, space.best.p[6 * m]);
      const SeenMode& mode = space.seen[m];
      light = hn::MulAdd(weight, shares[m].share, light);
      if (!bars) continue;
      const V variance = area.lit->horizontal ? hn::MulAdd(mode.l21, mode.l21, hn::Mul(mode.l22, mode.l22))
                                              : hn::Mul(mode.l11, mode.l11);
      shape = hn::MulAdd(weight, LitShareError(variance, static_cast<float>(area.lit->bar_px)), shape);
    }
    const V variance = hn::Load(d, area.variance), own = hn::Abs(variance), sd = hn::Sqrt(own);
    // Per light of 1, from no light at all.
    const V dark = hn::Mul(baseline, Set(1.0f / area.light));
    const V above = hn::Max(hn::Add(dark, hn::MulAdd(floor, Set(1.0f / area.light), light)), zero);
    V density;
    const V below = Beyond(hn::Min(hn::Div(above, sd), Set(4.0f)), density);
    const V expected = hn::Sub(hn::NegMulAdd(sd, hn::Div(density, below), above), dark);
    const V y = hn::IfThenElse(hn::Lt(variance, zero), expected, hn::Load(d, area.seen));
    hn::Store(y, d, area.y);
    const V model = bars ? hn::MulAdd(Set(static_cast<float>(kBarsError)), hn::Abs(y), shape)
                         : hn::Mul(Set(static_cast<float>(kWhiteError)), y);
    const V least = hn::Mul(noise, Set(0.01f / (area.light * area.light)));
    hn::Store(hn::Div(bars ? noise : residual, hn::MulAdd(model, model, hn::Max(own, least))), d,
              area.weight);
  }
}

// The excess of white over `best`. Bars and their inverse together are white, whatever the shape of
// footprints.
void HoldAgainstWhite(size_t area_count, int mode_count, V light_variance, BatchSpace& space,
                      WhiteRest* found, size_t lanes) {
  const D d;
  const V floor = hn::Load(d, space.best.p[6 * mode_count]);
  V modes = hn::Zero(d);
  for (int m = 0; m < mode_count; ++m) modes = hn::Add(modes, hn::Load(d, space.best.p[6 * m]));
  V whole = hn::Zero(d), light = whole;
  for (size_t a = 0; a < area_count; ++a) {
    const AreaLanes& area = space.areas[a];
    const auto seen = [&](const AreaLanes& own) {
      return hn::NegMulAdd(floor, Set(1.0f / own.light), hn::Load(d, own.y));
    };
    V white = seen(area), variance = hn::Abs(hn::Load(d, area.variance));
    if (area.lit->bars) {
      if (a + 1 == area_count || !same_bars(*area.lit, *space.areas[a + 1].lit)) continue;
      white = hn::Add(white, seen(space.areas[++a]));
      variance = hn::Add(variance, hn::Abs(hn::Load(d, space.areas[a].variance)));
    }
    const V model = hn::Mul(Set(static_cast<float>(kWhiteError)), white);
    const V weight = hn::Div(Set(1.0f), hn::MulAdd(model, model, hn::Max(variance, Set(1e-12f))));
    light = hn::MulAdd(weight, white, light);
    whole = hn::Add(whole, weight);
  }
  const V white = hn::Div(light, whole), variance = hn::Add(hn::Div(Set(1.0f), whole), light_variance);
  HWY_ALIGN Row out[4];
  hn::Store(whole, d, out[0]), hn::Store(white, d, out[1]);
  hn::Store(hn::Sub(white, modes), d, out[2]), hn::Store(variance, d, out[3]);
  for (size_t lane = 0; lane < lanes; ++lane) {
    if (!(out[0][lane] > 0.0f)) continue;
    found[lane] = {.known = true, .white = out[1][lane], .rest = out[2][lane], .variance = out[3][lane]};
  }
}

// The variance of a sum of parameters for noise of standard deviation 1: the square of L^-1 e.
template <typename Chosen>
V VarianceOf(Chosen chosen, int free, BatchSpace& space) {
  const D d;
  V sum = hn::Zero(d);
  for (int j = 0; j < free; ++j) {
    V value = Set(chosen(j) ? 1.0f : 0.0f);
    for (int k = 0; k < j; ++k)
      value = hn::NegMulAdd(hn::Load(d, space.factor[Packed(j, k)]), hn::Load(d, space.step[k]), value);
    value = hn::Mul(value, hn::Load(d, space.factor[Packed(j, j)]));
    hn::Store(value, d, space.step[j]);
    sum = hn::MulAdd(value, value, sum);
  }
  return sum;
}

// Variances for residuals of variance 1.
struct Errors {
  HWY_ALIGN Row residual;  // its variance
  HWY_ALIGN Row weight[kMaxFootprints], centre[kMaxFootprints], light;
};

// What the samples determine about `best`, and what is known within a pixel (within_pixel.h). `least`: the
// residual's variance is at least that.
void FindErrors(int mode_count, V count, V least, BatchSpace& space, Errors& errors) {
  const D d;
  const int free = 6 * mode_count + 1;
  const V degrees = hn::Max(hn::Sub(count, Set(static_cast<float>(free))), Set(1.0f)),
          residual = hn::Max(hn::Div(hn::Load(d, space.best.near), degrees), least);
  const V unit = hn::Max(residual, Set(kFinestStep * kFinestStep));
  for (int i = 0; i < Packed(free, 0); ++i) hn::Store(hn::Load(d, space.best.normal[i]), d, space.factor[i]);
  for (int m = 0; m < mode_count; ++m) {
    const auto l = [&](int i) { return hn::Load(d, space.best.p[6 * m + i]); };
    // That weights end at 1 does not show how well the samples determine one.
    AddTo(space.factor[Packed(6 * m, 6 * m)],
          hn::IfThenElseZero(hn::Gt(l(0), Set(1.0f)), hn::Neg(hn::Load(d, space.bound_weight))));
    const V xx = hn::Mul(l(3), l(3)), yy = hn::MulAdd(l(4), l(4), hn::Mul(l(5), l(5)));
    const auto know = [&](int i, auto narrow) {
      AddTo(space.factor[Packed(6 * m + i, 6 * m + i)],
            hn::IfThenElseZero(narrow, hn::Mul(Set(static_cast<float>(1.0 / kFlatPixel_px2)), unit)));
    };
    const auto x = hn::Le(xx, Set(0.25f)), y = hn::Le(yy, Set(0.25f));
    know(1, x), know(3, x), know(2, y), know(4, y), know(5, y);
  }
  FactorLower(space.factor, free);
  hn::Store(residual, d, errors.residual);
  for (int m = 0; m < mode_count; ++m) {
    const auto of = [&](int i) { return VarianceOf([=](int j) { return j == 6 * m + i; }, free, space); };
    hn::Store(of(0), d, errors.weight[m]);
    hn::Store(hn::Mul(Set(0.5f), hn::Add(of(1), of(2))), d, errors.centre[m]);
  }
  hn::Store(VarianceOf([=](int j) { return j % 6 == 0 && j + 1 < free; }, free, space), d, errors.light);
}

JointFit FitOf(const BatchPixel& pixel, size_t lane, const BatchSpace& space, const Row& settled,
               const Row& count, const Errors& errors) {
  const int modes = pixel.start.size();
  const auto at = [&](const Row& row) { return static_cast<double>(row[lane]); };
  JointFit fit;
  fit.chi2 = fit.near_chi2 = at(space.best.near);
  fit.near_neighbours = at(space.best.neighbours);
  fit.near_count = static_cast<int>(count[lane]);
  fit.floor = at(space.best.p[6 * modes]);
  fit.converged = settled[lane] > 0.0f && std::isfinite(fit.chi2);
  const double variance = at(errors.residual);
  fit.light_sd = std::sqrt(variance * at(errors.light));
  for (int m = 0; m < modes; ++m) {
    const auto p = [&](int i) { return at(space.best.p[6 * m + i]); };
    fit.modes.push_back({.weight = p(0),
                         .x_px = pixel.start[m].x_px + p(1),
                         .y_px = pixel.start[m].y_px + p(2),
                         .xx_px2 = p(3) * p(3),
                         .xy_px2 = p(3) * p(4),
                         .yy_px2 = p(4) * p(4) + p(5) * p(5)});
    fit.weight_sd[m] = std::sqrt(variance * at(errors.weight[m]));
    fit.centre_sd_px[m] = std::sqrt(variance * at(errors.centre[m]));
  }
  return fit;
}

void FitLanes(const BatchModel& model, std::span<const BatchPixel> pixels, std::span<BatchFit> fits,
              BatchSpace& space) {
  const D d;
  const int modes = pixels.front().start.size();
  const size_t area_count = model.areas.size();
  double narrowest_px = 1e30;
  for (const SampleLayout::Sweep& sweep : model.layout.sweeps)
    narrowest_px = std::min(narrowest_px, sweep.axis.sigma_px);
  const auto narrowest = static_cast<float>(narrowest_px);
  Gather(model, pixels, space);
  SetStarts(pixels, narrowest_px, space.best);
  HWY_ALIGN Row settled, count;
  Errors errors;
  std::copy(std::begin(space.sample_count), std::end(space.sample_count), count);
  Minimise(model.layout, 0, modes, narrowest, space, settled);
  FindErrors(modes, hn::Load(d, count), hn::Zero(d), space, errors);
  WhiteRest rests[kMaxLanes];
  const V residual = hn::Div(hn::Load(d, space.best.near), hn::Max(hn::Load(d, count), Set(1.0f)));
  const V light_variance = hn::Mul(hn::Load(d, errors.residual), hn::Load(d, errors.light));
  WeighAreas(area_count, modes, residual, space);
  HoldAgainstWhite(area_count, modes, light_variance, space, rests, pixels.size());
  for (size_t lane = 0; lane < pixels.size(); ++lane) {
    fits[lane].sweeps = FitOf(pixels[lane], lane, space, settled, count, errors);
    fits[lane].beyond = rests[lane];
    fits[lane].all = {};
  }
  if (area_count == 0) return;
  // The first fit's widths show well enough how far bars can be trusted; their effect is computed once more.
  for (int round = 0; round < 2; ++round) {
    if (round > 0) WeighAreas(area_count, modes, residual, space);
    Minimise(model.layout, area_count, modes, narrowest, space, settled);
  }
  hn::Store(hn::Add(hn::Load(d, count), Set(static_cast<float>(area_count))), d, count);
  // White and bars with little weight leave residuals below the noise.
  FindErrors(modes, hn::Load(d, count), hn::Load(d, errors.residual), space, errors);
  for (size_t lane = 0; lane < pixels.size(); ++lane)
    fits[lane].all = FitOf(pixels[lane], lane, space, settled, count, errors);
}

void FitBatch(const BatchModel& model, std::span<const BatchPixel> pixels, std::span<BatchFit> fits) {
  const auto space = std::make_unique<BatchSpace>();
  const size_t lanes = hn::Lanes(D());
  for (size_t first = 0; first < pixels.size(); first += lanes) {
    const size_t count = std::min(lanes, pixels.size() - first);
    FitLanes(model, pixels.subspan(first, count), fits.subspan(first, count), *space);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing {

HWY_EXPORT(FitBatch);

void fit_batch(const BatchModel& model, std::span<const BatchPixel> pixels, std::span<BatchFit> fits) {
  if (!pixels.empty()) HWY_DYNAMIC_DISPATCH(FitBatch)(model, pixels, fits);
}

}  // namespace glasswing
#endif
