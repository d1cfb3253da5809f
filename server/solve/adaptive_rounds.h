// Further images for adaptive captures (Plan.adapt): after each round it judges a draft of all images so far,
// and chooses what to show next.
#pragma once

#include <absl/status/statusor.h>

#include <stop_token>

#include "glasswing/v1/session.pb.h"
#include "server/solve/drafts.h"
#include "server/storage/matte_files.h"

namespace glasswing {

// Thread-safe.
class AdaptiveRounds {
 public:
  AdaptiveRounds(Drafts& drafts, const MatteFiles& mattes) : drafts_(drafts), mattes_(mattes) {}

  // Waits for the draft of all images of `session`, whose steps are all stored. Returns the session with the
  // draft's results (`adapted`) and with one more round in its plan, or with the same plan: the target is
  // reached, or no more images are allowed. CANCELLED: stopped. UNAVAILABLE: the archive's node does not
  // answer. FAILED_PRECONDITION: no draft can be made.
  absl::StatusOr<v1::Session> grow(v1::Session session, std::stop_token stop);

 private:
  absl::Status wait_for_draft(const v1::Session& session, std::stop_token stop);

  Drafts& drafts_;
  const MatteFiles& mattes_;
};

}  // namespace glasswing
