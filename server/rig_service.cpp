#include "server/rig_service.h"

#include <spdlog/spdlog.h>

#include <condition_variable>

#include "core/base/status.h"
#include "core/service/service.h"
#include "server/rig_check.h"
#include "server/sync_calibration.h"

namespace glasswing {

grpc::Status RigServiceImpl::run(grpc::ServerContext* context, const std::string& what,
                                 const std::function<absl::Status(std::stop_token)>& work) {
  const absl::StatusOr<Server::RigHold> hold = server_.hold_rig(what);
  if (!hold.ok()) return to_grpc(hold.status());
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
  return run(context, "glasswing calibrate sync", [&](std::stop_token stop) -> absl::Status {
    GW_ASSIGN_OR_RETURN(RigLinks rig, connect(server_.rig(), server_.sync()));
    std::vector<std::string> monitors(request->monitors().begin(), request->monitors().end());
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
    absl::Status unmeasured;  // the first that could not be; the others are measured all the same
    for (const std::string& monitor : monitors) {
      const absl::StatusOr<v1::MonitorSync> measured =
          measure_sync(rig, monitor, request->exposure_ms(), nullptr, progress, stop);
      if (absl::IsFailedPrecondition(measured.status())) {
        unmeasured.Update(measured.status());
        continue;
      }
      GW_ASSIGN_OR_RETURN(const v1::MonitorSync sync, measured);
      GW_RETURN_IF_ERROR(server_.sync().put(sync));
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
  return run(context, "glasswing doctor", [&](std::stop_token stop) {
    return check_rig(
        server_.rig(), server_.sync(), request->plan(),
        [&](const v1::Finding& finding) {
          v1::CheckRigResponse response;
          *response.mutable_finding() = finding;
          writer->Write(response);
        },
        stop);
  });
}

}  // namespace glasswing
