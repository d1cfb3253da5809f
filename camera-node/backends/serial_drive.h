// A stage behind a serial line: a controller of G-code, or one of our plain protocol (docs/turntable.md).
#pragma once

#include <optional>
#include <span>

#include "camera-node/backends/serial_line.h"
#include "camera-node/stage_drive.h"

namespace glasswing {

enum class SerialProtocol { kGrbl, kMarlin, kPlain };

class SerialDrive final : public StageDrive {
 public:
  struct Settings {
    std::string path;
    int baud = 115200;
    SerialProtocol protocol = SerialProtocol::kGrbl;
    std::optional<double> speed;  // of moves, units a second; empty: as fast as the controller likes
    std::chrono::milliseconds limit{120'000};  // for each command's confirmation
  };
  // Opens the line. Errors as SerialLine::open().
  static absl::StatusOr<std::unique_ptr<SerialDrive>> create(Settings settings);

  // FAILED_PRECONDITION: the controller reports an error, which the message has. UNAVAILABLE: it is gone or
  // silent; the next call opens the line again.
  absl::Status move(const StageAxis& axis, double position, std::stop_token stop) override;
  absl::Status home(const StageAxis& axis, std::stop_token stop) override;

 private:
  explicit SerialDrive(Settings settings) : settings_(std::move(settings)) {}
  // Sends the commands, each when the one before is confirmed. `stop` stops the motors, too.
  absl::Status run(std::span<const std::string> commands, std::stop_token stop);
  absl::Status run_one(const std::string& command, const std::stop_token& stop);
  absl::Status open();
  void stop_motors();

  const Settings settings_;
  std::optional<SerialLine> line_;  // empty: to be opened again
};

}  // namespace glasswing
