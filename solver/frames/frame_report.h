// What a session's frames have in common and in what they differ, before any fit: each frame of a known
// picture, against the empty stage beside the object,
//
//   light_f(p) = black(p) + o_f + g_f contrast(p) h_f(p - d_f(p)) + sum over k = 1, 2, 3 of a_k
//   light_(f-k)(p)
//
// with the gain g and the offset o of each channel, the shift d of what the camera sees, in its pixels, which
// includes a rotation about the picture's centre, and shares a of the remains of the last pictures. Flare is
// light in proportion to the picture's mean: o_f = e mean_f.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <string>
#include <vector>

#include "solver/background/stage_layout.h"
#include "solver/background/stage_maps.h"
#include "solver/frames/session_samples.h"

namespace glasswing {

inline constexpr size_t kGhosts = 3;  // last pictures that may be left in a frame

struct FrameMeasure {
  bool measured = false;
  bool clipped = false;  // what is lit lies beyond full scale; its gain is not measured
  std::array<double, kChannels> gain{1.0, 1.0, 1.0};  // relative to the bars of the empty stage
  std::array<double, kChannels> offset{};             // light
  double gain_sd = 0.0, offset_sd = 0.0;              // of a channel
  bool dark = false;  // the picture has dark parts, which tell its offset from its gain
  // The shift, and the inverse of its covariance: a stripe measures one direction. 0: of other pictures.
  double dx_px = 0.0, dy_px = 0.0;
  double xx = 0.0, xy = 0.0, yy = 0.0;       // px^-2
  double turn_rad = 0.0, turn_sd_rad = 0.0;  // clockwise; sd 0: not measured
  std::array<double, kChannels> mean{};      // light of the whole picture, with its flare
};

// A number with its standard deviation.
struct Measured {
  double value = 0.0, sd = 0.0;
};

struct FrameReport {
  size_t beside = 0;                 // pixels beside the object that were compared; 0: nothing was measured
  std::vector<FrameMeasure> frames;  // by index in the manifest
  std::vector<int> order;            // of all frames, by time
  double radius_px = 0.0;            // of the picture, from its middle to its corners
  std::vector<std::array<int, kGhosts>> before;  // the last frames of each, the latest first; -1: none
  std::array<Measured, kGhosts> ghost;
  Measured flare;
  bool has_ghosts = false, has_flare = false;  // significantly: removed before all else was measured

  // For users; empty if there is nothing to say.
  std::string black_warning, white_warning;

  double ghost_share() const { return has_ghosts ? ghost[0].value + ghost[1].value + ghost[2].value : 0.0; }
};

// What frames are compared with.
struct ComparedFrames {
  StageLayout layout;
  StageMaps maps;
  SessionSamples samples;
  std::vector<bool> beside;  // of the sampled pixels, which see the stage past the object
  double noise_sd = 0.0;     // of light
};

// Of these frames, which include all of lay_out_stage(). `sweeps`: stripes also measure the stage; faults of
// a few frames distort their measurements. Errors are those of `read`.
absl::StatusOr<ComparedFrames> compare_frames(const v1::CaptureManifest& manifest,
                                              const std::vector<int>& frames, const LightReader& read,
                                              bool sweeps);

// Indices of frames as they followed each other; in the manifest's order if some have no times.
std::vector<int> by_time(const v1::CaptureManifest& manifest);

// `beside`, cut into four quarters of the picture with equal numbers of pixels.
std::array<std::vector<bool>, 4> quarters_of(const SessionSamples& samples, const std::vector<bool>& beside);

// What is removed, where it is significant, before gains, offsets and shifts are measured.
struct Removed {
  bool ghosts = true, flare = true;
  bool again = false;  // some was taken off the samples before: what is left of it counts, too
};

// The frames as seen by the pixels of `beside`. Nothing is measured if the session has no bars, or too few,
// of the empty stage.
FrameReport report_frames(const v1::CaptureManifest& manifest, const ComparedFrames& compared,
                          const std::vector<bool>& beside, const Removed& removed = {});

}  // namespace glasswing
