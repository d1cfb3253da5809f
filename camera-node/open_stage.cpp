#include "camera-node/open_stage.h"

#include <fmt/format.h>

#include <algorithm>

#include "camera-node/backends/command_drive.h"
#include "camera-node/backends/serial_drive.h"
#include "camera-node/backends/sim_drive.h"
#include "core/base/name.h"
#include "core/base/scanner.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr int kUsualSettle_ms = 500;

// "turn=0:360", "lift=0:50mm", "turn=0:360deg/X"
absl::StatusOr<StageAxis> parse_axis(const std::string& text) {
  StageAxis axis;
  Scanner scan(text);
  scan.name(axis.name, '=').number(axis.min).then(":").number(axis.max);
  std::string_view rest = scan.more() ? scan.rest() : "";
  if (const size_t slash = rest.find('/'); slash != std::string_view::npos) {
    axis.letter = rest.substr(slash + 1);
    rest = rest.substr(0, slash);
  }
  axis.turns = rest != "mm";
  const bool letter =
      axis.letter.empty() || (axis.letter.size() == 1 && axis.letter[0] >= 'A' && axis.letter[0] <= 'Z');
  const bool read = scan.done() || scan.more();
  if (!read || !(axis.max > axis.min) || !letter || (!rest.empty() && rest != "deg" && rest != "mm") ||
      !check_name("axis", axis.name).ok()) {
    return absl::InvalidArgumentError(
        fmt::format("--axis is {}; it must be NAME=MIN:MAX in degrees, or with mm, such as turn=0:360 or "
                    "lift=0:50mm, and of G-code may end in /LETTER, such as turn=0:360/X",
                    text));
  }
  return axis;
}

// Rotary axes are A, B, C; linear ones X, Y, Z.
absl::Status add_letters(std::vector<StageAxis>& axes) {
  constexpr std::string_view kRotary = "ABC", kLinear = "XYZ";
  size_t rotary = 0, linear = 0;
  for (StageAxis& axis : axes) {
    size_t& next = axis.turns ? rotary : linear;
    if (axis.letter.empty() && next < kRotary.size()) axis.letter = (axis.turns ? kRotary : kLinear)[next++];
    const auto same = [&](const StageAxis& other) { return &other != &axis && other.letter == axis.letter; };
    if (axis.letter.empty() || std::ranges::any_of(axes, same)) {
      return absl::InvalidArgumentError(fmt::format("--axis {} needs a letter of its own, such as {}={}:{}/U",
                                                    axis.name, axis.name, axis.min, axis.max));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<StageDrive>> open_drive(const StageOptions& options,
                                                       const std::vector<StageAxis>& axes,
                                                       const OpenedCamera& camera) {
  if (!options.command.empty()) return CommandDrive::create(options.command, options.home_command);
  if (!options.serial.empty()) {
    const SerialProtocol protocol = options.protocol == "grbl"     ? SerialProtocol::kGrbl
                                    : options.protocol == "marlin" ? SerialProtocol::kMarlin
                                                                   : SerialProtocol::kPlain;
    return SerialDrive::create(
        {.path = options.serial, .baud = options.baud, .protocol = protocol, .speed = options.speed});
  }
  if (!camera.turn) {
    return absl::InvalidArgumentError(
        "--axis needs --axis-command or --axis-serial, which say what moves it; --backend sim turns its "
        "scene "
        "without them");
  }
  if (axes.size() != 1 || !axes[0].turns)
    return absl::InvalidArgumentError(
        "--axis: a simulated stage has one axis, in degrees, such as turn=0:360");
  return std::make_unique<SimDrive>(camera.turn, options.speed);
}

}  // namespace

void add_stage_options(CLI::App& app, StageOptions& stage) {
  app.add_option(
         "--axis", stage.axes,
         "an axis of the stage that moves the object, NAME=MIN:MAX in degrees, as turn=0:360, or mm, as "
         "lift=0:50mm; of G-code its letter may follow, as turn=0:360/X. May be repeated. With "
         "--backend sim the scene's object turns")
      ->allow_extra_args(false);
  app.add_option(
      "--axis-command", stage.command,
      "program that moves an axis, with its arguments, of which {position} and {axis} are replaced; no "
      "shell sees them");
  app.add_option("--axis-home-command", stage.home_command,
                 "program that moves an axis to 0, by its switch; {axis} is replaced");
  app.add_option("--axis-serial", stage.serial, "serial line of the axes' controller, such as /dev/ttyUSB0");
  app.add_option("--axis-protocol", stage.protocol,
                 "what the controller speaks: G-code as grbl or marlin do, or plain (docs/turntable.md)")
      ->check(CLI::IsMember({"grbl", "marlin", "plain"}))
      ->capture_default_str();
  app.add_option("--axis-baud", stage.baud, "rate of the serial line")->capture_default_str();
  app.add_option(
         "--axis-speed", stage.speed,
         "degrees or mm a second, of G-code and of the simulated stage; as fast as it goes if left out")
      ->check(CLI::Range(1e-3, 1e4));
  app.add_option("--axis-home", stage.homing,
                 "auto: an axis whose position is unknown is homed before it moves, if it can be; never: its "
                 "controller knows")
      ->check(CLI::IsMember({"auto", "never"}))
      ->capture_default_str();
  app.add_option(
         "--axis-settle-ms", stage.settle_ms,
         "time after a move in which the object comes to rest; 500, of the simulated stage 0, if left out")
      ->check(CLI::Range(0, 60'000));
  app.add_option("--axis-takeup", stage.takeup,
                 "degrees or mm: moves down go so much further and come back, so that the gear's backlash is "
                 "always on the same side")
      ->check(CLI::Range(0.0, 90.0));
}

absl::StatusOr<StageDevice> open_stage(const StageOptions& options, const OpenedCamera& camera) {
  StageDevice device;
  const bool has_device = !options.command.empty() || !options.serial.empty();
  if (options.axes.empty()) {
    if (!has_device) return device;
    return absl::InvalidArgumentError(
        "--axis-command and --axis-serial move axes; --axis must name one, such as turn=0:360");
  }
  if (!options.command.empty() && !options.serial.empty())
    return absl::InvalidArgumentError("--axis-command and --axis-serial are both given; one moves the axes");
  if (!options.home_command.empty() && options.command.empty())
    return absl::InvalidArgumentError("--axis-home-command goes with --axis-command");
  for (const std::string& text : options.axes) {
    GW_ASSIGN_OR_RETURN(const StageAxis axis, parse_axis(text));
    if (std::ranges::count(device.axes, axis.name, &StageAxis::name) > 0)
      return absl::InvalidArgumentError("--axis names \"" + axis.name + "\" twice");
    device.axes.push_back(axis);
  }
  GW_RETURN_IF_ERROR(add_letters(device.axes));
  GW_ASSIGN_OR_RETURN(device.drive, open_drive(options, device.axes, camera));
  device.homes_first = options.homing == "auto";
  device.settle_ms = options.settle_ms.value_or(has_device ? kUsualSettle_ms : 0);
  device.takeup = options.takeup;
  return device;
}

}  // namespace glasswing
