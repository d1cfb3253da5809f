// Proof from pixels: reads the id patches in a session's frames, once it has learned where the camera sees
// them.
#pragma once

#include <absl/status/status.h>

#include <optional>
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
  // Frames of kind "patch", one for each learning id, all of one monitor, stage and exposure; they serve
  // other frames of that stage and exposure.
  struct Lessons {
    std::vector<Archive::NewFrame> frames;
    absl::Status learned;  // PatchReader::learn's
  };
  // Holds a lesson, in place of one like it, until all that belong together are there; then gives them
  // back.
  std::optional<Lessons> add(Archive::NewFrame lesson);

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
  absl::Status learn(const std::vector<Archive::NewFrame>& frames);

  std::vector<Known> known_;
  std::vector<Archive::NewFrame> held_;
};

}  // namespace glasswing
