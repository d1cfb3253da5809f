// read_any_manifest, on a directory whose manifest.json is the input.
#include <cmath>
#include <set>

#include "core/frame/archive.h"
#include "core/import/foreign_manifest.h"
#include "tests/fuzz/fuzz_target.h"

namespace glasswing::fuzz {

std::vector<std::string> seeds() {
  return {
      R"({"format_version": 1, "session": "s", "created": "2026-01-31T12:00:00Z", "generator": "glasswing 0.1.0",
 "monitors": [{"name": "back", "width_px": 128, "height_px": 96, "refresh_hz": 60, "response": "linear"},
  {"name": "left", "width_px": 96, "height_px": 96}],
 "camera": {"name": "camera-1", "width_px": 128, "height_px": 96, "bits": 12, "response": "linear",
  "read_sd": 0.001, "gain": 1e-05},
 "plan": {"method": "gaussian", "sweeps": [{"orientation_deg": 45, "sigma_px": 4, "step_px": 2}],
  "solids": [{"colour": [0, 0, 0]}], "square_waves": {"levels": 3}, "exposure_ms": [4, 8]},
 "frames": [{"file": "frames/000000.tif", "object": true, "stimulus": {"kind": "gauss_stripe", "panel": "back",
   "phi_deg": -45, "r_px": -3.5, "sigma_px": 4, "peak": 1, "colour": [1, 0.5, 0]}, "exposure_ms": 4, "gain": 1,
   "proof": "PROOF_TIME", "exposure_start_ns": "123456789", "exposure_end_ns": "123956789", "sequence": "17",
   "checksum": "xxh3:0123456789abcdef", "size_bytes": "73984"},
  {"file": "frames/000001.tif", "step": 1, "stimulus": {"kind": "square", "orient": "vertical_bars", "level": 2,
   "bar_width_px": 32, "inverse": true}, "also_lit": [{"kind": "solid", "panel": "left"}]},
  {"file": "frames/000002.tif", "step": -1, "object": true, "stimulus": {"kind": "photo", "name": "stone",
   "image": "xxh30", "reference": true}}]})",
      R"({"scene": "a crystal ball", "monitor": {"back": {"width": 128, "height": 96}, "left": {"width": 9, "height": 7}},
 "image": {"width": 128, "height": 96}, "frames": [
 {"file": "obj/solid_black.png", "object": true, "stimulus": {"kind": "solid", "colour": [0, 0, 0], "panel": "back"}},
 {"file": "bg/a.png", "object": false, "stimulus": {"kind": "gauss_stripe", "phi_deg": 0, "r_px": 3, "sigma_px": 4,
  "peak": 1, "panel": "left", "unknown": {"deep": [[1, 2], {"a": null}]}}}]})",
      "{\"monitor\": " + std::string(3000, '[') + std::string(3000, ']') + "}",
      R"({"format_version": 1, "camera": {"width_px": 1000000000, "height_px": 1000000000}})"};
}

void try_input(std::string_view input) {
  const std::filesystem::path& directory = scratch_directory();
  write_plainly(directory / "manifest.json", input);
  const absl::StatusOr<v1::CaptureManifest> manifest = read_any_manifest(directory);
  if (!manifest.ok()) {
    FUZZ_CHECK(manifest.status().message().find("manifest.json") != std::string_view::npos);
    return;
  }
  const v1::Camera& camera = manifest->camera();
  FUZZ_CHECK(camera.width_px() >= 1 && camera.width_px() <= kMaxSide_px);
  FUZZ_CHECK(camera.height_px() >= 1 && camera.height_px() <= kMaxSide_px);
  FUZZ_CHECK(camera.read_sd() >= 0.0 && std::isfinite(camera.gain()));
  FUZZ_CHECK(manifest->monitors_size() >= 1 && manifest->monitors_size() <= kMaxMonitors);
  std::set<std::string> files;
  for (const v1::Frame& frame : manifest->frames()) {
    FUZZ_CHECK(files.insert(frame.file()).second);
    const std::filesystem::path path = (directory / frame.file().c_str()).lexically_normal();
    FUZZ_CHECK(path.string().starts_with(directory.string()));
    const v1::Stimulus& stimulus = frame.stimulus();
    for (const double number : {stimulus.phi_deg(), stimulus.r_px(), stimulus.sigma_px(), stimulus.peak(),
                                stimulus.bar_width_px(), frame.exposure_ms(), frame.gain()}) {
      FUZZ_CHECK(std::isfinite(number));
    }
  }
  FUZZ_CHECK(!files.empty());
}

}  // namespace glasswing::fuzz
