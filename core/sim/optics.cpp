#include "core/sim/optics.h"

namespace glasswing {

Vec3 reflected(Vec3 direction, Vec3 normal) {
  return direction - 2.0 * dot(direction, normal) * normal;
}

std::optional<Vec3> refracted(Vec3 direction, Vec3 normal, double eta) {
  const double cos_i = -dot(direction, normal);
  const double sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
  if (sin2_t >= 1.0) return std::nullopt;
  return normalized((1.0 / eta) * direction + (cos_i / eta - std::sqrt(1.0 - sin2_t)) * normal);
}

double reflectance(double cos_i, double eta) {
  const double sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
  if (sin2_t >= 1.0) return 1.0;
  const double cos_t = std::sqrt(1.0 - sin2_t);
  const double s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
  const double p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
  return 0.5 * (s * s + p * p);
}

}  // namespace glasswing
