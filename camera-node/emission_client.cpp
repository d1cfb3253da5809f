#include "camera-node/emission_client.h"

#include <spdlog/spdlog.h>

#include <condition_variable>
#include <cstring>
#include <map>

#include "core/service/service.h"

namespace glasswing {

EmissionClient::EmissionClient(const std::string& address, EmissionTimeline& timeline)
    : timeline_(timeline), stub_(v1::EmissionService::NewStub(dial(address))) {
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
  std::string pixels;
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
               .settle = nanoseconds(monitor.settle_ns())};
      timeline_.add_monitor(known);
      spdlog::info("light from monitor={} size={}x{}", known.name, known.width_px, known.height_px);
    } else if (response.has_picture()) {
      const v1::EmittedPicture& picture = response.picture();
      pixels += picture.chunk();
      if (!picture.last_chunk()) continue;
      const EmissionMonitor& monitor = monitors[picture.monitor()];
      auto image = std::make_shared<RadianceImage>(monitor.width_px, monitor.height_px);
      if (pixels.size() == image->samples.size() * 2) {
        for (size_t i = 0; i < image->samples.size(); ++i) {
          std::uint16_t code = 0;
          std::memcpy(&code, &pixels[2 * i], 2);
          image->samples[i] = radiance_of(code);
        }
        timeline_.add_picture(monitor.name,
                              {.scanout_start = nanoseconds(picture.scanout_start_ns()), .image = image});
      }
      pixels.clear();
    } else if (response.has_horizon()) {
      timeline_.set_horizon(response.horizon().monitor(), nanoseconds(response.horizon().until_ns()));
    }
  }
  (void)reader->Finish();
}

}  // namespace glasswing
