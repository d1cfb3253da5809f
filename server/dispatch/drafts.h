// Drafts: mattes of a session that is still being captured, from the images so far. A draft is made from the
// steps up to a stage of the plan (core/pattern/draft_stages); its steps are fixed when it begins, so all its
// tiles use the same frames.
//
// Drafts are independent of the finished matte, which is solved from all frames once the capture has ended.
// Their tiles are in a job store of their own, in memory: they are handed out only while the other has none,
// they end with the capture or with the server, and their outcome does not change a session. Their leases
// have negative job numbers.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "core/base/time.h"
#include "core/pattern/draft_stages.h"
#include "glasswing/v1/work_service.pb.h"
#include "server/jobs/job_store.h"
#include "server/mattes/received_matte.h"
#include "server/solve/session_queue.h"
#include "server/solve/solve_session.h"

namespace glasswing {

// Short: once the capture has ended, solvers learn within a third of it that the draft is no longer wanted.
inline constexpr std::chrono::milliseconds kDraftLease(1500);

// Thread-safe.
class Drafts {
 public:
  Drafts(SessionStore& sessions, const MatteFiles& mattes, JobStore& tiles);

  // Drafts that an earlier server made can be fetched.
  void take_up();
  // Called under an Edit with each record of a session that is being captured, and when the capture has
  // ended.
  void note(const v1::Session& session);
  void forget(const std::string& session);
  // For a session without a finished matte: what its newest draft is made from.
  std::optional<v1::Draft> of(const v1::Session& session);
  // Examines a session that is being captured, as note() does.
  void look_at(const std::string& session) { to_look_at_.add(session); }
  // Why the draft of this many images failed; OK: it has not.
  absl::Status failure(const std::string& session, int image_count);

  // Like those of TileDispatcher.
  static bool is_draft(const v1::TileLease& lease) { return lease.job() < 0; }
  // Without a lease in the answer there is nothing to do.
  v1::ClaimTileResponse claim(const std::string& solver);
  absl::Status renew(const v1::TileLease& lease);
  absl::Status check(const v1::TileLease& lease);  // ABORTED: the draft is not made any more
  absl::Status complete(const v1::CompleteTileRequest& header, const absl::StatusOr<MatteOutline>& outline,
                        ReceivedMatte& matte);
  void fail(const v1::FailTileRequest& request);

 private:
  struct Running {
    std::int64_t lease_job = 0;  // in leases
    std::int64_t job = 0;        // in tiles_
    v1::Session session;
    v1::Draft draft;
    std::vector<int> steps;  // rising
    int pixel_step = 1;
    std::optional<nanoseconds> began = {};  // when the first tile was claimed
  };
  // The parts of a session that can be drafted.
  struct Plan {
    std::string capture;     // capture_name()
    int rounds = 0;          // of the plan by then
    std::vector<int> steps;  // in the order of showing
    std::vector<DraftStage> stages;
    int sweep_count = 0;
    // Of the last draft; 0: none.
    int begun = 0;  // step_count of its stage
    int pixel_step = 0;
    // The capture's pace: steps proven since then. Restarts after a break.
    nanoseconds since{}, looked{};
    int since_proven = 0;
  };

  void run(std::stop_token stop);
  // Begins a draft if the session has reached a stage and no solver is working on an earlier draft.
  absl::Status look(const std::string& name);
  absl::StatusOr<Plan*> plan_of(const v1::Session& session);
  absl::Status begin(const v1::Session& session, const DraftStage& stage, std::vector<int> steps,
                     const v1::CaptureManifest& manifest, Plan& plan);
  // Requires mutex_. Null: this draft is not in progress.
  Running* running(const v1::TileLease& lease);
  // These two require mutex_. The draft is not made any more.
  void end();
  void give_up(const std::string& error);
  absl::Status finish(const Running& done, const std::vector<TileState>& tiles);

  SessionStore& sessions_;
  const MatteFiles& mattes_;
  JobStore& tiles_;
  std::map<std::string, Plan> plans_;  // used by thread_ alone
  std::mutex mutex_;
  std::optional<Running> running_;         // guarded by mutex_
  std::map<std::string, v1::Draft> made_;  // newest, by session; guarded by mutex_
  struct Failure {
    int image_count = 0;
    absl::Status status;
  };
  std::map<std::string, Failure> failed_;  // newest, by session; guarded by mutex_
  std::int64_t last_job_ = 0;              // guarded by mutex_
  // Time that the last draft took per solved pixel and image; 0: none. Guarded by mutex_.
  double unit_seconds_ = 0.0;
  SessionQueue to_look_at_;
  std::jthread thread_;  // last: uses all of the above
};

// The pixel spacing n at which a draft is solved (one in n pixels, in one of n rows): 1, 3 or 5, the smallest
// that takes no more than a fraction of the `seconds_left` of the capture; 1 if there are few pixels.
// `unit_seconds`: time that the last draft took per pixel and image; 0: none, and the first draft should come
// soon.
int pixel_step_of(const v1::Camera& camera, int image_count, double unit_seconds, double seconds_left);

// The same for a draft that a capture waits for: the smallest odd number with which it takes a few seconds.
int pixel_step_while_waiting(const v1::Camera& camera, int image_count, double unit_seconds);

// The steps of the first `stage.step_count` of `shown` that are stored, in increasing order, if the stage is
// reached: all of them, or nearly all if the showing has moved on. (A step without proof is shown again only
// after all others.) None: not reached.
std::optional<std::vector<int>> reached(const DraftStage& stage, const std::vector<int>& shown,
                                        const v1::CaptureManifest& manifest);

}  // namespace glasswing
