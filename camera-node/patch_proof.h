// Proof from pixels: reads the id patches in a session's frames, once it has learned where the camera sees
// them.
#pragma once

#include <absl/status/status.h>

#include <span>
#include <string>
#include <vector>

#include "core/frame/archive.h"
#include "core/pattern/id_patch.h"

namespace glasswing {

class PatchProof {
 public:
  // From the frames of kind "patch" that an archive holds; patches that are not seen in them stay unknown.
  // DATA_LOSS: a frame cannot be read.
  absl::Status learn_from(Archive& archive);
  // From one frame for each learning id, in any order, all of one monitor. It serves frames with the object
  // where these have it, and of their exposure. FAILED_PRECONDITION or NOT_FOUND: an id is missing, or
  // PatchReader::learn's.
  absl::Status learn(std::span<const Archive::NewFrame> frames);

  // False: the pixels show another id than `record.patch_id`, or none that is clear, on a monitor whose patch
  // is known. If the lit monitor's patch agrees, the record's proof is made PROOF_TIME_AND_PATCH.
  bool agrees(v1::Frame& record, const Image16& image) const;

 private:
  struct Known {
    bool object = false;
    double exposure_ms = 0.0;
    std::string monitor;
    PatchReader reader;
  };
  std::vector<Known> known_;
};

}  // namespace glasswing
