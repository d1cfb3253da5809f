// Scenes from an independent renderer: stripe sweeps as a camera would record them, and reference photographs
// to compare composites with.
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/image/mosaic.h"
#include "solver/gaussian/synthesized_capture.h"
#include "solver/method/method.h"

namespace glasswing {

// Degradation of a frame before solving.
struct Degradation {
  double noise_sd = 0.0;   // of full scale; clipped to [0, 1]
  double full_well = 0.0;  // electrons at full scale; 0: no photon noise
  int bits = 16;
  unsigned seed = 1;
};

// A reference photograph: the pictures on the monitors, and the camera's view with and without the object.
struct Photograph {
  std::string name;
  std::vector<RadianceImage> backgrounds;  // by texture; empty: black
  RadianceImage seen, bare;
};

class RenderedScene {
 public:
  explicit RenderedScene(std::filesystem::path directory);

  const std::string& name() const { return name_; }
  // Tells solvers and designs of the noise, as a camera's calibration does.
  void calibrate(const Degradation& degradation);
  // All recorded frames.
  const v1::CaptureManifest& manifest() const { return manifest_; }
  std::vector<std::string> photograph_names() const;
  Photograph photograph(const std::string& name) const;
  // White on the first monitor: a frame that was recorded for solving.
  Photograph white() const;
  // The frames of a capture that the method needs: their parts summed, then degraded. A frame without parts
  // is its pattern as the camera sees it without the object.
  absl::StatusOr<FrameStack> stack(const Method& method, const SynthesizedCapture& capture,
                                   const Degradation& degradation = {}) const;
  // dB, linear light of full scale 1, over pixels that the object covers by more than half.
  double psnr(const RadianceImage& composite, const RadianceImage& seen) const;
  // The same over what the photosites of a mosaic measure.
  double native_psnr(const RadianceImage& composite, const RadianceImage& seen) const;
  const Image16& mask() const { return mask_; }

 private:
  double psnr(const RadianceImage& composite, const RadianceImage& seen,
              const std::optional<Mosaic>& sites) const;
  // A recorded frame, decoded once.
  const Image16& recorded(int frame) const;
  RadianceImage made(const v1::Frame& frame, const std::vector<Part>& parts) const;
  // A pattern without the object, by casting the rays of each camera pixel.
  RadianceImage seen_straight(const v1::Stimulus& stimulus) const;

  std::filesystem::path directory_;
  std::string name_;
  v1::CaptureManifest manifest_;
  std::array<std::array<double, 3>, 2> monitor_from_camera_;  // of pixels; affine
  mutable std::map<int, Image16> recorded_;
  Image16 mask_;
};

}  // namespace glasswing
