// The measurements of one candidate on one scene, and their file.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "tests/results/rendered_scene.h"

namespace glasswing {

struct NoiseLevel {
  const char* name;
  Degradation degradation;
};
// From none to that of a fast camera in dim light.
inline constexpr NoiseLevel kNoiseLevels[] = {
    {"clean", {}}, {"0.5 %", {.noise_sd = 0.005, .bits = 12}}, {"2 %", {.noise_sd = 0.02, .bits = 10}}};

// At two refreshes of 60 Hz each.
inline constexpr double kImagesPerSecond = 30.0;

struct Figures {
  std::string scene, family, variant, noise;
  int images_with_object = 0, images_without = 0;
  double solve_seconds = 0.0;
  double flagged = 0.0;                // share of the object's pixels
  std::map<std::string, double> psnr;  // dB, by photograph

  int images() const { return images_with_object + images_without; }
  double capture_seconds() const { return images() / kImagesPerSecond; }
  double mean_psnr() const;
};

// Fields separated by semicolons, one line per photograph. NOT_FOUND; DATA_LOSS names an invalid line.
absl::StatusOr<std::vector<Figures>> read_figures(const std::filesystem::path& path);
absl::Status write_figures(const std::filesystem::path& path, const std::vector<Figures>& figures);

}  // namespace glasswing
