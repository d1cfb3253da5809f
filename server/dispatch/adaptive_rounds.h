// Further images for adaptive captures (Plan.adapt): after each round it judges a draft of all images so far,
// and chooses what to show next.
#pragma once

#include <absl/status/statusor.h>

#include <stop_token>
#include <vector>

#include "core/design/adaptation.h"
#include "glasswing/v1/session.pb.h"
#include "server/dispatch/drafts.h"
#include "server/storage/matte_files.h"

namespace glasswing {

// Thread-safe.
class AdaptiveRounds {
 public:
  AdaptiveRounds(Drafts& drafts, const MatteFiles& mattes) : drafts_(drafts), mattes_(mattes) {}

  // Waits for the draft of all images of each session, of one plan but with its own camera, whose steps are
  // all stored. Returns the sessions with their drafts' results (`adapted`) and with one more round in their
  // plan, or with the same plan: the target is reached for each, or no more images are allowed. One of
  // several whose draft cannot be judged gets a warning, and the others choose. CANCELLED: stopped.
  // UNAVAILABLE: an archive's node does not answer. FAILED_PRECONDITION: no draft can be judged.
  absl::StatusOr<std::vector<v1::Session>> grow(std::vector<v1::Session> sessions, std::stop_token stop);

 private:
  struct Drafted {
    JudgedView view;
    std::vector<v1::Monitor> monitors;
  };
  absl::StatusOr<Drafted> drafted(const v1::Session& session, std::stop_token stop);
  absl::Status wait_for_draft(const v1::Session& session, std::stop_token stop);

  Drafts& drafts_;
  const MatteFiles& mattes_;
};

}  // namespace glasswing
