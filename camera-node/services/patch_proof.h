// Proof from pixels: reads the id patches in a session's frames, once it has learned where the camera sees
// them.
#pragma once

#include <absl/status/status.h>

#include <optional>
#include <string>
#include <vector>

#include "camera-node/camera.h"
#include "core/frame/archive.h"
#include "core/pattern/id_patch.h"

namespace glasswing {

enum class PatchVerdict {
  kAgrees,
  kOtherId,
  kUnreadable,  // no clear id
};

class PatchProof {
 public:
  // Learns from the frames of kind "patch" in an archive. Patches that they do not show stay unknown.
  // DATA_LOSS: a frame cannot be read.
  absl::Status learn_from(Archive& archive);
  // Frames of kind "patch", one for each learning id, all of one monitor, stage and exposure. What is learned
  // from them applies to frames of that stage and exposure.
  struct LearningSet {
    std::vector<Archive::NewFrame> frames;
    absl::Status learned;  // PatchReader::learn's result; OUT_OF_RANGE also: a later frame shows another id
  };
  // Adds a frame of kind "patch". It replaces a waiting one of the same id, monitor, stage and exposure. When
  // its set is complete, learns from the set and returns it. `last`: a later frame that must show the same
  // id, if it is not lost. The rows of a picture are replaced from the top, and those of the patch come last:
  // as long as it is shown, and one scan-out earlier, the picture above it has not been replaced either.
  std::optional<LearningSet> add(Archive::NewFrame frame, std::optional<CapturedFrame> last = {});

  // Compares `record.patch_id` with the pixels of each monitor whose patch is known. If the lit monitor's
  // patch agrees, sets record.proof to PROOF_TIME_AND_PATCH.
  PatchVerdict judge(v1::Frame& record, const Image16& image) const;

 private:
  struct Known {
    bool object = false;
    double exposure_ms = 0.0;
    std::string monitor;
    PatchReader reader;
    // `read` is what the reader sees of `id`.
    bool shows(std::uint16_t read, std::uint32_t id) const { return ((read ^ id) & reader.bits()) == 0; }
  };
  struct Waiting {
    Archive::NewFrame frame;
    std::optional<CapturedFrame> last;
  };
  absl::Status learn(const std::vector<Waiting>& set);

  std::vector<Known> known_;
  std::vector<Waiting> waiting_;  // of sets that are not complete
};

}  // namespace glasswing
