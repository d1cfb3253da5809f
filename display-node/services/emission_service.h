// EmissionService: the light that a display emitted, for simulated cameras.
#pragma once

#include <atomic>
#include <optional>
#include <vector>

#include "core/sim/flicker.h"
#include "core/sim/panel.h"
#include "display-node/backends/light_tap.h"
#include "glasswing/v1/emission_service.grpc.pb.h"

namespace glasswing {

// The true behaviour of the light, where it differs from what the screens declare.
struct TrueOptics {
  std::optional<nanoseconds> lag = {}, settle = {};
  // For every monitor, switched on with the service; bits are those of the screen.
  PanelModel panel = {};
  Flicker flicker = {};   // of every backlight
  double pitch_mm = 1.0;  // of every monitor's pixels
};

class EmissionServiceImpl final : public v1::EmissionService::Service {
 public:
  explicit EmissionServiceImpl(LightTap& display, TrueOptics optics = {});
  void stop() { stopping_ = true; }
  grpc::Status WatchEmission(grpc::ServerContext* context, const v1::WatchEmissionRequest* request,
                             grpc::ServerWriter<v1::WatchEmissionResponse>* writer) override;

 private:
  LightTap& display_;
  const TrueOptics optics_;
  const std::vector<Panel> panels_;  // one a screen
  const nanoseconds switched_on_;
  std::atomic<bool> stopping_ = false;
};

}  // namespace glasswing
