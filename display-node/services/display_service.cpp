#include "display-node/services/display_service.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <thread>

#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/file/fault_point.h"
#include "core/image/photo.h"
#include "core/pattern/id_patch.h"
#include "core/service/service.h"
#include "display-node/playback/player.h"

namespace glasswing {
namespace {

std::vector<ScreenInfo> with_patch(std::vector<ScreenInfo> screens, const PatchRows& patch_rows) {
  for (ScreenInfo& screen : screens) screen.patch_rows = patch_rows.of(screen.name);
  return screens;
}

}  // namespace

absl::Status DisplayServiceImpl::check_patch(const Display& display, const PatchRows& patch_rows) {
  for (const auto& [monitor, rows] : patch_rows.of_one) {
    if (std::ranges::find(display.screens(), monitor, &ScreenInfo::name) == display.screens().end())
      return absl::InvalidArgumentError(
          fmt::format("--patch-rows names monitor \"{}\", which this display does not have", monitor));
  }
  for (const ScreenInfo& screen : display.screens()) {
    const int rows = patch_rows.of(screen.name), max_rows = screen.height_px / 2;
    if (rows == 0) continue;
    if (screen.width_px < IdPatch::kMinWidth_px || rows < IdPatch::kMinRows || rows > max_rows) {
      return absl::InvalidArgumentError(
          fmt::format("--patch-rows is {}, which does not fit monitor \"{}\", {} x {} px; it must be {} to "
                      "{} (half of the monitor), or 0, and the monitor at least {} px wide",
                      rows, screen.name, screen.width_px, screen.height_px, IdPatch::kMinRows, max_rows,
                      IdPatch::kMinWidth_px));
    }
  }
  return absl::OkStatus();
}

DisplayServiceImpl::DisplayServiceImpl(std::string name, Display& display, const PatchRows& patch_rows,
                                       std::vector<MonitorRail> rails, const RaisedLine& line)
    : name_(std::move(name)),
      display_(display),
      line_(line),
      screens_(with_patch(display.screens(), patch_rows)),
      rails_(std::move(rails)) {}

grpc::Status DisplayServiceImpl::GetDisplay(grpc::ServerContext*, const v1::GetDisplayRequest*,
                                            v1::GetDisplayResponse* response) {
  response->set_name(name_);
  response->set_backend(display_.backend());
  response->set_line(line_.name);
  for (const ScreenInfo& screen : screens_) {
    v1::DisplayMonitor& monitor = *response->add_monitors();
    monitor.set_name(screen.name);
    monitor.set_width_px(screen.width_px);
    monitor.set_height_px(pattern_size_of(screen).height_px);
    monitor.set_patch_rows(screen.patch_rows);
    monitor.set_refresh_hz(screen.refresh_hz);
    monitor.set_optical_lag_ns(screen.lag.count());
    monitor.set_settle_ns(screen.settle.count());
    monitor.set_response("linear");
    monitor.set_bits(screen.bits);
    const std::lock_guard lock(mutex_);
    const auto on = std::ranges::find(rails_, screen.name, &MonitorRail::monitor);
    if (on == rails_.end()) continue;
    monitor.mutable_rail()->set_min_mm(on->min_mm);
    monitor.mutable_rail()->set_max_mm(on->max_mm);
    if (on->position_mm) monitor.mutable_rail()->set_position_mm(*on->position_mm);
  }
  return grpc::Status::OK;
}

// Before it is decoded: a few kilobytes may unpack to any size.
absl::Status DisplayServiceImpl::check_fits(const std::string& png) const {
  GW_ASSIGN_OR_RETURN(const PictureSize size, photo_size(png));
  std::string sizes;
  for (const ScreenInfo& screen : screens_) {
    const MonitorSize pattern = pattern_size_of(screen);
    if (size.width_px == pattern.width_px && size.height_px == pattern.height_px) return absl::OkStatus();
    sizes += fmt::format("{}{} {}x{}", sizes.empty() ? "" : ", ", screen.name, pattern.width_px,
                         pattern.height_px);
  }
  return absl::InvalidArgumentError(fmt::format("the photo is {}x{}; it must have the size of a monitor: {}",
                                                size.width_px, size.height_px, sizes));
}

grpc::Status DisplayServiceImpl::PutImage(grpc::ServerContext* context,
                                          grpc::ServerReader<v1::PutImageRequest>* reader,
                                          v1::PutImageResponse* response) {
  std::string png;
  v1::PutImageRequest request;
  while (reader->Read(&request)) {
    png += request.chunk();
    if (static_cast<std::int64_t>(png.size()) > kMaxPhotoBytes) {
      return to_grpc(
          absl::InvalidArgumentError(fmt::format("the photo has more than {} bytes", kMaxPhotoBytes)));
    }
  }
  if (const absl::Status fits = check_fits(png); !fits.ok()) return to_grpc(fits);
  const auto put = [&]() -> absl::StatusOr<v1::PutImageResponse> {
    v1::PutImageResponse stored;
    GW_ASSIGN_OR_RETURN(*stored.mutable_image(), images_.add(png));
    return stored;
  };
  return answer(puts_.run(*context, checksum_of(png), put), *response);
}

grpc::Status DisplayServiceImpl::LoadProgram(grpc::ServerContext* context,
                                             const v1::LoadProgramRequest* request,
                                             v1::LoadProgramResponse* response) {
  return answer(loads_.run(*context, request->request_id(), [&] { return load(*request); }), *response);
}

absl::StatusOr<v1::LoadProgramResponse> DisplayServiceImpl::load(const v1::LoadProgramRequest& request) {
  std::optional<PulsedDisplay::Pulse> pulse;
  if (request.has_line()) {
    if (line_.display == nullptr)
      return absl::FailedPreconditionError(
          "this display has no line to trigger a camera; glasswing-display --line names one");
    if (request.line().after_ns() < 0 || request.line().slack_ns() < 0)
      return absl::InvalidArgumentError(
          fmt::format("line is after_ns {}, slack_ns {}; both must be 0 or more", request.line().after_ns(),
                      request.line().slack_ns()));
    pulse = {.after = nanoseconds(request.line().after_ns()),
             .slack = nanoseconds(request.line().slack_ns())};
  }
  GW_ASSIGN_OR_RETURN(Program program, Program::create(request, screens_, images_));
  fault_point("program drawn");
  const std::lock_guard lock(mutex_);
  play_.request_stop();
  loaded_ = std::make_shared<const Program>(std::move(program));
  pulse_ = pulse;
  return v1::LoadProgramResponse();
}

grpc::Status DisplayServiceImpl::PlayProgram(grpc::ServerContext* context,
                                             const v1::PlayProgramRequest* request,
                                             grpc::ServerWriter<v1::PlayProgramResponse>* writer) {
  if (request->step_ns() < 0) {
    return to_grpc(
        absl::InvalidArgumentError(fmt::format("step_ns is {}; it must be 0 or more", request->step_ns())));
  }
  std::shared_ptr<const Program> program;
  std::optional<PulsedDisplay::Pulse> pulse;
  std::stop_source play_stop;
  {
    const std::lock_guard lock(mutex_);
    if (loaded_ == nullptr || loaded_->name() != request->program()) {
      return to_grpc(absl::FailedPreconditionError(
          fmt::format("program \"{}\" is not loaded; load it first", request->program())));
    }
    program = loaded_;
    pulse = pulse_;
    play_.request_stop();  // two programs never share the screens
    play_ = play_stop;
  }
  const std::stop_callback on_shutdown(stop_.get_token(), [&] { play_stop.request_stop(); });
  std::mutex mutex;
  std::condition_variable reported;
  std::deque<v1::Presentation> reports;  // bounded by the program's length
  bool ended = false;
  absl::Status status;
  std::jthread player([&] {
    const std::lock_guard screens(playing_);
    if (line_.display != nullptr) line_.display->arm(pulse);
    absl::Status result = play(
        *program, display_, nanoseconds(request->start_at_ns()), nanoseconds(request->step_ns()),
        play_stop.get_token(),
        [&](const v1::Presentation& presentation) {
          const std::lock_guard lock(mutex);
          reports.push_back(presentation);
          reported.notify_one();
        },
        request->hold_last());
    const std::lock_guard lock(mutex);
    status = std::move(result);
    ended = true;
    reported.notify_one();
  });
  while (true) {
    std::deque<v1::Presentation> batch;
    {
      std::unique_lock lock(mutex);
      reported.wait_for(lock, std::chrono::milliseconds(10), [&] { return ended || !reports.empty(); });
      batch.swap(reports);
      if (batch.empty() && ended) break;
    }
    for (v1::Presentation& presentation : batch) {
      v1::PlayProgramResponse response;
      *response.mutable_presentation() = std::move(presentation);
      if (!writer->Write(response)) play_stop.request_stop();
    }
    if (context->IsCancelled()) play_stop.request_stop();
  }
  player.join();
  if (absl::IsCancelled(status) && !context->IsCancelled()) status = absl::AbortedError(status.message());
  spdlog::info("played name={} steps={} end=\"{}\"", program->name(), program->size(), status.ToString());
  return to_grpc(status);
}

grpc::Status DisplayServiceImpl::MoveMonitor(grpc::ServerContext* context,
                                             const v1::MoveMonitorRequest* request,
                                             v1::MoveMonitorResponse* response) {
  return answer(moves_.run(*context, request->request_id(), [&] { return move(*request); }), *response);
}

grpc::Status DisplayServiceImpl::StopMove(grpc::ServerContext*, const v1::StopMoveRequest* request,
                                          v1::StopMoveResponse*) {
  const std::lock_guard lock(mutex_);
  stopped_move_ = request->request_id();
  if (moving_ == stopped_move_) move_.request_stop();
  return grpc::Status::OK;
}

absl::StatusOr<v1::MoveMonitorResponse> DisplayServiceImpl::move(const v1::MoveMonitorRequest& request) {
  const std::string& monitor = request.monitor();
  const double position_mm = request.position_mm();
  if (std::ranges::find(screens_, monitor, &ScreenInfo::name) == screens_.end()) {
    std::vector<std::string> names;
    for (const ScreenInfo& screen : screens_) names.push_back(screen.name);
    return absl::InvalidArgumentError(
        fmt::format("there is no monitor \"{}\"; there are: {}", monitor, fmt::join(names, ", ")));
  }
  const auto on = std::ranges::find(rails_, monitor, &MonitorRail::monitor);
  if (on == rails_.end()) {
    return absl::FailedPreconditionError(
        fmt::format("monitor \"{}\" has no rail to move it; glasswing-display --rail names one", monitor));
  }
  if (!(position_mm >= on->min_mm && position_mm <= on->max_mm)) {
    return absl::InvalidArgumentError(
        fmt::format("position_mm is {}; the rail of monitor \"{}\" goes from {} to {}", position_mm, monitor,
                    on->min_mm, on->max_mm));
  }
  const std::unique_lock screens(playing_, std::try_to_lock);
  if (!screens.owns_lock()) {
    return absl::FailedPreconditionError(
        "the display is playing a program or moving a monitor; wait until that has ended");
  }
  std::stop_source stop;
  {
    const std::lock_guard lock(mutex_);
    if (!request.request_id().empty() && request.request_id() == stopped_move_)
      return absl::FailedPreconditionError("the move was stopped before it began");
    moving_ = request.request_id();
    move_ = stop;
  }
  const std::stop_callback on_shutdown(stop_.get_token(), [&] { stop.request_stop(); });
  const absl::Status moved = on->rail->move(position_mm, stop.get_token());
  spdlog::info("moved monitor={} position_mm={} end=\"{}\"", monitor, position_mm, moved.ToString());
  const std::lock_guard lock(mutex_);
  moving_.clear();
  on->position_mm = moved.ok() ? std::optional(position_mm) : std::nullopt;
  GW_RETURN_IF_ERROR(moved);
  v1::MoveMonitorResponse response;
  response.set_position_mm(position_mm);
  return response;
}

}  // namespace glasswing
