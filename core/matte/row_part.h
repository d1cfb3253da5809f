// Parts: separately solved rows of a matte, each in its own file whose data window is the rows
// (`glasswing-solver solve --rows`). Its metadata records their origin.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/file/positioned_file.h"
#include "core/matte/matte_file.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// What a part was solved from, and how. Parts of one matte may differ only in `vectors`.
struct PartOrigin {
  std::string archive;       // archive_digest()
  std::string computes;      // versions: "gaussian/1 matte/1"
  std::string vectors;       // the processor's kind; the last bits of sums differ between two
  bool as_recorded = false;  // what the rig did to the frames was left uncorrected
};

// The same for equal manifests, which hold the checksums of all frames.
std::string archive_digest(const v1::CaptureManifest& manifest);

void mark_part(const PartOrigin& origin, v1::MatteMetadata& metadata);
// None: not a part.
std::optional<PartOrigin> origin_of(const v1::MatteMetadata& metadata);

struct JoinedParts {
  MatteOutline outline;
  PartOrigin origin;
  std::set<std::string> vectors;  // of all parts
  PixelCount pixels;
};

// For users: the parts came from processors of several kinds. Empty: they did not.
std::string mixed_vectors(const JoinedParts& joined);

// Verifies the parts and writes the matte of their rows: the file of one process that solved all of them,
// byte for byte. INVALID_ARGUMENT names the file that is not a part or differs from the first in archive,
// method, option or version, and missing or duplicate rows. DATA_LOSS names a damaged file.
absl::StatusOr<JoinedParts> join_parts(const std::vector<std::filesystem::path>& parts, PositionedFile& file);

}  // namespace glasswing
