#include "compositing/dataset/dataset_files.h"

#include "core/base/status.h"
#include "core/file/file.h"
#include "core/image/image_file.h"

namespace glasswing {

absl::Status write_png(const std::filesystem::path& path, const RadianceImage& picture,
                       const RadianceImage* coverage) {
  GW_ASSIGN_OR_RETURN(const std::string bytes,
                      encode_radiance(path, picture, Encoding::kDisplay, 8, {}, coverage));
  return write_file_durably(path, bytes);
}

absl::Status write_mask(const std::filesystem::path& path, const RadianceImage& values) {
  RadianceImage mask(values.width_px, values.height_px);
  for (int i = 0; i < std::ssize(mask.samples); ++i)
    mask.samples[i] = values.samples[i / 3] > 0.5f ? 1.0f : 0.0f;
  return write_png(path, mask);
}

}  // namespace glasswing
