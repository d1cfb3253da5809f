// A GigE Vision camera that speaks the protocol on this machine: Aravis' own fake camera, whose pictures a
// function exposes. It stamps the start of each exposure with CLOCK_REALTIME; the exposure, the drawing and
// the sending follow one another, so they limit its frame rate.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "core/base/time.h"
#include "core/image/image.h"

namespace glasswing {

class GigeCamera {
 public:
  struct Exposure {
    nanoseconds start{}, length{};  // CLOCK_MONOTONIC
    int width_px = 0, height_px = 0;
  };
  // Returns when the exposure has ended. The image has three channels.
  using Expose = std::function<Image16(const Exposure&)>;

  // `address`: one of this machine's. `lost`: part of the packets that it loses.
  GigeCamera(const std::string& address, const std::string& serial, double lost, Expose expose);
  ~GigeCamera();
  bool is_running() const;

  struct Aravis;  // its objects
 private:
  const std::unique_ptr<Aravis> aravis_;
};

}  // namespace glasswing
