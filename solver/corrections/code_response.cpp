#include "solver/corrections/code_response.h"

#include <fmt/format.h>

#include <cmath>

#include "core/base/status.h"
#include "core/import/response_estimate.h"
#include "core/pattern/stimulus_kind.h"
#include "solver/frames/session_samples.h"
#include "solver/method/exposure_merge.h"

namespace glasswing {
namespace {

constexpr double kMinGamma = 1.6, kMaxGamma = 2.8;  // of codes that should be visible
constexpr double kMaxError = 0.1;                   // of sums that agree; ghosts and changed light scatter
constexpr double kErrors = 5.0;                     // standard errors
constexpr double kMonitorWhite = 1.0;               // saturated samples

}  // namespace

absl::StatusOr<CodeResponse> find_code_response(const v1::CaptureManifest& manifest,
                                                const std::vector<int>& frames, const LightReader& read) {
  const v1::Camera& camera = manifest.camera();
  if (manifest.has_camera_calibration() || camera.response() != "linear" || camera.black_level() > 0.0)
    return CodeResponse();
  v1::CaptureManifest known = manifest;  // of the frames that are read
  known.clear_frames();
  std::vector<int> patterns;
  for (const int f : frames) {
    const StimulusKind kind = kind_of(manifest.frames(f).stimulus());
    if (!is_pattern(manifest.frames(f)) || kind == StimulusKind::kStripe) continue;
    *known.add_frames() = manifest.frames(f);
    patterns.push_back(f);
  }
  if (patterns.empty()) return CodeResponse();
  GW_ASSIGN_OR_RETURN(const SessionSamples samples, sample_frames(manifest, patterns, read));
  std::vector<std::vector<float>> codes;
  for (const int f : patterns) {
    std::vector<float>& own = codes.emplace_back(samples.light[f]);
    for (float& code : own)
      code = std::isnan(code) ? static_cast<float>(kMonitorWhite) : std::max(code, 0.0f);
  }
  const ResponseEstimate estimate = estimate_response(known, codes, 0.0);
  const bool linear = estimate.response.empty() || estimate.response == "linear" ||
                      estimate.gamma < std::max(kMinGamma, 1.0 + kErrors * estimate.error) ||
                      estimate.gamma > kMaxGamma || estimate.error > kMaxError;
  if (linear) return CodeResponse();
  return CodeResponse{
      .response = estimate.response,
      .warning = fmt::format("the manifest calls the frames linear, but sums of light in them agree only if "
                             "their codes are {} ({}): treated as such",
                             estimate.response, estimate.reason)};
}

}  // namespace glasswing
