// The sessions of one rig: who may capture now, how far each one came, and what wakes those who watch.
//
//   created -> capturing <-> paused;  capturing -> captured -> solving -> done;  any -> failed or cancelled
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
#include <string>
#include <thread>
#include <vector>

#include "glasswing/v1/work_service.pb.h"
#include "server/capture.h"
#include "server/catalogue.h"
#include "server/frame_mattes.h"
#include "server/job_store.h"
#include "server/rig.h"

namespace glasswing {

// Thread-safe. Errors are those that session_service.proto and work_service.proto list.
class Server {
 public:
  // Opens the catalogue below `data`; UNAVAILABLE or DATA_LOSS name what cannot be opened.
  static absl::StatusOr<std::unique_ptr<Server>> open(const std::filesystem::path& data);
  ~Server();  // a running capture is paused

  Rig& rig() { return rig_; }
  CalibrationStore& calibrations() { return *calibrations_; }

  // The rig, for one measurement: nobody captures, or measures, until the hold is gone. `what` names it in
  // others' errors. FAILED_PRECONDITION names who has the rig.
  struct Release {
    void operator()(Server* server) const;
  };
  using RigHold = std::unique_ptr<Server, Release>;
  absl::StatusOr<RigHold> hold_rig(const std::string& what);

  absl::StatusOr<v1::Session> create(const v1::CreateSessionRequest& request);
  absl::StatusOr<v1::Session> begin_import(const v1::BeginImportRequest& request);
  absl::StatusOr<v1::Session> finish_import(const std::string& name);
  absl::StatusOr<std::string> store_image(const std::string& png);
  absl::StatusOr<v1::Session> find(const std::string& name);
  absl::StatusOr<std::vector<v1::Session>> list();
  absl::StatusOr<v1::Session> pause(const std::string& name);
  absl::StatusOr<v1::Session> resume(const std::string& name);
  absl::StatusOr<v1::Session> cancel(const std::string& name);
  absl::StatusOr<v1::Session> solve(const v1::SolveSessionRequest& request);
  // Path of the finished matte, or of that of a video's frame.
  absl::StatusOr<std::filesystem::path> matte(const std::string& name, std::optional<int> frame);

  // Waits for any session to change after `seen` (0: none yet), at most `timeout`; returns the number of the
  // last change.
  std::int64_t wait_change(std::int64_t seen, std::chrono::milliseconds timeout);

  absl::StatusOr<v1::ClaimTileResponse> claim(const v1::ClaimTileRequest& request);
  absl::Status keep(const v1::TileLease& lease);
  // Where the files of a video's tile go as they come; none for a tile of rows.
  absl::StatusOr<std::optional<FrameMattes>> frames_of(const v1::TileLease& lease);
  // `matte` is the tile's file, whole.
  absl::Status complete(const v1::CompleteTileRequest& header, const std::string& matte);
  absl::Status complete(const v1::CompleteTileRequest& header, FrameMattes mattes);
  absl::Status fail(const v1::FailTileRequest& request);

 private:
  explicit Server(std::filesystem::path data) : data_(std::move(data)) {}

  // Those below are called with mutex_ held.
  absl::Status change(const v1::Session& session);  // durable, then announced
  void announce();
  absl::Status check_rig_is_free() const;
  void start_capture(const v1::Session& session);
  // Notes that the tile is done. Before, if this is news, `place` puts what came to where it is read.
  absl::Status accept(const v1::CompleteTileRequest& header, const std::string& result,
                      const std::function<absl::Status(const v1::Session&, const Tile&)>& place);
  absl::Status assemble_rows(v1::Session& session);
  absl::Status finish_solve(v1::Session session);

  void capture_until_done(v1::Session session, std::optional<bool> object_confirmed, std::stop_token stop);
  void join_capture();  // without mutex_
  std::filesystem::path matte_path(const v1::Session& session, int frame) const;
  absl::StatusOr<std::filesystem::path> frame_matte(const v1::Session& session, int frame) const;

  const std::filesystem::path data_;
  Rig rig_;
  std::unique_ptr<CalibrationStore> calibrations_;
  std::unique_ptr<Catalogue> catalogue_;
  std::unique_ptr<JobStore> jobs_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::int64_t change_count_ = 0;
  std::map<std::string, nanoseconds> solve_began_;
  std::map<std::string, v1::Session> live_;     // counts of the running capture, ahead of the catalogue
  std::map<std::string, bool> operator_asked_;  // sessions that wait for a person: where the object is to be
  std::string capturing_;                       // the session that holds the rig
  std::string measuring_;                       // the measurement that holds it instead
  enum class Wish { kNone, kPause, kCancel } wish_ = Wish::kNone;
  std::jthread capture_thread_;
};

}  // namespace glasswing
