// real-silhouettes DIRECTORY [MASKS]: compares masks of photographs of real glass in front of a screen with
// hand-drawn trimaps; writes the masks to MASKS.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <string>

#include "core/image/image_file.h"
#include "solver/background/object_mask.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr double kMinInside = 0.99, kMaxOutside = 0.005;

struct Shares {
  double inside = 0.0;   // share of the certain object pixels in the mask
  double outside = 0.0;  // share of the certain background pixels in the mask
};

RadianceImage picture_of(const Mask& mask) {
  RadianceImage picture(mask.width_px, mask.height_px);
  for (size_t i = 0; i < picture.samples.size(); ++i)
    picture.samples[i] = mask.samples[i / 3] != 0 ? 1.0f : 0.0f;
  return picture;
}

// The trimap is coarser: its pixel is inside if more than half of it is.
Shares compare(const Mask& mask, const Image16& trimap) {
  const RadianceImage coverage = resized(picture_of(mask), trimap.width_px, trimap.height_px);
  int objects = 0, backgrounds = 0;
  Shares shares;
  for (size_t i = 0; i < trimap.samples.size(); i += 3) {
    const bool inside = coverage.samples[i] > 0.5f;
    if (trimap.samples[i] == 65535) {
      ++objects;
      if (inside) shares.inside += 1.0;
    } else if (trimap.samples[i] == 0) {
      ++backgrounds;
      if (inside) shares.outside += 1.0;
    }
  }
  return {shares.inside / objects, shares.outside / backgrounds};
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

bool check(const fs::path& directory, const std::string& name, const fs::path& masks) {
  const Image16 with = read_photograph(directory / (name + ".jpg")).value().codes;
  const Image16 without = read_photograph(directory / (name + "_bg.jpg")).value().codes;
  const Image16 trimap = read_photograph(directory / (name + "_trimap.png")).value().codes;
  const MaskOptions options{.bits = 8};
  MaskOptions plain = options;
  plain.follow_drift = false;
  const Shares before = compare(ObjectMask::of_pair(with, without, plain).value().mask(with), trimap);
  const auto start = std::chrono::steady_clock::now();
  const ObjectMask object = ObjectMask::of_pair(with, without, options).value();
  const double prepared_s = seconds_since(start);
  Mask mask;
  double masked_s = 1e9;
  for (int i = 0; i < 5; ++i) {
    const auto then = std::chrono::steady_clock::now();
    mask = object.mask(with);
    masked_s = std::min(masked_s, seconds_since(then));
  }
  const Shares after = compare(mask, trimap);
  const ImageRegistration& registration = object.registration();
  fmt::print(
      "{:<10} {:6.2f} % of the object, {:5.2f} % of what is not (not moved: {:.2f} %, {:.2f} %); moved by "
      "{:+.3f} {:+.3f} px, corners up "
      "to {:.2f} px, gain {:.3f} {:.3f} {:.3f}; usual noise {:.2f} codes of 255; {:.2f} s and {:.1f} ms\n",
      name, 100.0 * after.inside, 100.0 * after.outside, 100.0 * before.inside, 100.0 * before.outside,
      registration.shift_px[0], registration.shift_px[1], registration.max_px(with.width_px, with.height_px),
      registration.gain[0], registration.gain[1], registration.gain[2], 255.0 * object.usual_noise(),
      prepared_s, 1e3 * masked_s);
  if (!masks.empty() && !write_radiance(masks / (name + ".png"), picture_of(mask), Encoding::kLinear).ok())
    fmt::print(stderr, "cannot write below {}\n", masks.string());
  return after.inside >= kMinInside && after.outside <= kMaxOutside;
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: real-silhouettes DIRECTORY [MASKS]\n");
    return 2;
  }
  if (!std::filesystem::exists(argv[1])) {
    std::printf("skipped: no data at %s; set GLASSWING_DATA\n", argv[1]);
    return 77;
  }
  bool good = true;
  for (const char* name : {"dragon", "two_glass", "horse"})
    good = glasswing::check(argv[1], name, argc > 2 ? argv[2] : "") && good;
  return good ? 0 : 1;
}
