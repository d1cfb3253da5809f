#include "compositing/hosts/frei0r/object_in_frame.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>
#include <opencv2/imgproc.hpp>

#include "core/base/for_rows.h"
#include "core/base/status.h"
#include "core/file/mapped_file.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "core/rays/ray_file.h"

namespace glasswing {
namespace {

constexpr int kSamples = 4;  // of a pixel: r, g, b, a

// The code of each light (code16_of).
using Codes = std::array<std::uint8_t, 65536>;
const Codes& codes_of_lights() {
  static const Codes kCodes = [] {
    Codes codes{};
    for (size_t i = 0; i < codes.size(); ++i) {
      codes[i] = static_cast<std::uint8_t>(
          std::lround(255.0f * srgb_of_linear(radiance_of(static_cast<std::uint16_t>(i)))));
    }
    return codes;
  }();
  return kCodes;
}

RadianceImage light_of_frame(int width_px, int height_px, std::span<const std::uint8_t> frame) {
  const auto& lights = light_of_srgb_codes();
  RadianceImage light(width_px, height_px);
  for_rows(height_px, 0, [&](int first, int last) {
    const size_t width = static_cast<size_t>(width_px), end = static_cast<size_t>(last) * width;
    for (size_t pixel = static_cast<size_t>(first) * width; pixel < end; ++pixel) {
      for (size_t c = 0; c < kChannels; ++c)
        light.samples[pixel * kChannels + c] = lights[frame[pixel * kSamples + c]];
    }
  });
  return light;
}

// Least squares of affine maps from camera px to monitor px.
class MonitorViews {
 public:
  explicit MonitorViews(int monitor_count) : sums_(static_cast<size_t>(monitor_count)) {}

  // Takes the pixels of some rows that show a monitor beside the object; `top`: the first one's row.
  void add(const Matte& rows, int top) {
    constexpr int kGreen = 1;
    std::vector<Sums> sums(sums_.size());
    for (int y = 0; y < rows.height_px(); ++y) {
      for (int x = 0; x < rows.width_px(); ++x) {
        if (rows.coverage(x, y) != 0.0f || rows.flags(x, y) != kFlagNone) continue;
        for (const Mode& mode : rows.modes(x, y, kGreen)) {
          if (mode.weight <= 0.0f) continue;
          const Eigen::Vector3d camera(x + 0.5, top + y + 0.5, 1.0);
          Sums& of = sums[mode.texture];
          of.squares += mode.weight * camera * camera.transpose();
          of.products += mode.weight * camera * Eigen::RowVector2d(mode.x_px, mode.y_px);
          ++of.count;
        }
      }
    }
    const std::lock_guard lock(mutex_);
    for (size_t t = 0; t < sums.size(); ++t) {
      sums_[t].squares += sums[t].squares;
      sums_[t].products += sums[t].products;
      sums_[t].count += sums[t].count;
    }
  }

  std::vector<std::optional<AffineMap>> fit() const {
    std::vector<std::optional<AffineMap>> views;
    for (const Sums& sums : sums_) {
      constexpr int kMinPixels = 16;
      const auto solver = sums.squares.fullPivLu();
      if (sums.count < kMinPixels || !solver.isInvertible()) {
        views.emplace_back();
        continue;
      }
      const AffineMap view = solver.solve(sums.products).transpose();
      if (std::abs(view.leftCols<2>().determinant()) > 1e-6)
        views.emplace_back(view);
      else
        views.emplace_back();
    }
    return views;
  }

 private:
  struct Sums {
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
    Eigen::Matrix<double, 3, 2> products = Eigen::Matrix<double, 3, 2>::Zero();
    std::int64_t count = 0;
  };
  std::mutex mutex_;
  std::vector<Sums> sums_;
};

// (outer o inner)(x) = outer(inner(x)).
AffineMap chained(const AffineMap& outer, const AffineMap& inner) {
  AffineMap map = outer.leftCols<2>() * inner;
  map.col(2) += outer.col(2);
  return map;
}

AffineMap inverse(const AffineMap& map) {
  AffineMap inverted;
  inverted.leftCols<2>() = map.leftCols<2>().inverse();
  inverted.col(2) = -inverted.leftCols<2>() * map.col(2);
  return inverted;
}

// What the monitor shows when `frame_from_monitor` places the frame on it. Beyond its edges the frame's edge
// pixels continue.
RadianceImage frame_on_monitor(const RadianceImage& frame, AffineMap frame_from_monitor, int width_px,
                               int height_px) {
  // Averaged first where the monitor shows it smaller.
  const auto side = [&](int row, int length_px) {
    const double step = frame_from_monitor.row(row).head<2>().norm();
    return std::max(1, static_cast<int>(std::lround(length_px / std::max(1.0, step))));
  };
  const int less_width_px = side(0, frame.width_px), less_height_px = side(1, frame.height_px);
  cv::Mat from(frame.height_px, frame.width_px, CV_32FC3, const_cast<float*>(frame.samples.data()));
  if (from.size() != cv::Size(less_width_px, less_height_px))
    cv::resize(from, from, {less_width_px, less_height_px}, 0, 0, cv::INTER_AREA);
  frame_from_monitor.row(0) *= static_cast<double>(less_width_px) / frame.width_px;
  frame_from_monitor.row(1) *= static_cast<double>(less_height_px) / frame.height_px;
  RadianceImage shown(width_px, height_px);
  cv::Mat to(height_px, width_px, CV_32FC3, shown.samples.data());
  // OpenCV counts from pixels' centres.
  AffineMap& map = frame_from_monitor;
  map.col(2) += map.leftCols<2>() * Eigen::Vector2d(0.5, 0.5) - Eigen::Vector2d(0.5, 0.5);
  const cv::Matx23d places(map(0, 0), map(0, 1), map(0, 2), map(1, 0), map(1, 1), map(1, 2));
  cv::warpAffine(from, to, places, to.size(), cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
  return shown;
}

// The picture's light and coverage, premultiplied, at another size, with a border of nothing.
cv::Mat layer_of(const RadianceImage& picture, const RadianceImage* coverage, cv::Size size) {
  const cv::Size whole(picture.width_px, picture.height_px);
  cv::Mat layer = cv::Mat::zeros(size.height + 2, size.width + 2, CV_32FC4);
  cv::Mat inside = layer(cv::Rect({1, 1}, size));
  cv::Mat from = whole == size ? inside : cv::Mat(whole, CV_32FC4);
  const size_t width = whole.width;
  for_rows(whole.height, 0, [&](int first, int last) {
    for (int y = first; y < last; ++y) {
      const std::span<const float> covered =
          coverage ? std::span(&coverage->at(0, y, 0), width) : std::span<const float>();
      premultiply({&picture.at(0, y, 0), kChannels * width}, covered, {from.ptr<float>(y), kSamples * width});
    }
  });
  if (whole != size)
    cv::resize(from, inside, size, 0, 0, size.width < whole.width ? cv::INTER_AREA : cv::INTER_LINEAR);
  return layer;
}

// Puts a layer of layer_of(), whose inside begins at `corner` of the frame, over the frame.
void lay_over(const cv::Mat& layer, const Eigen::Vector2d& corner, int width_px, int height_px,
              std::span<const std::uint8_t> frame, std::span<std::uint8_t> out) {
  // The layer's pixel (x, y) reaches over the frame's (left + x, top + y) and the next ones.
  const int left = static_cast<int>(std::floor(corner.x())) - 1;
  const int top = static_cast<int>(std::floor(corner.y())) - 1;
  const auto across = static_cast<float>(corner.x() - std::floor(corner.x()));
  const auto down = static_cast<float>(corner.y() - std::floor(corner.y()));
  const int first_x = std::max(0, left + 1), end_x = std::min(width_px, left + layer.cols);
  const int first_y = std::max(0, top + 1), end_y = std::min(height_px, top + layer.rows);
  const auto& lights = light_of_srgb_codes();
  const Codes& codes = codes_of_lights();
  for_rows(std::max(0, end_y - first_y), 0, [&](int first, int last) {
    for (int y = first_y + first; y < first_y + last; ++y) {
      const auto* const above = layer.ptr<cv::Vec4f>(y - top - 1);
      const auto* const here = layer.ptr<cv::Vec4f>(y - top);
      for (int x = first_x; x < end_x; ++x) {
        const int i = x - left;
        const cv::Vec4f over = (1.0f - down) * ((1.0f - across) * here[i] + across * here[i - 1]) +
                               down * ((1.0f - across) * above[i] + across * above[i - 1]);
        const float covered = over[kChannels];
        if (covered == 0.0f) continue;
        const size_t pixel = (static_cast<size_t>(y) * width_px + x) * kSamples;
        for (size_t c = 0; c < kChannels; ++c) {
          const float light = over[static_cast<int>(c)] + (1.0f - covered) * lights[frame[pixel + c]];
          out[pixel + c] = codes[code16_of(light)];
        }
      }
    }
  });
}

}  // namespace

absl::StatusOr<ObjectInFrame> ObjectInFrame::open(const std::filesystem::path& file) {
  const auto failed = [&file](const absl::Status& status) {
    return absl::Status(status.code(), fmt::format("{}: {}", file.string(), std::string(status.message())));
  };
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> mapped, MappedFile::open(file));
  if (is_ray_file(mapped->bytes())) {
    return failed(absl::InvalidArgumentError(
        "it contains rays, which glasswing composite shows; this needs a matte from glasswing fetch"));
  }
  absl::StatusOr<MatteOutline> outline = outline_of(mapped->bytes());
  if (!outline.ok()) return failed(outline.status());
  RadianceImage coverage(outline->width_px, outline->height_px, 1);
  MonitorViews views(outline->metadata.monitors_size());
  absl::StatusOr<FastCompositor> compositor = FastCompositor::create(mapped->bytes(), [&](Matte& rows) {
    const int top = rows.y0_px() - outline->y0_px;
    for (int y = 0; y < rows.height_px(); ++y) {
      for (int x = 0; x < rows.width_px(); ++x) coverage.at(x, top + y, 0) = rows.coverage(x, y);
    }
    views.add(rows, top);
  });
  if (!compositor.ok()) return failed(compositor.status());
  if (!mapped->intact()) return failed(absl::DataLossError("it was altered while being read"));
  return ObjectInFrame(*std::move(compositor), std::move(outline->metadata), std::move(coverage),
                       views.fit());
}

absl::Status ObjectInFrame::composite(const Placement& placement, int width_px, int height_px,
                                      std::span<const std::uint8_t> frame,
                                      std::span<std::uint8_t> out) const {
  size_t texture = 0;
  if (!placement.monitor.empty()) {
    std::vector<std::string> names;
    for (const v1::Monitor& monitor : metadata_.monitors()) names.push_back(monitor.name());
    texture = static_cast<size_t>(std::ranges::find(names, placement.monitor) - names.begin());
    if (texture == names.size()) {
      return absl::InvalidArgumentError(fmt::format("the monitor is \"{}\"; this matte has: {}",
                                                    placement.monitor, fmt::join(names, ", ")));
    }
  }
  constexpr double kMaxSize = 4.0, kFarthest = 16.0;
  if (!(placement.size > 0.0 && placement.size <= kMaxSize && std::abs(placement.x) <= kFarthest &&
        std::abs(placement.y) <= kFarthest)) {
    return absl::InvalidArgumentError(
        fmt::format("size {} at {}, {}; the size must be above 0 and at most {}, x and y within {} of 0",
                    placement.size, placement.x, placement.y, kMaxSize, kFarthest));
  }

  // The picture is resized to whole pixels, then placed at any position.
  const double fit = placement.size * std::min(static_cast<double>(width_px) / coverage_.width_px,
                                               static_cast<double>(height_px) / coverage_.height_px);
  const cv::Size laid(std::max(1, static_cast<int>(std::lround(fit * coverage_.width_px))),
                      std::max(1, static_cast<int>(std::lround(fit * coverage_.height_px))));
  const Eigen::Vector2d corner(placement.x * width_px - 0.5 * laid.width,
                               placement.y * height_px - 0.5 * laid.height);
  AffineMap frame_from_camera = AffineMap::Zero();
  frame_from_camera(0, 0) = static_cast<double>(laid.width) / coverage_.width_px;
  frame_from_camera(1, 1) = static_cast<double>(laid.height) / coverage_.height_px;
  frame_from_camera.col(2) = corner;

  const RadianceImage light = light_of_frame(width_px, height_px, frame);
  const v1::Monitor& monitor = metadata_.monitors(static_cast<int>(texture));
  std::vector<RadianceImage> behind(metadata_.monitors_size());
  behind[texture] = placement.whole_picture || !views_[texture]
                        ? resized(light, monitor.width_px(), monitor.height_px())
                        : frame_on_monitor(light, chained(frame_from_camera, inverse(*views_[texture])),
                                           monitor.width_px(), monitor.height_px());
  GW_ASSIGN_OR_RETURN(const RadianceImage picture, compositor_.composite(behind));

  const cv::Mat layer = layer_of(picture, placement.whole_picture ? nullptr : &coverage_, laid);
  std::ranges::copy(frame, out.begin());
  lay_over(layer, corner, width_px, height_px, frame, out);
  return absl::OkStatus();
}

}  // namespace glasswing
