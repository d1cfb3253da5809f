#include "core/footprint/matte_transport.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <mutex>
#include <span>
#include <utility>

#include "core/base/for_rows.h"
#include "core/base/status.h"
#include "core/composite/box_side.h"
#include "core/composite/footprint_quadrature.h"
#include "core/footprint/footprint.h"
#include "core/footprint/normal_rectangle.h"
#include "core/radiometry/primary_mix.h"

namespace glasswing {
namespace {

// Of errors: narrower footprints count as this wide, since entries jump as a point crosses a pixel's edge.
constexpr double kMinErrorVariance_px2 = 0.05 * 0.05;

struct Size {
  int width_px = 0, height_px = 0;
};

// Calls pixel(x, y, share) for the parts of a footprint of weight 1; a pixel may come several times.
template <typename Pixel>
void for_pixels(const Mode& mode, bool box, Size monitor, const Pixel& pixel) {
  if (box) {
    const BoxSide x(mode.x_px, mode.xx_px2, monitor.width_px), y(mode.y_px, mode.yy_px2, monitor.height_px);
    for (int v = y.first; v < y.last; ++v) {
      for (int u = x.first; u < x.last; ++u) pixel(u, v, x.share(u) * y.share(v));
    }
    return;
  }
  const FootprintLines lines(mode);
  const int width = lines.exchanged ? monitor.height_px : monitor.width_px;
  const int height = lines.exchanged ? monitor.width_px : monitor.height_px;
  lines.for_each(height, [&](int v, double mean, double sigma, double share) {
    for_pixels_of_line(mean, sigma, width, [&](int u, double twice) {
      if (lines.exchanged) {
        pixel(v, u, 0.5 * share * twice);
      } else {
        pixel(u, v, 0.5 * share * twice);
      }
    });
  });
}

Size size_of(const Matte& matte, int texture) {
  const v1::Monitor& monitor = matte.metadata.monitors(texture);
  return {.width_px = monitor.width_px(), .height_px = monitor.height_px()};
}

bool has_boxes(const Matte& matte) {
  return matte.metadata.footprint() == kBoxFootprint;
}

// Those with light, on monitors that the matte has.
std::vector<Mode> lit(const Matte& matte, std::vector<Mode> modes) {
  std::erase_if(modes, [&](const Mode& mode) {
    return mode.weight <= 0.0f || mode.texture < 0 || mode.texture >= matte.metadata.monitors_size();
  });
  return modes;
}

std::vector<Mode> lit_gaussians(const Matte& matte, int x, int y, int channel) {
  return lit(matte, matte.gaussians(x, y, channel));
}

}  // namespace

absl::StatusOr<MatteTransport> MatteTransport::create(const Matte& matte) {
  MatteTransport transport(matte);
  std::int64_t pixels = 0;
  for (const v1::Monitor& monitor : matte.metadata.monitors()) {
    transport.first_columns_.push_back(pixels);
    pixels += std::int64_t{monitor.width_px()} * monitor.height_px();
  }
  transport.first_columns_.push_back(pixels);
  if (pixels > std::numeric_limits<std::int32_t>::max()) {
    return absl::InvalidArgumentError(
        fmt::format("the matte's monitors have {} pixels; a transport matrix has at most {} columns", pixels,
                    std::numeric_limits<std::int32_t>::max()));
  }
  if (has_boxes(matte)) return transport;
  absl::StatusOr<MatteCovariance> covariance = MatteCovariance::create(matte.metadata);
  if (covariance.ok()) {
    transport.covariance_ = *std::move(covariance);
  } else if (covariance.status().code() != absl::StatusCode::kFailedPrecondition) {
    return covariance.status();
  }
  return transport;
}

// One thread's work on rows of the matrix.
class MatteTransport::Row {
 public:
  explicit Row(const MatteTransport& transport)
      : transport_(transport), matte_(transport.matte_), light_(transport.column_count()) {}

  struct Entry {
    std::int32_t column;
    float value, error;
  };
  const std::vector<Entry>& compute(int x, int y, int channel, bool errors) {
    const std::vector<Mode> modes = lit_gaussians(matte_, x, y, channel);
    entries_.clear();
    double whole = 0.0;
    for (const Mode& mode : modes) {
      const std::int64_t first = transport_.first_column(mode.texture);
      const Size monitor = size_of(matte_, mode.texture);
      for_pixels(mode, has_boxes(matte_), monitor, [&](int u, int v, double share) {
        const double light = mode.weight * share;
        if (light <= 0.0) return;
        const std::int64_t column = first + std::int64_t{v} * monitor.width_px + u;
        if (light_[column] == 0.0)
          entries_.push_back({.column = static_cast<std::int32_t>(column), .value = 0.0f, .error = 0.0f});
        light_[column] += light;
        whole += light;
      });
    }
    leave_out_smallest(whole);
    const bool solved = matte_.coverage(x, y) > 0.0f && matte_.flags(x, y) == kFlagNone;
    if (errors && solved) set_errors(x, y, channel);
    return entries_;
  }

 private:
  void leave_out_smallest(double whole) {
    for (Entry& entry : entries_) entry.value = static_cast<float>(std::exchange(light_[entry.column], 0.0));
    std::ranges::sort(entries_, {}, &Entry::value);
    double left_out = 0.0;
    const auto kept = std::ranges::find_if(entries_, [&](const Entry& entry) {
      left_out += entry.value;
      return left_out > kLeftOut * whole;
    });
    entries_.erase(entries_.begin(), kept);
    std::ranges::sort(entries_, {}, &Entry::column);
  }

  // The entries of one monitor, and the rectangle of pixels around them.
  struct Lit {
    std::int64_t begin = 0, end = 0;
    int left = 0, top = 0, right = 0, bottom = 0;
  };
  Lit lit_part(int texture) const {
    const auto at = [&](std::int64_t column) {
      return std::ranges::lower_bound(entries_, column, {}, &Entry::column) - entries_.begin();
    };
    const int width = size_of(matte_, texture).width_px;
    const std::int64_t first = transport_.first_column(texture);
    Lit lit{.begin = at(first),
            .end = at(transport_.first_column(texture + 1)),
            .left = std::numeric_limits<int>::max(),
            .top = std::numeric_limits<int>::max()};
    for (std::int64_t i = lit.begin; i < lit.end; ++i) {
      const auto pixel = static_cast<int>(entries_[i].column - first);
      lit.left = std::min(lit.left, pixel % width), lit.right = std::max(lit.right, pixel % width + 1);
      lit.top = std::min(lit.top, pixel / width), lit.bottom = std::max(lit.bottom, pixel / width + 1);
    }
    return lit;
  }

  // A with A A' the covariance of F and the modes' numbers; empty: not known.
  Eigen::MatrixXd error_root(std::span<const Mode> modes) const {
    if (transport_.covariance_) return transport_.covariance_->root(modes);
    Eigen::MatrixXd root = Eigen::MatrixXd::Zero(1 + 6 * std::ssize(modes), 3 * std::ssize(modes));
    for (int k = 0; k < std::ssize(modes); ++k) {
      const Mode& mode = modes[k];
      if (mode.weight_sd <= 0.0f || mode.centre_sd_px <= 0.0f) return {};
      root(1 + 6 * k, 3 * k) = mode.weight_sd;
      root(2 + 6 * k, 3 * k + 1) = root(3 + 6 * k, 3 * k + 2) = mode.centre_sd_px;
    }
    return root;
  }

  // sd^2 = |A' dE/dp|^2, as in composite_error.h, for each entry E.
  void set_errors(int x, int y, int channel) {
    const std::span<const PyramidFootprint> pyramids = matte_.pyramids(x, y, channel);
    const std::vector<Mode> modes = lit(matte_, matte_.modes_without_pyramid(x, y, channel));
    Eigen::VectorXd squares = Eigen::VectorXd::Zero(std::ssize(entries_));
    if (!modes.empty()) {
      const Eigen::MatrixXd root = error_root(modes);
      if (root.size() == 0) return;
      Eigen::MatrixXd parts = Eigen::MatrixXd::Zero(root.cols(), std::ssize(entries_));
      Eigen::Index p = 1;
      for (const Mode& mode : modes) {
        add_error_parts(mode, root.middleRows<6>(p), parts);
        p += 6;
      }
      squares += parts.colwise().squaredNorm();
    }
    for (const PyramidFootprint& pyramid : pyramids) {
      if (!transport_.covariance_) return;
      const auto [places, root] = transport_.covariance_->errors_of(pyramid, matte_.modes(x, y, channel));
      if (root.size() == 0) return;
      squares += squares_of(places, root, pyramid.texture);
    }
    for (Eigen::Index i = 0; i < squares.size(); ++i)
      entries_[i].error = static_cast<float>(std::sqrt(squares[i]));
  }

  // Of the entries, by places of a pyramid.
  Eigen::VectorXd squares_of(const std::vector<Footprint>& places, const Eigen::MatrixXd& root,
                             int texture) const {
    Eigen::MatrixXd parts = Eigen::MatrixXd::Zero(root.cols(), std::ssize(entries_));
    const Size monitor = size_of(matte_, texture);
    const std::int64_t first = transport_.first_column(texture);
    for (size_t k = 0; k < places.size(); ++k) {
      const auto own = root.row(static_cast<Eigen::Index>(k) + 1).transpose();
      for_pixels(mode_of(places[k], 0.0, 0.0, texture), false, monitor, [&](int u, int v, double share) {
        const std::int64_t column = first + std::int64_t{v} * monitor.width_px + u;
        const auto entry = std::ranges::lower_bound(entries_, column, {}, &Entry::column);
        if (entry != entries_.end() && entry->column == column)
          parts.col(entry - entries_.begin()) += share * own;
      });
    }
    return parts.colwise().squaredNorm();
  }

  void add_error_parts(const Mode& mode, const Eigen::Ref<const Eigen::MatrixXd>& root,
                       Eigen::MatrixXd& parts) const {
    Lit lit = lit_part(mode.texture);
    if (lit.begin == lit.end) return;
    const Footprint own = with_positive_covariance(footprint_of(mode), kMinErrorVariance_px2);
    const int width = size_of(matte_, mode.texture).width_px;
    const auto reach_x = kReachSigmas * std::sqrt(own.xx_px2), reach_y = kReachSigmas * std::sqrt(own.yy_px2);
    lit.left = std::max(lit.left, static_cast<int>(std::floor(own.x_px - reach_x)));
    lit.right = std::min(lit.right, static_cast<int>(std::ceil(own.x_px + reach_x)));
    lit.top = std::max(lit.top, static_cast<int>(std::floor(own.y_px - reach_y)));
    lit.bottom = std::min(lit.bottom, static_cast<int>(std::ceil(own.y_px + reach_y)));
    const int columns = lit.right - lit.left, rows = lit.bottom - lit.top;
    if (columns <= 0 || rows <= 0) return;
    const NormalOnRectangles normal(
        {.x = own.x_px, .y = own.y_px, .xx = own.xx_px2, .xy = own.xy_px2, .yy = own.yy_px2});
    const std::vector<NormalShare> cells = normal.cells(lit.left, 1.0, columns, lit.top, 1.0, rows);
    const std::int64_t first = transport_.first_column(mode.texture);
    const double weight = mode.weight;
    for (std::int64_t i = lit.begin; i < lit.end; ++i) {
      const auto pixel = static_cast<int>(entries_[i].column - first);
      const int u = pixel % width - lit.left, v = pixel / width - lit.top;
      if (u < 0 || u >= columns || v < 0 || v >= rows) continue;
      const NormalShare& cell = cells[v * columns + u];
      Eigen::Matrix<double, 6, 1> slopes;
      slopes << cell.share, weight * cell.by_x, weight * cell.by_y, weight * cell.by_xx, weight * cell.by_xy,
          weight * cell.by_yy;
      parts.col(i) += root.transpose() * slopes;
    }
  }

  const MatteTransport& transport_;
  const Matte& matte_;
  std::vector<double> light_;  // by column; 0 between calls
  std::vector<Entry> entries_;
};

absl::StatusOr<TransportMatrix> MatteTransport::matrix(int channel, bool errors, int thread_count,
                                                       const std::function<void(double)>& progress) const {
  errors = errors && !has_boxes(matte_);
  const int width = matte_.width_px(), height = matte_.height_px();
  // By row of the camera's picture.
  std::vector<std::vector<Row::Entry>> rows(height);
  std::vector<std::vector<std::int32_t>> counts(height);
  std::atomic<int> rows_done = 0;
  std::atomic<std::int64_t> entries = 0;
  for_rows(height, thread_count, [&](int first, int last) {
    Row row(*this);
    for (int y = first; y < last && entries <= kMaxEntries; ++y) {
      for (int x = 0; x < width; ++x) {
        const std::vector<Row::Entry>& own = row.compute(x, y, channel, errors);
        rows[y].insert(rows[y].end(), own.begin(), own.end());
        counts[y].push_back(static_cast<std::int32_t>(own.size()));
      }
      entries += std::ssize(rows[y]);
      const int done = ++rows_done;
      if (progress && first == 0) progress(static_cast<double>(done) / height);
    }
  });
  if (entries > kMaxEntries) {
    return absl::ResourceExhaustedError(
        fmt::format("the matrix has more than {} entries; make the matte smaller with glasswing matte "
                    "reshape",
                    kMaxEntries));
  }
  TransportMatrix matrix{.row_count = std::int64_t{width} * height, .column_count = column_count()};
  matrix.starts.reserve(matrix.row_count + 1);
  matrix.starts.push_back(0);
  matrix.columns.reserve(entries);
  matrix.values.reserve(entries);
  if (errors) matrix.errors.reserve(entries);
  for (int y = 0; y < height; ++y) {
    for (const std::int32_t count : counts[y]) matrix.starts.push_back(matrix.starts.back() + count);
    for (const Row::Entry& entry : std::exchange(rows[y], {})) {
      matrix.columns.push_back(entry.column);
      matrix.values.push_back(entry.value);
      if (errors) matrix.errors.push_back(entry.error);
    }
  }
  return matrix;
}

absl::StatusOr<RadianceImage> composite_from_monitor(const Matte& matte, int texture,
                                                     const RadianceImage& shone, int thread_count) {
  if (shone.width_px != matte.width_px() || shone.height_px != matte.height_px()) {
    return absl::InvalidArgumentError(fmt::format("the picture that shines is {}x{}; it must be {}x{}",
                                                  shone.width_px, shone.height_px, matte.width_px(),
                                                  matte.height_px()));
  }
  GW_ASSIGN_OR_RETURN(const PrimaryMix mix, PrimaryMix::create(matte.metadata));
  // A matrix of the mix has its images of unit vectors as columns; the transpose, their products.
  const auto transposed = [&](const auto& image_of, const std::array<double, kChannels>& light) {
    std::array<double, kChannels> result{};
    for (int c = 0; c < kChannels; ++c) {
      PrimaryMix::Light unit{};
      unit[c] = 1.0f;
      const PrimaryMix::Light image = image_of(unit);
      for (int k = 0; k < kChannels; ++k) result[c] += image[k] * light[k];
    }
    return result;
  };
  const auto back = [&](const PrimaryMix::Light& light) { return mix.primaries(light); };
  const auto seen = [&](const PrimaryMix::Light& light) { return mix.seen(texture, light); };
  const Size monitor = size_of(matte, texture);
  const double scale = static_cast<double>(monitor.width_px) * monitor.height_px /
                       (static_cast<double>(matte.width_px()) * matte.height_px());
  std::vector<std::array<double, kChannels>> light(std::int64_t{monitor.width_px} * monitor.height_px);
  std::mutex mutex;
  for_rows(matte.height_px(), thread_count, [&](int first, int last) {
    std::vector<std::array<double, kChannels>> own(light.size());
    for (int y = first; y < last; ++y) {
      for (int x = 0; x < matte.width_px(); ++x) {
        std::array<double, kChannels> shines{shone.at(x, y, 0), shone.at(x, y, 1), shone.at(x, y, 2)};
        if (!mix.is_unit()) shines = transposed(back, shines);
        for (int c = 0; c < kChannels; ++c) {
          for (const Mode& mode : lit_gaussians(matte, x, y, c)) {
            if (mode.texture != texture) continue;
            const double weight = scale * mode.weight * shines[c];
            for_pixels(mode, has_boxes(matte), monitor, [&](int u, int v, double share) {
              own[v * monitor.width_px + u][c] += weight * share;
            });
          }
        }
      }
    }
    const std::lock_guard lock(mutex);
    for (size_t i = 0; i < light.size(); ++i) {
      for (int c = 0; c < kChannels; ++c) light[i][c] += own[i][c];
    }
  });
  RadianceImage picture(monitor.width_px, monitor.height_px);
  for (int i = 0; i < std::ssize(light); ++i) {
    const std::array<double, kChannels> own = mix.is_unit() ? light[i] : transposed(seen, light[i]);
    for (int c = 0; c < kChannels; ++c) picture.samples[3 * i + c] = static_cast<float>(own[c]);
  }
  return picture;
}

RadianceImage footprint_picture(const Matte& matte, int x, int y, int texture) {
  const Size monitor = size_of(matte, texture);
  RadianceImage picture(monitor.width_px, monitor.height_px);
  for (int c = 0; c < kChannels; ++c) {
    for (const Mode& mode : lit_gaussians(matte, x, y, c)) {
      if (mode.texture != texture) continue;
      for_pixels(mode, has_boxes(matte), monitor, [&](int u, int v, double share) {
        picture.at(u, v, c) += static_cast<float>(mode.weight * share);
      });
    }
  }
  return picture;
}

}  // namespace glasswing
