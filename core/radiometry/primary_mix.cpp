#include "core/radiometry/primary_mix.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr double kMaxAmplified = 10.0;  // by a row of N^-1: beyond it, noise would swamp the light

using Matrix = std::array<std::array<double, 3>, 3>;
constexpr Matrix kUnit = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

// The crosstalk with each row divided by its sum.
absl::StatusOr<Matrix> normalised(const google::protobuf::RepeatedField<double>& crosstalk,
                                  const std::string& monitor) {
  const auto bad = [&](const std::string& what) {
    return absl::InvalidArgumentError(fmt::format("the calibration of monitor \"{}\": {}", monitor, what));
  };
  if (crosstalk.size() != 9)
    return bad(fmt::format("crosstalk is {} long; it must be 9 long", crosstalk.size()));
  Matrix matrix{};
  for (size_t c = 0; c < 3; ++c) {
    double white = 0.0;
    for (size_t p = 0; p < 3; ++p) white += matrix[c][p] = crosstalk[static_cast<int>(3 * c + p)];
    if (!std::isfinite(white)) return bad("crosstalk must be finite");
    if (!(white > 0.0))
      return bad(fmt::format("a row of crosstalk has the sum {}; it must be above 0", white));
    for (double& share : matrix[c]) share /= white;
  }
  return matrix;
}

PrimaryMix::Light product(const Matrix& matrix, const PrimaryMix::Light& light) {
  PrimaryMix::Light out{};
  for (size_t row = 0; row < 3; ++row) {
    double sum = 0.0;
    for (size_t column = 0; column < 3; ++column) sum += matrix[row][column] * light[column];
    out[row] = static_cast<float>(sum);
  }
  return out;
}

}  // namespace

absl::StatusOr<PrimaryMix> PrimaryMix::create(const v1::CaptureManifest& manifest) {
  std::vector<Matrix> matrices(manifest.monitors_size(), kUnit);
  std::vector<bool> known(matrices.size());
  for (size_t t = 0; t < matrices.size(); ++t) {
    const std::string& monitor = manifest.monitors(static_cast<int>(t)).name();
    for (const v1::DisplayCalibration& calibration : manifest.display_calibrations()) {
      if (calibration.monitor() != monitor || calibration.crosstalk().empty()) continue;
      GW_ASSIGN_OR_RETURN(matrices[t], normalised(calibration.crosstalk(), monitor));
      known[t] = true;
    }
  }
  return create(std::move(matrices), known);
}

absl::StatusOr<PrimaryMix> PrimaryMix::create(const v1::MatteMetadata& metadata) {
  std::vector<Matrix> matrices(metadata.monitors_size(), kUnit);
  std::vector<bool> known(matrices.size());
  for (size_t t = 0; t < matrices.size() && static_cast<int>(t) < metadata.crosstalk_size(); ++t) {
    const v1::Crosstalk& own = metadata.crosstalk(static_cast<int>(t));
    if (own.share().empty()) continue;
    GW_ASSIGN_OR_RETURN(matrices[t], normalised(own.share(), metadata.monitors(static_cast<int>(t)).name()));
    known[t] = true;
  }
  return create(std::move(matrices), known);
}

absl::StatusOr<PrimaryMix> PrimaryMix::create(std::vector<Matrix> matrices, const std::vector<bool>& known) {
  PrimaryMix mix;
  const auto count = static_cast<double>(std::count(known.begin(), known.end(), true));
  if (count == 0.0) return mix;
  const auto eigen = [](const Matrix& matrix) {
    Eigen::Matrix3d out;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) out(row, column) = matrix[row][column];
    }
    return out;
  };
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
  for (size_t t = 0; t < matrices.size(); ++t) {
    if (known[t]) mean += eigen(matrices[t]) / count;
  }
  for (size_t t = 0; t < matrices.size(); ++t) {
    if (known[t]) mix.spread_ = std::max(mix.spread_, (eigen(matrices[t]) - mean).cwiseAbs().maxCoeff());
  }
  const Eigen::Matrix3d inverse = mean.inverse();
  if (!inverse.allFinite() || inverse.cwiseAbs().rowwise().sum().maxCoeff() > kMaxAmplified) {
    return absl::InvalidArgumentError(
        "the calibrations of the monitors: their crosstalk hardly tells primaries apart; removing it would "
        "amplify noise more than ten times");
  }
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) mix.inverse_[row][column] = inverse(row, column);
  }
  mix.matrices_ = std::move(matrices);
  return mix;
}

PrimaryMix::Light PrimaryMix::seen(int texture, const Light& primaries) const {
  return is_unit() ? primaries : product(matrices_.at(static_cast<size_t>(texture)), primaries);
}

PrimaryMix::Light PrimaryMix::primaries(const Light& seen) const {
  return is_unit() ? seen : product(inverse_, seen);
}

void PrimaryMix::describe(v1::MatteMetadata& metadata) const {
  for (const Matrix& matrix : matrices_) {
    v1::Crosstalk& crosstalk = *metadata.add_crosstalk();
    if (matrix == kUnit) continue;
    for (const auto& row : matrix) crosstalk.mutable_share()->Add(row.begin(), row.end());
  }
}

}  // namespace glasswing
