// Rays, and reflection and refraction at the boundary of two media.
#pragma once

#include <array>
#include <cmath>
#include <optional>

namespace glasswing {

struct Vec3 {
  double x = 0.0, y = 0.0, z = 0.0;
  friend Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Vec3 operator*(double s, Vec3 a) { return {s * a.x, s * a.y, s * a.z}; }
};
inline double dot(Vec3 a, Vec3 b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Vec3 cross(Vec3 a, Vec3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Vec3 normalized(Vec3 a) {
  return (1.0 / std::sqrt(dot(a, a))) * a;
}

struct Ray {
  Vec3 origin;
  Vec3 direction;  // unit
};

inline Vec3 at(const Ray& ray, double distance) {
  return ray.origin + distance * ray.direction;
}

// `normal` is unit and faces the incoming light (dot(direction, normal) < 0).
Vec3 reflected(Vec3 direction, Vec3 normal);
// Snell: sin_t = sin_i / eta, eta = n_beyond / n_here. None on total internal reflection.
std::optional<Vec3> refracted(Vec3 direction, Vec3 normal, double eta);
// Fresnel, unpolarised: the fraction reflected at incidence cos_i; 1 on total internal reflection.
double reflectance(double cos_i, double eta);

}  // namespace glasswing
