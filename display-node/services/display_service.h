// DisplayService over any Display.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "core/service/joined_calls.h"
#include "display-node/backends/pulsed_display.h"
#include "display-node/display.h"
#include "display-node/playback/program.h"
#include "display-node/rail.h"
#include "glasswing/v1/display_service.grpc.pb.h"

namespace glasswing {

// A trigger line, and the display that raises it.
struct RaisedLine {
  PulsedDisplay* display = nullptr;  // null: there is no line
  std::string name;
};

class DisplayServiceImpl final : public v1::DisplayService::Service {
 public:
  // INVALID_ARGUMENT: the rows of an id patch leave too few for patterns, or are too few to be read, or
  // belong to a monitor that the display does not have.
  static absl::Status check_patch(const Display& display, const PatchRows& patch_rows);
  // `rails`: of monitors of the display, at most one each.
  DisplayServiceImpl(std::string name, Display& display, const PatchRows& patch_rows = 0,
                     std::vector<MonitorRail> rails = {}, const RaisedLine& line = {});
  // Ends a playing program and a move, so that the daemon can stop.
  void stop() { stop_.request_stop(); }

  grpc::Status GetDisplay(grpc::ServerContext*, const v1::GetDisplayRequest*,
                          v1::GetDisplayResponse*) override;
  grpc::Status PutImage(grpc::ServerContext*, grpc::ServerReader<v1::PutImageRequest>*,
                        v1::PutImageResponse*) override;
  grpc::Status LoadProgram(grpc::ServerContext*, const v1::LoadProgramRequest*,
                           v1::LoadProgramResponse*) override;
  grpc::Status PlayProgram(grpc::ServerContext*, const v1::PlayProgramRequest*,
                           grpc::ServerWriter<v1::PlayProgramResponse>*) override;
  grpc::Status MoveMonitor(grpc::ServerContext*, const v1::MoveMonitorRequest*,
                           v1::MoveMonitorResponse*) override;
  grpc::Status StopMove(grpc::ServerContext*, const v1::StopMoveRequest*, v1::StopMoveResponse*) override;

 private:
  // INVALID_ARGUMENT: not a photo with the size of one of the monitors.
  absl::Status check_fits(const std::string& png) const;
  absl::StatusOr<v1::LoadProgramResponse> load(const v1::LoadProgramRequest& request);
  absl::StatusOr<v1::MoveMonitorResponse> move(const v1::MoveMonitorRequest& request);

  const std::string name_;
  Display& display_;
  const RaisedLine line_;
  const std::vector<ScreenInfo> screens_;
  ImageStore images_;
  std::stop_source stop_;
  std::mutex mutex_;
  std::shared_ptr<const Program> loaded_;      // guarded by mutex_
  std::optional<PulsedDisplay::Pulse> pulse_;  // of it; guarded by mutex_
  std::stop_source play_;                      // guarded by mutex_, stops the playing program
  std::string moving_;                         // request id of the move; guarded by mutex_
  std::stop_source move_;                      // guarded by mutex_, stops the move
  std::string stopped_move_;                   // request id of the last; guarded by mutex_
  std::vector<MonitorRail> rails_;             // their positions are guarded by mutex_
  std::mutex playing_;                         // held while the screens are in use, or a monitor moves
  JoinedCalls<v1::PutImageResponse> puts_{0};  // by image
  JoinedCalls<v1::LoadProgramResponse> loads_;
  JoinedCalls<v1::MoveMonitorResponse> moves_;
};

}  // namespace glasswing
