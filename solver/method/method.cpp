#include "solver/method/method.h"

#include <fmt/format.h>

namespace glasswing {

absl::Status check_rows(const FrameStack& stack, const v1::CaptureManifest& manifest,
                        const std::vector<int>& needed) {
  const auto pixels = static_cast<size_t>(stack.row_count) * stack.width_px;
  const size_t samples = pixels * static_cast<size_t>(stack.samples_per_pixel());
  for (const int frame : needed) {
    const size_t at = frame;
    const size_t found = at < stack.rows.size() ? stack.rows[at].size() : 0;
    if (found != samples) {
      return absl::InvalidArgumentError(
          fmt::format("{} has {} samples in {} rows; the manifest's width of {} px makes that {}",
                      manifest.frames(frame).file(), found, stack.row_count, stack.width_px, samples));
    }
  }
  return absl::OkStatus();
}

v1::MatteMetadata metadata_of(const v1::CaptureManifest& manifest, const std::string& method,
                              const MethodOptions& options) {
  v1::MatteMetadata metadata;
  metadata.set_format_version(1);
  metadata.set_session(manifest.session());
  metadata.set_method(method);
  for (const auto& [key, value] : options) (*metadata.mutable_options())[key] = value;
  *metadata.mutable_monitors() = manifest.monitors();
  metadata.set_width_px(manifest.camera().width_px());
  metadata.set_height_px(manifest.camera().height_px());
  metadata.set_generator("glasswing");
  return metadata;
}

Matte blank_matte(const FrameStack& stack, const v1::MatteMetadata& metadata, int modes_per_channel) {
  Matte matte(0, stack.first_row, stack.width_px, stack.row_count, modes_per_channel);
  matte.metadata = metadata;
  return matte;
}

}  // namespace glasswing
