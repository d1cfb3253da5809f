#include "display-node/services/emission_service.h"

#include <algorithm>

#include "core/service/service.h"

namespace glasswing {
namespace {

using Writer = grpc::ServerWriter<v1::WatchEmissionResponse>;

std::vector<Panel> panels_of(const std::vector<ScreenInfo>& screens, PanelModel model) {
  std::vector<Panel> panels;
  for (const ScreenInfo& screen : screens) {
    model.bits = screen.bits;
    panels.emplace_back(model);
  }
  return panels;
}

bool send_pose(const ScreenInfo& screen, nanoseconds since, const PanelPose& pose, Writer& writer) {
  v1::WatchEmissionResponse response;
  v1::EmitterPose& sent = *response.mutable_pose();
  sent.set_monitor(screen.name);
  sent.set_since_ns(since.count());
  sent.set_away_mm(pose.away_mm);
  sent.set_tilt_deg(pose.tilt_deg);
  sent.set_turn_deg(pose.turn_deg);
  return writer.Write(response);
}

bool send_picture(const ScreenInfo& screen, const Emission& emission, const Image16& image, Writer& writer) {
  const std::string_view bytes(reinterpret_cast<const char*>(image.samples.data()), image.samples.size() * 2);
  for (size_t at = 0; at < bytes.size(); at += kChunkBytes) {
    v1::WatchEmissionResponse response;
    v1::EmittedPicture& picture = *response.mutable_picture();
    picture.set_monitor(screen.name);
    picture.set_scanout_start_ns(emission.scanout_start.count());
    picture.set_chunk(std::string(bytes.substr(at, kChunkBytes)));
    picture.set_last_chunk(at + kChunkBytes >= bytes.size());
    if (!writer.Write(response)) return false;
  }
  return true;
}

}  // namespace

EmissionServiceImpl::EmissionServiceImpl(LightTap& display, TrueOptics optics)
    : display_(display),
      optics_(optics),
      panels_(panels_of(display.screens(), optics.panel)),
      switched_on_(monotonic_now()) {}

grpc::Status EmissionServiceImpl::WatchEmission(grpc::ServerContext* context, const v1::WatchEmissionRequest*,
                                                Writer* writer) {
  for (const ScreenInfo& screen : display_.screens()) {
    v1::WatchEmissionResponse response;
    v1::EmittingMonitor& monitor = *response.mutable_monitor();
    monitor.set_name(screen.name);
    monitor.set_width_px(screen.width_px);
    monitor.set_height_px(screen.height_px);
    monitor.set_scanout_ns(screen.scanout.count());
    monitor.set_lag_ns(optics_.lag.value_or(screen.lag).count());
    monitor.set_settle_ns(optics_.settle.value_or(screen.settle).count());
    monitor.set_flicker(optics_.flicker.amplitude);
    monitor.set_flicker_hz(optics_.flicker.hz);
    monitor.set_pitch_mm(optics_.pitch_mm);
    if (!writer->Write(response)) return grpc::Status::OK;
  }
  std::uint64_t cursor = 0;
  std::vector<Emission> emissions;
  nanoseconds horizon{};
  while (!context->IsCancelled() && !stopping_) {
    if (!display_.read(cursor, emissions, horizon, std::chrono::milliseconds(8))) {
      return grpc::Status(grpc::StatusCode::RESOURCE_EXHAUSTED, "the reader fell too far behind the screens");
    }
    for (const Emission& emission : emissions) {
      const ScreenInfo& screen = display_.screens()[emission.monitor];
      if (emission.pose) {
        if (!send_pose(screen, emission.scanout_start, *emission.pose, *writer)) return grpc::Status::OK;
        continue;
      }
      const nanoseconds lit = std::max(emission.scanout_start - switched_on_, nanoseconds(0));
      const Image16 black =
          emission.picture == nullptr ? Image16(screen.width_px, screen.height_px) : Image16();
      const Image16& codes = emission.picture == nullptr ? black : *emission.picture;
      const Image16 light = panels_[emission.monitor].emitted(codes, lit);
      if (!send_picture(screen, emission, light, *writer)) return grpc::Status::OK;
    }
    for (const ScreenInfo& screen : display_.screens()) {
      v1::WatchEmissionResponse response;
      response.mutable_horizon()->set_monitor(screen.name);
      response.mutable_horizon()->set_until_ns(horizon.count());
      if (!writer->Write(response)) return grpc::Status::OK;
    }
  }
  return grpc::Status::OK;
}

}  // namespace glasswing
