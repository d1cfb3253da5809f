#include "camera-node/backends/emission_client.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <condition_variable>
#include <cstring>
#include <map>

#include "core/service/service.h"

namespace glasswing {

EmissionClient::EmissionClient(const std::string& address, EmissionTimeline& timeline)
    : timeline_(timeline), stub_(v1::EmissionService::NewStub(dial(address, only(Role::kDisplay)))) {
  thread_ = std::jthread([this](std::stop_token stop) { run(stop); });
}

EmissionClient::~EmissionClient() = default;

void EmissionClient::run(std::stop_token stop) {
  while (!stop.stop_requested()) {
    {
      grpc::ClientContext context;
      const std::stop_callback cancel(stop, [&] { context.TryCancel(); });
      read(context);
    }
    std::mutex mutex;
    std::unique_lock lock(mutex);
    std::condition_variable_any().wait_for(lock, stop, std::chrono::milliseconds(200), [] { return false; });
  }
}

void EmissionClient::read(grpc::ClientContext& context) {
  const auto reader = stub_->WatchEmission(&context, {});
  std::map<std::string, EmissionMonitor> monitors;
  std::shared_ptr<Image16> image;  // filled up to received_bytes
  size_t received_bytes = 0;
  v1::WatchEmissionResponse response;
  while (reader->Read(&response)) {
    if (response.has_monitor()) {
      const v1::EmittingMonitor& monitor = response.monitor();
      EmissionMonitor& known = monitors[monitor.name()];
      known = {.name = monitor.name(),
               .width_px = monitor.width_px(),
               .height_px = monitor.height_px(),
               .scanout = nanoseconds(monitor.scanout_ns()),
               .lag = nanoseconds(monitor.lag_ns()),
               .settle = nanoseconds(monitor.settle_ns()),
               .flicker = {.amplitude = monitor.flicker(), .hz = monitor.flicker_hz()},
               .pitch_mm = monitor.pitch_mm() > 0.0 ? monitor.pitch_mm() : 1.0};
      timeline_.add_monitor(known);
      spdlog::info("light from monitor={} size={}x{}", known.name, known.width_px, known.height_px);
    } else if (response.has_picture()) {
      const v1::EmittedPicture& picture = response.picture();
      const EmissionMonitor& monitor = monitors[picture.monitor()];
      if (received_bytes == 0) image = std::make_shared<Image16>(monitor.width_px, monitor.height_px);
      const std::string& chunk = picture.chunk();
      const size_t image_bytes = image->samples.size() * 2;
      if (chunk.size() <= image_bytes - std::min(received_bytes, image_bytes))
        std::memcpy(reinterpret_cast<char*>(image->samples.data()) + received_bytes, chunk.data(),
                    chunk.size());
      received_bytes += chunk.size();
      if (!picture.last_chunk()) continue;
      if (received_bytes == image_bytes)
        timeline_.add_picture(monitor.name,
                              {.scanout_start = nanoseconds(picture.scanout_start_ns()), .image = image});
      received_bytes = 0;
    } else if (response.has_pose()) {
      const v1::EmitterPose& pose = response.pose();
      timeline_.set_pose(
          pose.monitor(), nanoseconds(pose.since_ns()),
          {.away_mm = pose.away_mm(), .tilt_deg = pose.tilt_deg(), .turn_deg = pose.turn_deg()});
    } else if (response.has_horizon()) {
      timeline_.set_horizon(response.horizon().monitor(), nanoseconds(response.horizon().until_ns()));
    }
  }
  (void)reader->Finish();
}

}  // namespace glasswing
