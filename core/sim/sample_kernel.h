// The per-sample work of a simulated sensor, vectorised.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace glasswing {

inline constexpr size_t kSampleBlock = 4096;

// Independent standard normal deviates, a pure function of (seed, stream, block): uniform by Threefry4x32-20
// (Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3"), then normal by the Box-Muller
// transform. None exceeds 6.8. The key is (seed, stream), the counter (i, block, 0, 0) gives out[i + k *
// kSampleBlock / 4], k = 0 to 3.
void standard_normals(std::uint64_t seed, std::int64_t stream, std::uint32_t block,
                      std::span<float, kSampleBlock> out);

// The curve by which a camera codes its noisy samples: u = linear^exponent, then (1 - contrast) * u +
// contrast * (3 u^2 - 2 u^3), which rises from 0 to 1.
struct SensorCurve {
  float exponent = 1.0f;  // more than 0
  float contrast = 0.0f;  // 0 to 1
  friend bool operator==(const SensorCurve&, const SensorCurve&) = default;
};

// value = scale * radiance;  noisy = value + sqrt(read_variance + gain * value) * deviate;
// sample = curve(black + (1 - black) * noisy), the argument clamped to [0, 1]
struct SampleResponse {
  float scale = 1.0f;
  float read_variance = 0.0f;
  float gain = 0.0f;
  float black = 0.0f;
  SensorCurve curve = {};
  int levels = 65535;  // codes are 0 to this; they are stored on the 16-bit scale
};
void respond(const SampleResponse& response, std::span<const float, kSampleBlock> radiance,
             std::span<const float, kSampleBlock> deviates, std::span<std::uint16_t, kSampleBlock> out);

}  // namespace glasswing
