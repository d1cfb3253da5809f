// The sessions of one rig: who may capture now, how far each one came, and what wakes those who watch.
//
//   created -> capturing <-> paused;  capturing -> captured -> solving -> done;  any -> failed or cancelled
//   solving <-> paused;  failed -> capturing or solving (tried again);  done -> solving (anew; cancelled:
//   done as before)
//
// Every change is in the catalogue before anybody hears of it. After a restart a session that was capturing
// is paused (its proven frames are with the camera node), one that was solving goes on.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <condition_variable>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "core/storage/matte_files.h"
#include "glasswing/v1/work_service.pb.h"
#include "server/capture/capture.h"
#include "server/jobs/job_store.h"
#include "server/rig/node_registry.h"
#include "server/rig/rig_lock.h"
#include "server/sessions/catalogue.h"
#include "server/solve/fleet.h"
#include "server/solve/frame_mattes.h"
#include "server/solve/single_flight.h"
#include "server/solve/tile_sizes.h"

namespace glasswing {

struct ServerOptions {
  std::filesystem::path data;
  std::string jobs = {};     // connection string of a PostgreSQL; empty: SQLite below `data`
  std::string address = {};  // where solvers of other servers reach this one; empty: there are none
  std::chrono::milliseconds lease{10000};
  double min_tile_seconds = kMinTileSeconds;  // of work that tiles of rows are cut to
};

// Thread-safe. Errors are those that session_service.proto and work_service.proto list.
class Server {
 public:
  // Opens the catalogue and the job store; UNAVAILABLE or DATA_LOSS name what cannot be opened.
  static absl::StatusOr<std::unique_ptr<Server>> open(const ServerOptions& options);
  ~Server();  // a running capture is paused

  NodeRegistry& rig() { return rig_; }
  CalibrationStore& calibrations() { return *calibrations_; }

  RigLock& rig_lock() { return rig_lock_; }

  absl::StatusOr<v1::Session> create(const v1::CreateSessionRequest& request, const Caller& caller);
  absl::StatusOr<v1::EstimateSessionResponse> estimate(const v1::EstimateSessionRequest& request);
  absl::StatusOr<v1::Session> begin_import(const v1::BeginImportRequest& request, const Caller& caller);
  absl::StatusOr<v1::Session> finish_import(const std::string& name);
  absl::StatusOr<std::string> store_image(const std::string& png);
  absl::StatusOr<v1::Session> find(const std::string& name);
  absl::StatusOr<std::vector<v1::Session>> list(const v1::ListSessionsRequest& request);
  absl::StatusOr<v1::Session> annotate(const v1::AnnotateSessionRequest& request);
  absl::StatusOr<v1::Session> pause(const std::string& name, const Caller& caller);
  absl::StatusOr<v1::Session> resume(const v1::ResumeSessionRequest& request, const Caller& caller);
  absl::StatusOr<v1::Session> cancel(const std::string& name, const Caller& caller);
  // Bytes freed.
  absl::StatusOr<std::int64_t> remove(const std::string& name);
  // `tell` hears how far it came; false: nobody listens any more. It ends when `is_wanted` says no, which is
  // asked now and then. What was copied until then stays.
  absl::Status replicate(const v1::ReplicateSessionRequest& request,
                         const std::function<bool(const v1::ReplicateSessionResponse&)>& tell,
                         const std::function<bool()>& is_wanted);
  absl::StatusOr<v1::Session> solve(const v1::SolveSessionRequest& request);
  // Path of the last finished solve's matte, or of that of a video's frame. It may be gone by the time it is
  // read: then ask again.
  absl::StatusOr<std::filesystem::path> matte(const std::string& name, std::optional<int> frame);
  // What there is so far of a solve that goes on or broke off, as a matte's file; of one that finished, its
  // matte. FAILED_PRECONDITION: nothing yet.
  absl::StatusOr<std::string> partial_matte(const std::string& name);

  // What became of the steps of a session's capture, from the `first` event on.
  absl::StatusOr<std::vector<v1::StepEvent>> steps(const std::string& name, size_t first);

  // Waits for any session to change after `seen` (0: none yet), at most `timeout`; returns the number of the
  // last change.
  std::int64_t wait_change(std::int64_t seen, std::chrono::milliseconds timeout);

  absl::StatusOr<v1::ClaimTileResponse> claim(const v1::ClaimTileRequest& request);
  // A hint that claim() may have something now; returns after `timeout` at the latest.
  void wait_for_tiles(std::chrono::milliseconds timeout) { jobs_->wait_for_tiles(timeout); }
  absl::Status keep(const v1::TileLease& lease);
  absl::Status complete_survey(const v1::CompleteSurveyRequest& request);
  // Where the files of a video's tile go as they come; none for a tile of rows.
  absl::StatusOr<std::optional<FrameMattes>> frames_of(const v1::TileLease& lease);
  // `matte` is the tile's file, whole.
  absl::Status complete(const v1::CompleteTileRequest& header, const std::string& matte);
  absl::Status complete(const v1::CompleteTileRequest& header, FrameMattes mattes);
  absl::Status fail(const v1::FailTileRequest& request);
  absl::StatusOr<v1::GetFleetResponse> fleet();

 private:
  enum class Wish { kNone, kPause, kCancel };

  explicit Server(std::filesystem::path data) : data_(std::move(data)), mattes_(data_) {}

  // Those below are called with mutex_ held.
  absl::Status take_up(v1::Session session);                            // as an earlier server left it
  absl::Status drop_orphans(const std::vector<v1::Session>& sessions);  // jobs that no session knows of
  absl::Status change(const v1::Session& session);                      // durable, then announced
  void announce();
  absl::StatusOr<v1::Session> find_locked(const std::string& name);
  absl::Status check_stays(const std::string& name) const;  // it is not being deleted
  absl::StatusOr<RigLock::Drive> drive_for(const std::string& session, const Caller& caller);
  void start_capture(const v1::Session& session, RigLock::Drive drive);
  void start_solve_clock(const v1::Session& session);
  absl::StatusOr<v1::Session> pause_solve(v1::Session session);
  absl::StatusOr<v1::Session> resume_solve(v1::Session session);
  // `reason`: why nothing came of the solve.
  absl::StatusOr<v1::Session> cancel_solve(v1::Session session, const std::string& reason);
  // The session that this lease is of. ABORTED: it is not being solved, or in another job by now.
  absl::StatusOr<v1::Session> session_of(const v1::TileLease& lease);
  void look_whether_finished(const std::string& name);  // as soon as the job store answers
  absl::Status settle(v1::Session session, absl::Status made);
  // Of a solve: says so until something of it could be written again.
  void wait_for_room(v1::Session session, const absl::Status& full);

  // Those below are called without mutex_.
  // Counts the tiles; once none is left, the solve is finished by a thread of its own. A large job takes some
  // time to count: solvers that hand in at once are served by one count.
  void note_progress(const v1::TileLease& lease);
  absl::Status count_progress(const v1::TileLease& lease);
  absl::Status check_new_name(const std::string& name);
  absl::Status complete_frames(const v1::CompleteTileRequest& header, FrameMattes& mattes);
  absl::Status done(const v1::CompleteTileRequest& header, const TileAttempt& attempt,
                    const std::string& result);
  void finish_solves(std::stop_token stop);
  // UNAVAILABLE: the job store is away; not yet.
  absl::Status finish_solve(const std::string& name);
  absl::StatusOr<std::int64_t> remove_all_of(v1::Session session);
  absl::Status check_archives_answer(const v1::Session& session);
  absl::StatusOr<std::int64_t> remove_replicas(const v1::Session& session);
  absl::Status replicate_to(const v1::Session& session, const std::string& node,
                            const std::function<bool(const v1::ReplicateSessionResponse&)>& tell,
                            const std::function<bool()>& is_wanted);
  // Stops the session's capture and waits until it rests.
  absl::StatusOr<v1::Session> end_capture(const std::string& name, Wish wish);
  void capture_until_done(v1::Session session, std::optional<bool> object_confirmed, std::stop_token stop);
  void note_outcome(v1::Session session, const CaptureOutcome& outcome);
  void join_capture();

  const std::filesystem::path data_;
  const MatteFiles mattes_;
  std::chrono::milliseconds lease_{};
  double min_tile_seconds_ = kMinTileSeconds;
  NodeRegistry rig_;
  RigLock rig_lock_;
  std::unique_ptr<CalibrationStore> calibrations_;
  std::unique_ptr<Catalogue> catalogue_;
  std::unique_ptr<JobStore> jobs_;
  Fleet fleet_;
  StepLog steps_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::int64_t change_count_ = 0;
  std::map<std::string, nanoseconds> solve_began_;
  std::map<std::string, std::shared_ptr<SingleFlight>> counting_;  // by session
  std::map<std::string, v1::Session> live_;     // counts of the running capture, ahead of the catalogue
  std::map<std::string, bool> operator_asked_;  // sessions that wait for a person: where the object is to be
  std::set<std::string> going_;                 // sessions that are being deleted
  std::multiset<std::string> replicating_;      // sessions that are being copied
  std::string capturing_;                       // the session that drives the rig
  RigLock::Drive drive_;                        // meanwhile
  Wish wish_ = Wish::kNone;
  std::jthread capture_thread_;
  std::set<std::string> to_finish_;  // sessions whose tiles may all be done, or given up
  std::condition_variable_any finish_wanted_;
  std::jthread finish_thread_;
};

}  // namespace glasswing
