// A display that raises a trigger line once in each picture, a fixed time after its scan-out began on the
// last monitor; of monitors that lag, in a later picture. The server chooses the time so that the camera
// exposes in the middle of what stands (server/rig/exposure_triggers.h).
#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "display-node/display.h"
#include "display-node/trigger_line.h"

namespace glasswing {

class PulsedDisplay final : public Display {
 public:
  struct Pulse {
    nanoseconds after{};  // the start of the scan-out
    nanoseconds slack{};  // later than that by more, the line is not raised: the exposure would not fit
  };
  // `display` is borrowed.
  PulsedDisplay(Display& display, std::unique_ptr<TriggerLine> line);
  ~PulsedDisplay() override;

  // Raises the line in each picture that is shown from now on; empty: in none.
  void arm(std::optional<Pulse> pulse);

  std::string backend() const override { return display_.backend(); }
  const std::vector<ScreenInfo>& screens() const override { return display_.screens(); }
  // Also UNAVAILABLE: the line could not be raised in an earlier picture.
  absl::StatusOr<std::vector<Scanout>> show(const std::vector<Picture>& pictures, nanoseconds at) override;

 private:
  void pulse_all(const std::stop_token& stop);

  Display& display_;
  const std::unique_ptr<TriggerLine> line_;
  std::mutex mutex_;
  std::condition_variable_any due_changed_;
  std::optional<Pulse> armed_;   // guarded by mutex_
  std::deque<nanoseconds> due_;  // when to raise it, one for each picture; guarded by mutex_
  absl::Status failure_;         // guarded by mutex_
  std::jthread thread_;
};

}  // namespace glasswing
