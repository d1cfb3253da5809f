#include "server/services/rig_service.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <condition_variable>

#include "core/base/status.h"
#include "core/base/time.h"
#include "core/service/message_limits.h"
#include "core/service/service.h"
#include "glasswing/v1/calibration_service.grpc.pb.h"
#include "server/rig/caller.h"
#include "server/rig/embed_calibrations.h"
#include "server/rig/plan_for_rig.h"
#include "server/rig/stage_axes.h"
#include "server/selftest/ramp_show.h"
#include "server/selftest/rig_check.h"
#include "server/selftest/rig_findings.h"
#include "server/selftest/sync_calibration.h"
#include "server/services/pages.h"

namespace glasswing {

namespace {

constexpr int kMaxLinger_s = 60;

std::optional<v1::Finding> judge_sessions(Server& server) {
  v1::ListSessionsRequest damaged;
  damaged.add_states(v1::SESSION_STATE_DAMAGED);
  const absl::StatusOr<std::vector<v1::Session>> found = server.list(damaged);
  if (!found.ok())
    return make_finding(v1::FINDING_LEVEL_WARNING, "server", std::string(found.status().message()));
  if (found->empty()) return std::nullopt;
  return make_finding(v1::FINDING_LEVEL_WARNING, "server",
                      fmt::format("the records of {} sessions are damaged", found->size()),
                      "glasswing sessions --state damaged says what to do");
}

// Of the newest capture.
std::optional<v1::Finding> judge_last_capture(Server& server) {
  const absl::StatusOr<std::vector<v1::Session>> sessions = server.list({});
  if (!sessions.ok()) return std::nullopt;
  const v1::Session* newest = nullptr;
  for (const v1::Session& session : *sessions) {
    if (session.frames_taken() > 0 && (newest == nullptr || newest->created() < session.created()))
      newest = &session;
  }
  return newest == nullptr ? std::nullopt : judge_retakes(*newest);
}

}  // namespace

grpc::Status RigServiceImpl::run(grpc::ServerContext* context, const std::string& what,
                                 const std::function<absl::Status(std::stop_token)>& work) {
  const absl::StatusOr<RigLock::Drive> drive = server_.rig_lock().drive(caller_of(*context), what);
  if (!drive.ok()) return to_grpc(drive.status());
  std::mutex mutex;
  std::condition_variable ended;
  std::optional<absl::Status> result;  // guarded by mutex
  std::jthread worker([&](std::stop_token stop) {
    absl::Status status = work(stop);
    const std::lock_guard lock(mutex);
    result = std::move(status);
    ended.notify_all();
  });
  std::unique_lock lock(mutex);
  while (!ended.wait_for(lock, std::chrono::milliseconds(50), [&] { return result.has_value(); })) {
    if (context->IsCancelled() || stopping_) worker.request_stop();
  }
  if (stopping_ && absl::IsCancelled(*result))
    return to_grpc(absl::UnavailableError("the server is stopping"));
  return to_grpc(*result);
}

grpc::Status RigServiceImpl::CalibrateSync(grpc::ServerContext* context,
                                           const v1::CalibrateSyncRequest* request,
                                           grpc::ServerWriter<v1::CalibrateSyncResponse>* writer) {
  GW_CHECK_LIMITS(*request);
  return run(context, "calibrate sync", [&](std::stop_token stop) -> absl::Status {
    MonitorNames monitors(request->monitors().begin(), request->monitors().end());
    GW_ASSIGN_OR_RETURN(RigLinks rig,
                        connect(server_.rig(), server_.calibrations(), request->camera(), monitors));
    if (monitors.empty()) {
      for (const auto& display : rig.displays) {
        for (const v1::DisplayMonitor& monitor : display->info.monitors()) monitors.push_back(monitor.name());
      }
    }
    const auto progress = [&](const std::string& words) {
      v1::CalibrateSyncResponse response;
      response.set_progress(words);
      writer->Write(response);
    };
    const std::optional<v1::CameraCalibration> camera =
        server_.calibrations().camera(rig.camera_info.camera().name());
    absl::Status unmeasured;  // the first error; the other monitors are measured all the same
    for (const std::string& monitor : monitors) {
      const absl::StatusOr<v1::MonitorSync> measured =
          measure_sync(rig, monitor, request->exposure_ms(), camera ? &*camera : nullptr, progress, stop);
      if (absl::IsFailedPrecondition(measured.status())) {
        unmeasured.Update(measured.status());
        continue;
      }
      GW_ASSIGN_OR_RETURN(const v1::MonitorSync sync, measured);
      GW_RETURN_IF_ERROR(server_.calibrations().put(sync));
      spdlog::info("calibrated monitor={} lag_ms={:.3f} settle_ms={:.3f} error_ms={:.3f}", monitor,
                   1e-6 * static_cast<double>(sync.lag_ns()), 1e-6 * static_cast<double>(sync.settle_ns()),
                   1e-6 * static_cast<double>(sync.error_ns()));
      v1::CalibrateSyncResponse response;
      *response.mutable_result() = sync;
      writer->Write(response);
    }
    return unmeasured;
  });
}

grpc::Status RigServiceImpl::CheckRig(grpc::ServerContext* context, const v1::CheckRigRequest* request,
                                      grpc::ServerWriter<v1::CheckRigResponse>* writer) {
  GW_CHECK_LIMITS(*request);
  const auto report = [&](const v1::Finding& finding) {
    v1::CheckRigResponse response;
    *response.mutable_finding() = finding;
    writer->Write(response);
  };
  // First, and also if the rig cannot be checked.
  for (const std::string& problem : server_.problems().all())
    report(make_finding(v1::FINDING_LEVEL_WARNING, "server", problem));
  if (const auto damaged = judge_sessions(server_)) report(*damaged);
  if (const auto retakes = judge_last_capture(server_)) report(*retakes);
  return run(context, "doctor", [&](std::stop_token stop) {
    return check_rig(server_.rig(), server_.calibrations(), request->plan(), report, stop);
  });
}

grpc::Status RigServiceImpl::ShowRamp(grpc::ServerContext* context, RampStream* stream) {
  v1::ShowRampRequest request;
  if (!stream->Read(&request)) return grpc::Status::OK;
  GW_CHECK_LIMITS(request);
  return run(context, "live", [&](std::stop_token stop) -> absl::Status {
    GW_ASSIGN_OR_RETURN(const std::unique_ptr<RampShow> show,
                        RampShow::start(server_.rig(), server_.calibrations(), request, stop));
    bool object = false;
    do {
      if (stop.stop_requested()) return absl::CancelledError("stopped");
      GW_RETURN_IF_ERROR(show->check());
      if (request.object() != object) GW_RETURN_IF_ERROR(show->move_object(request.object()));
      object = request.object();
    } while (stream->Write(show->description()) && stream->Read(&request));
    return absl::OkStatus();
  });
}

grpc::Status RigServiceImpl::ShowPattern(grpc::ServerContext* context, const v1::ShowPatternRequest* request,
                                         grpc::ServerWriter<v1::ShowPatternResponse>* writer) {
  GW_CHECK_LIMITS(*request);
  return run(context, "pattern " + request->pattern(), [&](std::stop_token stop) -> absl::Status {
    const MonitorNames wanted(request->monitors().begin(), request->monitors().end());
    GW_ASSIGN_OR_RETURN(const RigLinks rig, connect_displays(server_.rig(), server_.calibrations(), wanted));
    GW_ASSIGN_OR_RETURN(std::vector<v1::Monitor> monitors, rig.monitors());
    GW_RETURN_IF_ERROR(check_monitors(wanted, monitors));
    std::erase_if(monitors, [&](const v1::Monitor& monitor) {
      return !wanted.empty() && std::ranges::count(wanted, monitor.name()) == 0;
    });
    GW_ASSIGN_OR_RETURN(const std::vector<v1::Stimulus> pattern, test_pattern(request->pattern(), monitors));
    v1::CaptureManifest header;  // for its calibrations
    v1::ShowPatternResponse response;
    for (const v1::Monitor& monitor : monitors) {
      *header.add_monitors() = monitor;
      response.add_monitors(monitor.name());
    }
    GW_RETURN_IF_ERROR(embed_calibrations(server_.calibrations(), header));
    GW_ASSIGN_OR_RETURN(const auto showing,
                        StaticPattern::start(rig, pattern, header.display_calibrations(), stop));
    writer->Write(response);
    while (!stop.stop_requested()) {
      GW_RETURN_IF_ERROR(showing->check());
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    return absl::CancelledError("stopped");
  });
}

grpc::Status RigServiceImpl::HoldRig(grpc::ServerContext* context, const v1::HoldRigRequest* request,
                                     grpc::ServerWriter<v1::HoldRigResponse>* writer) {
  GW_CHECK_LIMITS(*request);
  if (request->reason().empty()) return to_grpc(absl::InvalidArgumentError("the reason is empty"));
  const Caller caller = caller_of(*context);
  if (request->linger_s() < 0 || request->linger_s() > kMaxLinger_s) {
    return to_grpc(absl::InvalidArgumentError(
        fmt::format("linger_s is {}; it must be 0 to {}", request->linger_s(), kMaxLinger_s)));
  }
  RigLock& lock = server_.rig_lock();
  const absl::StatusOr<RigLock::Hold> hold =
      lock.hold(caller, request->reason(), std::chrono::seconds(request->linger_s()));
  if (!hold.ok()) return to_grpc(hold.status());
  spdlog::info("the rig is held client=\"{}\" reason=\"{}\"", caller.client, request->reason());
  v1::HoldRigResponse response;
  const Caller holding{.client = caller.client, .hold = hold->get_deleter().token};
  response.set_token(holding.hold);
  writer->Write(response);
  while (!context->IsCancelled() && !stopping_ && lock.check(holding).ok())
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  spdlog::info("the rig's hold lost a call client=\"{}\"", caller.client);
  return stopping_ ? to_grpc(absl::UnavailableError("the server is stopping")) : grpc::Status::OK;
}

grpc::Status RigServiceImpl::MakePlan(grpc::ServerContext*, const v1::MakePlanRequest* request,
                                      v1::MakePlanResponse* response) {
  GW_CHECK_LIMITS(*request);
  absl::StatusOr<v1::MakePlanResponse> made = [&]() -> absl::StatusOr<v1::MakePlanResponse> {
    GW_ASSIGN_OR_RETURN(const RigLinks rig,
                        connect(server_.rig(), server_.calibrations(), request->camera(),
                                {request->monitors().begin(), request->monitors().end()}));
    return plan_for_rig(*request, rig, server_.calibrations());
  }();
  if (!made.ok()) return to_grpc(made.status());
  *response = *std::move(made);
  return grpc::Status::OK;
}

grpc::Status RigServiceImpl::ReleaseRig(grpc::ServerContext* context, const v1::ReleaseRigRequest*,
                                        v1::ReleaseRigResponse*) {
  const Caller caller = caller_of(*context);
  if (const absl::Status status = server_.rig_lock().release(caller); !status.ok()) return to_grpc(status);
  spdlog::info("the rig is released client=\"{}\"", caller.client);
  return grpc::Status::OK;
}

grpc::Status RigServiceImpl::PlaceMonitor(grpc::ServerContext* context,
                                          const v1::PlaceMonitorRequest* request,
                                          v1::PlaceMonitorResponse* response) {
  GW_CHECK_LIMITS(*request);
  return run(context, "moving monitor " + request->monitor(), [&](std::stop_token stop) -> absl::Status {
    const MonitorNames wanted{request->monitor()};
    GW_ASSIGN_OR_RETURN(const RigLinks rig, connect_displays(server_.rig(), server_.calibrations(), wanted));
    GW_ASSIGN_OR_RETURN(const std::vector<v1::Monitor> monitors, rig.monitors());
    GW_RETURN_IF_ERROR(check_monitors(wanted, monitors));
    for (const auto& display : rig.displays) {
      if (display->monitor(request->monitor()) == nullptr) continue;
      GW_ASSIGN_OR_RETURN(const double position_mm,
                          display->move_monitor(request->monitor(), request->position_mm(), stop));
      response->set_position_mm(position_mm);
    }
    return absl::OkStatus();
  });
}

grpc::Status RigServiceImpl::PlaceObject(grpc::ServerContext* context, const v1::PlaceObjectRequest* request,
                                         v1::PlaceObjectResponse* response) {
  GW_CHECK_LIMITS(*request);
  return run(context, "moving the stage", [&](std::stop_token stop) -> absl::Status {
    GW_ASSIGN_OR_RETURN(const v1::Node node, server_.rig().camera(request->camera()));
    NodeLink camera(node);
    v1::MoveAxesRequest move;
    *move.mutable_home() = request->home();
    *move.mutable_positions() = request->positions();
    GW_ASSIGN_OR_RETURN(v1::MoveAxesResponse moved, move_axes(camera, std::move(move), stop));
    *response->mutable_axes() = std::move(*moved.mutable_axes());
    return absl::OkStatus();
  });
}

// Not by run(): it must work whoever drives the rig.
grpc::Status RigServiceImpl::StopObject(grpc::ServerContext*, const v1::StopObjectRequest* request,
                                        v1::StopObjectResponse*) {
  GW_CHECK_LIMITS(*request);
  const absl::StatusOr<v1::Node> node = server_.rig().camera(request->camera());
  if (!node.ok()) return to_grpc(node.status());
  return to_grpc(stop_axes(NodeLink(*node)));
}

namespace {

// Fits a calibration to the session's frames at the camera node that holds them.
absl::StatusOr<v1::FitCalibrationResponse> fit(const v1::Session& session) {
  const auto node = v1::CalibrationService::NewStub(dial(session.archive_address(), kArchiveKeepers));
  const std::string peer = "camera node at " + session.archive_address();
  grpc::ClientContext context;
  set_deadline(context, std::chrono::minutes(10));
  v1::FitCalibrationResponse fitted;
  if (session.plan().calibration().of() == "camera") {
    v1::FitCameraRequest request;
    request.set_session(session.name());
    v1::FitCameraResponse response;
    GW_RETURN_IF_ERROR(from_grpc(node->FitCamera(&context, request, &response), peer));
    *fitted.mutable_camera() = std::move(*response.mutable_calibration());
  } else {
    v1::FitDisplaysRequest request;
    request.set_session(session.name());
    v1::FitDisplaysResponse response;
    GW_RETURN_IF_ERROR(from_grpc(node->FitDisplays(&context, request, &response), peer));
    *fitted.mutable_displays() = std::move(*response.mutable_calibrations());
    *fitted.mutable_unmeasured() = std::move(*response.mutable_unmeasured());
  }
  return fitted;
}

absl::StatusOr<v1::FitCalibrationResponse> fit_and_store(Server& server, const std::string& name) {
  GW_ASSIGN_OR_RETURN(const v1::Session session, server.sessions().find(name));
  if (!session.plan().has_calibration()) {
    return absl::FailedPreconditionError(
        fmt::format("session \"{}\" is not a calibration: its method is {}; run one with glasswing calibrate",
                    name, session.method()));
  }
  if (session.state() != v1::SESSION_STATE_CAPTURED) {
    return absl::FailedPreconditionError(fmt::format(
        "session \"{}\" is not completely captured; resume it with: glasswing resume {}", name, name));
  }
  GW_ASSIGN_OR_RETURN(v1::FitCalibrationResponse fitted, fit(session));
  if (fitted.has_camera()) {
    GW_RETURN_IF_ERROR(server.calibrations().put(fitted.camera()));
    spdlog::info("calibrated camera={} session={}", fitted.camera().camera(), name);
  }
  for (const v1::DisplayCalibration& display : fitted.displays()) {
    GW_RETURN_IF_ERROR(server.calibrations().put(display));
    spdlog::info("calibrated monitor={} session={}", display.monitor(), name);
  }
  return fitted;
}

}  // namespace

absl::StatusOr<v1::FitCalibrationResponse> RigServiceImpl::fit_once(const std::string& session) {
  {
    const std::lock_guard lock(mutex_);
    const auto [running, is_first] = fits_.emplace(session, utc_now_rfc3339());
    if (!is_first) {
      return absl::FailedPreconditionError(
          fmt::format("session \"{}\" is already being fitted, since {}; wait until that is done", session,
                      running->second));
    }
  }
  absl::StatusOr<v1::FitCalibrationResponse> fitted = fit_and_store(server_, session);
  const std::lock_guard lock(mutex_);
  fits_.erase(session);
  return fitted;
}

grpc::Status RigServiceImpl::FitCalibration(grpc::ServerContext*, const v1::FitCalibrationRequest* request,
                                            v1::FitCalibrationResponse* response) {
  GW_CHECK_LIMITS(*request);
  absl::StatusOr<v1::FitCalibrationResponse> fitted = fit_once(request->session());
  if (!fitted.ok()) return to_grpc(fitted.status());
  *response = *std::move(fitted);
  return grpc::Status::OK;
}

grpc::Status RigServiceImpl::ListCalibrations(grpc::ServerContext*,
                                              const v1::ListCalibrationsRequest* request,
                                              v1::ListCalibrationsResponse* response) {
  GW_CHECK_LIMITS(*request);
  absl::StatusOr<Page> page = Page::of(*request);
  if (!page.ok()) return to_grpc(page.status());
  const CalibrationStore& store = server_.calibrations();
  for (v1::CameraCalibration& camera : store.cameras()) *response->add_cameras() = std::move(camera);
  for (v1::DisplayCalibration& display : store.displays()) *response->add_displays() = std::move(display);
  *response->mutable_sync() = store.all_sync();
  page->cut(*response->mutable_cameras());
  page->cut(*response->mutable_displays());
  response->set_next_page_token(page->next_token());
  const std::lock_guard lock(mutex_);
  for (const auto& [session, since] : fits_) {
    v1::RunningFit& running = *response->add_fits();
    running.set_session(session);
    running.set_since(since);
  }
  return grpc::Status::OK;
}

grpc::Status RigServiceImpl::ForgetCalibration(grpc::ServerContext*,
                                               const v1::ForgetCalibrationRequest* request,
                                               v1::ForgetCalibrationResponse*) {
  GW_CHECK_LIMITS(*request);
  return to_grpc(server_.calibrations().forget(request->device()));
}

}  // namespace glasswing
