// Photographs in the raw formats of cameras: DNG, CR2, CR3, NEF, ARW and others that LibRaw reads. LibRaw is
// in a module of ours that is loaded with the first one.
//
//   light = (code - black) / (white - black)
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "core/image/image.h"

namespace glasswing {

inline constexpr std::int64_t kMaxRawBytes = 512 << 20;  // of a file, and of what LibRaw may allocate

// What the camera records with the picture.
struct RawFacts {
  std::optional<double> exposure_ms, iso;
  bool turned = false;  // the camera was not held upright; the sensor's rows stay as they lie
};

struct RawPhotograph {
  Image16 codes;       // of one channel, linear, without masked borders
  std::string mosaic;  // as v1::Camera.mosaic; empty: a sensor without colours
  // The code without light. If a file has several, codes are raised so that all photosites have the highest.
  int black = 0;
  int white = 0;  // the code at which photosites saturate
  RawFacts facts;
};

// By the suffix: most of these files are TIFFs, whose first picture is a thumbnail.
bool is_raw_file(const std::filesystem::path& path);

// DATA_LOSS: damaged, truncated, or an unsupported kind, such as a sensor without a Bayer mosaic; the message
// says which. UNIMPLEMENTED: glasswing-raw is not installed.
absl::StatusOr<RawPhotograph> decode_raw(std::string_view bytes);
// From the file's header only.
absl::StatusOr<RawFacts> read_raw_facts(std::string_view bytes);

}  // namespace glasswing
