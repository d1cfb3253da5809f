// EmissionService: what a display emitted, for cameras that are simulated.
#pragma once

#include <atomic>
#include <optional>

#include "core/sim/flicker.h"
#include "core/sim/panel.h"
#include "display-node/light_tap.h"
#include "glasswing/v1/emission_service.grpc.pb.h"

namespace glasswing {

// What the light really does, where that is not what the screens say of themselves.
struct TrueOptics {
  std::optional<nanoseconds> lag = {}, settle = {};
  PanelModel panel = {};  // of every monitor; switched on with the service
  Flicker flicker = {};   // of every backlight
};

class EmissionServiceImpl final : public v1::EmissionService::Service {
 public:
  explicit EmissionServiceImpl(LightTap& display, TrueOptics optics = {})
      : display_(display), optics_(optics), panel_(optics.panel), switched_on_(monotonic_now()) {}
  void stop() { stopping_ = true; }
  grpc::Status WatchEmission(grpc::ServerContext* context, const v1::WatchEmissionRequest* request,
                             grpc::ServerWriter<v1::WatchEmissionResponse>* writer) override;

 private:
  LightTap& display_;
  const TrueOptics optics_;
  const Panel panel_;
  const nanoseconds switched_on_;
  std::atomic<bool> stopping_ = false;
};

}  // namespace glasswing
