// real-plane ARCHIVE MATTE [X,Y,WIDTH,HEIGHT]: bars on a plane, solved by method hierarchical. The matte's
// centres are held to the plane's homography and a cubic for the lenses, fitted to a plain decode of pixels
// with much contrast; pixels of the box, where an object stands, are left out. The matte must come closer to
// the plane than the decode that the plane was fitted to.
//
// The plain decode takes a bar for lit where its photograph is lighter than the complement, or than the
// middle of the pixel's lightest and darkest; the bars down to 2 px then leave one interval of the monitor.
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <optional>
#include <tuple>
#include <vector>

#include "core/base/status.h"
#include "core/import/mapped_archive.h"
#include "core/matte/matte_file.h"
#include "core/pattern/pattern.h"

namespace glasswing {
namespace {

constexpr int kGreen = 1;
constexpr double kFinest_px = 2.0;
constexpr double kBright = 60.0 / 255.0, kDim = 8.0 / 255.0;  // white minus black

struct Bars {
  int lit = -1, complement = -1;  // frames
  std::vector<bool> shown;        // by monitor px
};

// An axis's bars, and the middle of the interval that each combination of lit and dark bars leaves.
struct Axis {
  std::vector<Bars> bars;
  std::map<std::vector<bool>, double> middle_px;
};

Axis axis_of(const v1::CaptureManifest& manifest, const std::string& orient) {
  const MonitorSize size{manifest.monitors(0).width_px(), manifest.monitors(0).height_px()};
  const bool across = orient == "vertical_bars";
  const int side_px = across ? size.width_px : size.height_px;
  std::map<std::tuple<double, double>, Bars> bars;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Stimulus& stimulus = manifest.frames(i).stimulus();
    if (stimulus.orient() != orient || stimulus.bar_width_px() < kFinest_px) continue;
    Bars& own = bars[{-stimulus.bar_width_px(), stimulus.offset_px()}];
    (stimulus.inverse() ? own.complement : own.lit) = i;
    if (stimulus.inverse()) continue;
    const Pattern pattern = Pattern::create(stimulus, size).value();
    for (int t = 0; t < side_px; ++t)
      own.shown.push_back(pattern.radiance(across ? t + 0.5 : 0.5, across ? 0.5 : t + 0.5)[0] > 0.5f);
  }
  Axis axis;
  for (const auto& [key, each] : bars) axis.bars.push_back(each);
  std::map<std::vector<bool>, std::pair<double, double>> sums;
  for (int t = 0; t < side_px; ++t) {
    std::vector<bool> word;
    for (const Bars& each : axis.bars) word.push_back(each.shown[t]);
    auto& [sum, count] = sums[word];
    sum += t + 0.5;
    count += 1.0;
  }
  for (const auto& [word, sum] : sums) axis.middle_px[word] = sum.first / sum.second;
  return axis;
}

struct Pixel {
  double x = 0.0, y = 0.0, contrast = 0.0;
  Eigen::Vector2d decoded;  // monitor px
};

// Pixels with a contrast of 8 codes whose bars are those of one place.
std::vector<Pixel> decode(const MappedArchive& archive, const std::array<int, 4>& left_out) {
  const v1::CaptureManifest& manifest = archive.manifest();
  const std::array<Axis, 2> axes{axis_of(manifest, "vertical_bars"), axis_of(manifest, "horizontal_bars")};
  std::vector<Pixel> pixels;
  for (int y = 0; y < manifest.camera().height_px(); ++y) {
    std::vector<std::span<const std::uint16_t>> rows;
    for (int i = 0; i < manifest.frames_size(); ++i) rows.push_back(archive.rows(i, y, 1));
    for (int x = 0; x < manifest.camera().width_px(); ++x) {
      if (x >= left_out[0] && x < left_out[0] + left_out[2] && y >= left_out[1] &&
          y < left_out[1] + left_out[3])
        continue;
      const auto light = [&](int frame) { return rows[frame][3 * x + kGreen] / 65535.0; };
      double low = 1.0, high = 0.0;
      for (int i = 0; i < manifest.frames_size(); ++i) {
        low = std::min(low, light(i));
        high = std::max(high, light(i));
      }
      if (high - low < kDim) continue;
      Pixel pixel{.x = x + 0.5, .y = y + 0.5, .contrast = high - low, .decoded = {}};
      bool known = true;
      for (size_t axis = 0; axis < 2 && known; ++axis) {
        std::vector<bool> word;
        for (const Bars& bars : axes[axis].bars)
          word.push_back(light(bars.lit) >
                         (bars.complement >= 0 ? light(bars.complement) : 0.5 * (low + high)));
        const auto found = axes[axis].middle_px.find(word);
        known = found != axes[axis].middle_px.end();
        if (known) pixel.decoded[axis] = found->second;
      }
      if (known) pixels.push_back(pixel);
    }
  }
  return pixels;
}

// Monitor px by camera px: a homography, and a cubic of what it leaves.
class Plane {
 public:
  Plane(const std::vector<Pixel>& pixels, double width_px, double height_px) : scale_{width_px, height_px} {
    // Trimmed least squares: pixels further from the fit so far are of something else.
    for (const double within_px : {1e9, 50.0, 10.0, 4.0, 3.0, 3.0}) fit(pixels, within_px);
  }

  Eigen::Vector2d at(const Pixel& pixel) const {
    return (homography_ * place(pixel)).hnormalized() + cubic_.transpose() * powers(pixel);
  }

 private:
  using Powers = Eigen::Matrix<double, 10, 1>;

  Eigen::Vector3d place(const Pixel& pixel) const {
    return {pixel.x / scale_[0] - 0.5, pixel.y / scale_[1] - 0.5, 1.0};
  }
  Powers powers(const Pixel& pixel) const {
    const Eigen::Vector3d p = place(pixel);
    Powers result;
    Eigen::Index at = 0;
    for (int a = 0; a < 4; ++a) {
      for (int b = 0; a + b < 4; ++b) result[at++] = std::pow(p.x(), a) * std::pow(p.y(), b);
    }
    return result;
  }

  void fit(const std::vector<Pixel>& pixels, double within_px) {
    std::vector<const Pixel*> near;
    for (const Pixel& pixel : pixels) {
      if (pixel.contrast > kBright && (at(pixel) - pixel.decoded).norm() < within_px) near.push_back(&pixel);
    }
    Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
    for (const Pixel* pixel : near) {
      const Eigen::Vector3d p = place(*pixel);
      for (Eigen::Index axis = 0; axis < 2; ++axis) {
        Eigen::Matrix<double, 9, 1> row = Eigen::Matrix<double, 9, 1>::Zero();
        row.segment<3>(3 * axis) = p;
        row.tail<3>() = -pixel->decoded[axis] / kUnit_px * p;
        normal += row * row.transpose();
      }
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> solved(normal);
    const Eigen::Matrix<double, 9, 1> h = solved.eigenvectors().col(0);
    homography_.row(0) = kUnit_px * h.segment<3>(0).transpose();
    homography_.row(1) = kUnit_px * h.segment<3>(3).transpose();
    homography_.row(2) = h.segment<3>(6).transpose();
    Eigen::Matrix<double, 10, 10> square = Eigen::Matrix<double, 10, 10>::Zero();
    Eigen::Matrix<double, 10, 2> product = Eigen::Matrix<double, 10, 2>::Zero();
    for (const Pixel* pixel : near) {
      const Powers row = powers(*pixel);
      square += row * row.transpose();
      product += row * (pixel->decoded - (homography_ * place(*pixel)).hnormalized()).transpose();
    }
    cubic_ = square.ldlt().solve(product);
  }

  static constexpr double kUnit_px = 1000.0;  // so that the equations' terms are alike
  const std::array<double, 2> scale_;
  Eigen::Matrix3d homography_ = Eigen::Matrix3d::Identity();
  Eigen::Matrix<double, 10, 2> cubic_ = Eigen::Matrix<double, 10, 2>::Zero();
};

double median(std::vector<double> values) {
  if (values.empty()) return NAN;
  const auto middle = values.begin() + values.size() / 2;
  std::ranges::nth_element(values, middle);
  return *middle;
}

// The matte's pixels of this contrast that the decode finds on the plane. Distances in monitor px.
struct Comparison {
  static constexpr double kNear_px = 1.5, kFar_px = 3.0;
  static constexpr double kOfPlane_px = 20.0;  // decodes further off are of something else

  Comparison(const std::vector<Pixel>& pixels, const Plane& plane, const Matte& matte, double from,
             double to) {
    for (const Pixel& pixel : pixels) {
      const Eigen::Vector2d truth = plane.at(pixel);
      const double decoded_px = (pixel.decoded - truth).norm();
      if (pixel.contrast < from || pixel.contrast >= to || decoded_px > kOfPlane_px) continue;
      const int x = static_cast<int>(pixel.x), y = static_cast<int>(pixel.y);
      const Mode& mode = matte.modes(x, y, kGreen)[0];
      if (mode.weight <= 0.0f) {
        ++unseen;
        continue;
      }
      const Eigen::Vector2d off_px =
          Eigen::Vector2d(static_cast<double>(mode.x_px), static_cast<double>(mode.y_px)) - truth;
      const bool is_flagged = matte.flags(x, y) != kFlagNone;
      decoded.push_back(decoded_px);
      all.push_back(off_px.norm());
      if (off_px.norm() > kFar_px) ++(is_flagged ? far_flagged : far_unflagged);
      if (is_flagged) continue;
      solved.push_back(off_px.norm());
      for (const double axis_px : off_px)
        within_sd += std::abs(axis_px) < static_cast<double>(mode.centre_sd_px);
    }
  }
  bool is_closer() const { return decoded.empty() || median(all) <= median(decoded); }
  void print(const char* name) const {
    const auto share = [](double count, size_t of) {
      return 100.0 * count / std::max(1.0, static_cast<double>(of));
    };
    const auto near = [&](const std::vector<double>& off_px) {
      return share(
          static_cast<double>(std::ranges::count_if(off_px, [](double px) { return px < kNear_px; })),
          off_px.size());
    };
    fmt::print(
        "    {}: {} pixels, {:.1f} % flagged, {} more without light; within {} px {:.1f} % (plain decode "
        "{:.1f} %), "
        "median {:.2f} px ({:.2f} px)\n"
        "      not flagged: within {} px {:.1f} %, within one standard error {:.0f} % of x and y; of {} more "
        "than {} px off "
        "{:.0f} % are flagged\n",
        name, all.size(), share(static_cast<double>(all.size() - solved.size()), all.size()), unseen,
        kNear_px, near(all), near(decoded), median(all), median(decoded), kNear_px, near(solved),
        share(within_sd, 2 * solved.size()), far_flagged + far_unflagged, kFar_px,
        share(far_flagged, static_cast<size_t>(far_flagged + far_unflagged)));
  }

 private:
  std::vector<double> decoded, all, solved;  // distances from the plane; `solved`: of pixels without a flag
  int unseen = 0;                            // pixels that the matte gives no light
  int far_flagged = 0, far_unflagged = 0;
  double within_sd = 0.0;  // of 2 solved.size() errors
};

absl::StatusOr<bool> check(const std::string& archive_path, const std::string& matte_path,
                           const std::array<int, 4>& left_out) {
  GW_ASSIGN_OR_RETURN(const auto archive, MappedArchive::open_interpolated(archive_path));
  GW_ASSIGN_OR_RETURN(const Matte matte, read_matte(matte_path));
  const std::vector<Pixel> pixels = decode(*archive, left_out);
  if (pixels.empty()) return absl::InvalidArgumentError("no pixel can be decoded");
  const Plane plane(pixels, matte.width_px(), matte.height_px());
  const Comparison bright(pixels, plane, matte, kBright, 2.0), dim(pixels, plane, matte, kDim, kBright);
  bright.print("much contrast");
  dim.print("8 to 60 codes");
  return bright.is_closer();
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  std::array<int, 4> left_out{};
  if (argc < 3 || (argc > 3 && std::sscanf(argv[3], "%d,%d,%d,%d", &left_out[0], &left_out[1], &left_out[2],
                                           &left_out[3]) != 4)) {
    fmt::print(stderr, "usage: real-plane ARCHIVE MATTE [X,Y,WIDTH,HEIGHT]\n");
    return 2;
  }
  const absl::StatusOr<bool> held = glasswing::check(argv[1], argv[2], left_out);
  if (!held.ok()) fmt::print(stderr, "real-plane: {}\n", std::string(held.status().message()));
  return held.ok() && *held ? 0 : 1;
}
