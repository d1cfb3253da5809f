#include "camera-node/backends/serial_drive.h"

#include <absl/strings/ascii.h>
#include <fmt/format.h>

#include <array>

#include "core/base/status.h"
#include "core/base/time.h"
#include "core/base/utf8.h"

namespace glasswing {
namespace {

constexpr std::chrono::milliseconds kStopAnswer(2000);

bool is_done(std::string_view line, SerialProtocol protocol) {
  if (protocol == SerialProtocol::kPlain) return line == "OK" || line.starts_with("OK ");
  return line == "ok" || line.starts_with("ok ");
}

bool is_error(std::string_view line) {
  const std::string lower = absl::AsciiStrToLower(std::string(line));
  return lower.starts_with("error") || lower.starts_with("alarm") || lower.starts_with("stopped");
}

}  // namespace

absl::StatusOr<std::unique_ptr<SerialDrive>> SerialDrive::create(Settings settings) {
  std::unique_ptr<SerialDrive> drive(new SerialDrive(std::move(settings)));
  GW_RETURN_IF_ERROR(drive->open());
  return drive;
}

absl::Status SerialDrive::open() {
  if (line_) return absl::OkStatus();
  GW_ASSIGN_OR_RETURN(line_, SerialLine::open(settings_.path, settings_.baud));
  return absl::OkStatus();
}

absl::Status SerialDrive::move(const StageAxis& axis, double position, std::stop_token stop) {
  if (settings_.protocol == SerialProtocol::kPlain) {
    const std::string command = fmt::format("MOVE {} {:.4f}", axis.name, position);
    return run(std::array{command}, std::move(stop));
  }
  const std::string go =
      settings_.speed ? fmt::format("G1 {}{:.4f} F{:.1f}", axis.letter, position, 60.0 * *settings_.speed)
                      : fmt::format("G0 {}{:.4f}", axis.letter, position);
  // A dwell is confirmed once all moves before it have ended.
  return run(std::array<std::string, 3>{"G90", go, "G4 P0"}, std::move(stop));
}

absl::Status SerialDrive::home(const StageAxis& axis, std::stop_token stop) {
  switch (settings_.protocol) {
    case SerialProtocol::kPlain:
      return run(std::array{"HOME " + axis.name}, std::move(stop));
    case SerialProtocol::kMarlin:
      return run(std::array{"G28 " + axis.letter, std::string("G4 P0"), "G92 " + axis.letter + "0"},
                 std::move(stop));
    case SerialProtocol::kGrbl:
      return run(std::array<std::string, 2>{"$H", "G92 " + axis.letter + "0"}, std::move(stop));
  }
  return absl::OkStatus();
}

absl::Status SerialDrive::run(std::span<const std::string> commands, std::stop_token stop) {
  GW_RETURN_IF_ERROR(open());
  line_->flush();
  for (const std::string& command : commands) {
    absl::Status done = run_one(command, stop);
    if (absl::IsCancelled(done)) stop_motors();
    if (absl::IsUnavailable(done)) line_.reset();
    GW_RETURN_IF_ERROR(done);
  }
  return absl::OkStatus();
}

absl::Status SerialDrive::run_one(const std::string& command, const std::stop_token& stop) {
  GW_RETURN_IF_ERROR(line_->write(command + "\n"));
  const nanoseconds until = monotonic_now() + settings_.limit;
  while (monotonic_now() < until) {
    absl::StatusOr<std::string> line = line_->read_line(settings_.limit, stop);
    if (absl::IsDeadlineExceeded(line.status())) break;
    GW_RETURN_IF_ERROR(line.status());
    if (is_done(*line, settings_.protocol)) return absl::OkStatus();
    if (is_error(*line)) {
      return absl::FailedPreconditionError(
          fmt::format("{} answers \"{}\" to \"{}\"", settings_.path, printable(*line), command));
    }
  }
  stop_motors();
  return absl::UnavailableError(
      fmt::format("{} has not confirmed \"{}\" in {} s; its motors were told to stop", settings_.path,
                  command, std::chrono::duration<double>(settings_.limit).count()));
}

void SerialDrive::stop_motors() {
  // Of GRBL: hold, then a reset, which drops what is queued; both act at once, between lines.
  constexpr const char* kStops[] = {"!\x18", "M410\n", "STOP\n"};
  if (!line_->write(kStops[static_cast<int>(settings_.protocol)]).ok()) return;
  // What it says of the move that ended must not be taken for the answer to the next command. Marlin confirms
  // the move and the stop.
  int answers = settings_.protocol == SerialProtocol::kMarlin ? 2 : 1;
  const nanoseconds until = monotonic_now() + kStopAnswer;
  while (answers > 0 && monotonic_now() < until) {
    const absl::StatusOr<std::string> line = line_->read_line(kStopAnswer);
    if (!line.ok()) return;
    const bool grbl = settings_.protocol == SerialProtocol::kGrbl;
    if (grbl ? line->starts_with("Grbl") : is_error(*line) || is_done(*line, settings_.protocol)) --answers;
  }
  // The reset locks it until somebody says that all is well; it was ours.
  if (settings_.protocol == SerialProtocol::kGrbl && line_->write("$X\n").ok())
    (void)line_->read_line(kStopAnswer);
}

}  // namespace glasswing
