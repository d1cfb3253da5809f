// Scenes that an independent renderer made: stripe sweeps as a camera would record them, and reference
// photographs to hold composites against.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/frame/image.h"
#include "solver/method.h"

namespace glasswing {

// What degrades a frame before it is solved.
struct Degradation {
  double noise_sd = 0.0;  // of full scale; clipped to [0, 1]
  int bits = 16;
  unsigned seed = 1;
};

// A reference photograph: what was on every monitor, and what the camera saw.
struct Photograph {
  std::string name;
  std::vector<RadianceImage> backgrounds;  // by texture; empty: black
  RadianceImage seen;
};

class RenderedScene {
 public:
  explicit RenderedScene(std::filesystem::path directory);

  const std::string& name() const { return name_; }
  std::vector<std::string> photograph_names() const;
  Photograph photograph(const std::string& name) const;
  // Every frame that the method needs.
  FrameStack stack(const Method& method, const Degradation& degradation = {}) const;
  // dB, linear light of full scale 1, over the pixels of which more than half is the object's.
  double psnr(const RadianceImage& composite, const RadianceImage& seen) const;
  const Image16& mask() const { return mask_; }

 private:
  std::filesystem::path directory_;
  std::string name_;
  v1::CaptureManifest manifest_;
  Image16 mask_;
};

}  // namespace glasswing
