#include "display-node/backends/kms_display.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <set>
#include <string_view>
#include <system_error>

#include "core/base/name.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr char kCards[] = "/dev/dri";
constexpr std::chrono::seconds kFlipTimeout(2);
// Linux, drm_timestamp_precision: the limit for drivers that know their scan-out position.
constexpr nanoseconds kStampError = std::chrono::microseconds(20);

std::string text_of(const drmModeModeInfo& mode) {
  return fmt::format("{}x{}@{:.4g}", mode.hdisplay, mode.vdisplay, refresh_hz_of(mode));
}

struct Socket {
  std::string name;  // "card0:HDMI-A-1"
  DrmCard* card = nullptr;
  const DrmCard::Connector* connector = nullptr;
};

struct Found {
  std::vector<std::unique_ptr<DrmCard>> cards;
  std::vector<Socket> sockets;  // with a monitor plugged in
  std::string listed;           // all sockets, for messages
};

absl::StatusOr<Found> find_cards() {
  std::vector<std::string> paths;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(kCards, none)) {
    if (entry.path().filename().string().starts_with("card")) paths.push_back(entry.path());
  }
  if (paths.empty())
    return absl::NotFoundError(
        fmt::format("this machine has no graphics card: there is no {}/card*", kCards));
  std::sort(paths.begin(), paths.end());
  Found found;
  std::vector<std::string> lines;
  for (const std::string& path : paths) {
    absl::StatusOr<std::unique_ptr<DrmCard>> card = DrmCard::open(path);
    if (!card.ok()) {
      lines.push_back(fmt::format("nothing usable at {} ({})", path, std::string(card.status().message())));
      continue;
    }
    for (const DrmCard::Connector& connector : (*card)->connectors()) {
      const std::string name = fmt::format("{}:{}", (*card)->name(), connector.name);
      if (connector.modes.empty()) {
        lines.push_back(name + " (nothing plugged in)");
      } else {
        lines.push_back(fmt::format("{} ({})", name, text_of(connector.modes.front())));
        found.sockets.push_back({.name = name, .card = card->get(), .connector = &connector});
      }
    }
    found.cards.push_back(*std::move(card));
  }
  found.listed = fmt::format("{}", fmt::join(lines, ", "));
  return found;
}

absl::StatusOr<drmModeModeInfo> choose_mode(const KmsDisplay::Monitor& monitor, const Socket& socket) {
  if (monitor.width_px == 0) return socket.connector->modes.front();
  const auto apart_hz = [&](const drmModeModeInfo& mode) {
    return monitor.refresh_hz == 0.0 ? 0.0 : std::abs(refresh_hz_of(mode) - monitor.refresh_hz);
  };
  const drmModeModeInfo* best = nullptr;
  std::vector<std::string> modes;
  for (const drmModeModeInfo& mode : socket.connector->modes) {
    modes.push_back(text_of(mode));
    if (mode.hdisplay == monitor.width_px && mode.vdisplay == monitor.height_px && apart_hz(mode) <= 0.5 &&
        (best == nullptr || apart_hz(mode) < apart_hz(*best)))
      best = &mode;
  }
  if (best != nullptr) return *best;
  return absl::NotFoundError(
      fmt::format("monitor \"{}\", {}, has no mode of {} x {} px{}; it has: {}", monitor.name, socket.name,
                  monitor.width_px, monitor.height_px,
                  monitor.refresh_hz == 0.0 ? "" : fmt::format(" at {:.4g} Hz", monitor.refresh_hz),
                  fmt::join(modes, ", ")));
}

}  // namespace

absl::StatusOr<std::unique_ptr<KmsDisplay>> KmsDisplay::open(const Options& options) {
  GW_ASSIGN_OR_RETURN(Found found, find_cards());
  std::vector<Monitor> wanted = options.monitors;
  if (wanted.empty()) {
    for (const Socket& socket : found.sockets)
      wanted.push_back({.name = socket.connector->name, .connector = socket.name});
  }
  if (wanted.empty()) return absl::NotFoundError("no monitor is plugged in; there is: " + found.listed);
  std::unique_ptr<KmsDisplay> display(new KmsDisplay());
  std::set<std::string> taken;
  for (const Monitor& monitor : wanted) {
    GW_RETURN_IF_ERROR(check_name("monitor", monitor.name));
    const auto socket = std::find_if(found.sockets.begin(), found.sockets.end(), [&](const Socket& each) {
      return each.name == monitor.connector || each.connector->name == monitor.connector;
    });
    if (socket == found.sockets.end()) {
      return absl::NotFoundError(
          fmt::format("no monitor is plugged in at \"{}\"; there is: {}", monitor.connector, found.listed));
    }
    if (!taken.insert(socket->name).second)
      return absl::InvalidArgumentError(fmt::format("two monitors are asked for at {}", socket->name));
    GW_ASSIGN_OR_RETURN(const drmModeModeInfo mode, choose_mode(monitor, *socket));
    GW_RETURN_IF_ERROR(display->open_output(*socket->card, *socket->connector, mode, options.bits));
    const double period_ns = 1e9 / refresh_hz_of(mode);
    const double lit = static_cast<double>(mode.vdisplay) / mode.vtotal;
    display->outputs_.back().blanking = nanoseconds(std::llround(period_ns * (1.0 - lit)));
    display->screens_.push_back({.name = monitor.name,
                                 .width_px = mode.hdisplay,
                                 .height_px = mode.vdisplay,
                                 .bits = options.bits,
                                 .refresh_hz = refresh_hz_of(mode),
                                 .scanout = nanoseconds(std::llround(period_ns * lit)),
                                 .lag = options.lag,
                                 .settle = options.settle});
  }
  // Closes the other cards.
  for (auto& card : found.cards) {
    const bool used = std::any_of(display->outputs_.begin(), display->outputs_.end(),
                                  [&](const Output& output) { return output.card == card.get(); });
    if (used) display->cards_.push_back(std::move(card));
  }
  return display;
}

KmsDisplay::~KmsDisplay() {
  for (const Output& output : outputs_) {
    if (output.status_fd >= 0) ::close(output.status_fd);
  }
}

absl::Status KmsDisplay::open_output(DrmCard& card, const DrmCard::Connector& connector,
                                     const drmModeModeInfo& mode, int bits) {
  Output& output = outputs_.emplace_back();
  output.card = &card;
  const std::string status = fmt::format("/sys/class/drm/{}-{}/status", card.name(), connector.name);
  output.status_fd = ::open(status.c_str(), O_RDONLY | O_CLOEXEC);
  if (output.status_fd < 0) {
    return absl::FailedPreconditionError(
        fmt::format("{}, which says whether a monitor is plugged in, cannot be opened: {}", status,
                    std::strerror(errno)));
  }
  GW_ASSIGN_OR_RETURN(output.pipe, card.claim(connector, bits));
  for (Buffer& buffer : output.buffers) {
    GW_ASSIGN_OR_RETURN(buffer.memory, card.make_framebuffer(output.pipe, mode.hdisplay, mode.vdisplay));
  }
  GW_RETURN_IF_ERROR(card.set(connector, output.pipe, mode, output.buffers[output.on_screen].memory));
  if (!card.last_refresh(output.pipe).ok()) {
    return absl::FailedPreconditionError(
        fmt::format("{} has a driver that does not report when {} refreshes", card.name(), connector.name));
  }
  return absl::OkStatus();
}

void KmsDisplay::fill(Buffer& buffer, const ScreenInfo& screen, const Picture& picture) {
  if (buffer.held == picture) return;
  const auto width = static_cast<size_t>(screen.width_px), height = static_cast<size_t>(screen.height_px);
  for (size_t y = 0; y < height; ++y) {
    std::uint8_t* pixel = buffer.memory.pixels + y * buffer.memory.stride_bytes;
    if (picture == nullptr) {
      std::memset(pixel, 0, width * 4);
      continue;
    }
    const std::uint16_t* codes = picture->samples.data() + y * width * 3;
    for (size_t x = 0; x < width; ++x, codes += 3, pixel += 4) {
      // Writing whole words in order is fastest in a card's memory.
      const std::uint32_t word = packed(codes, screen.bits);
      std::memcpy(pixel, &word, sizeof(word));
    }
  }
  buffer.held = picture;
}

absl::Status KmsDisplay::check_plugged_in(size_t index) const {
  char status[32] = "";
  const ssize_t read = ::pread(outputs_[index].status_fd, status, sizeof(status) - 1, 0);
  if (read > 0 && !std::string_view(status).starts_with("disconnected")) return absl::OkStatus();
  return absl::UnavailableError(fmt::format("monitor \"{}\" was unplugged", screens_[index].name));
}

absl::Status KmsDisplay::advance(size_t index, nanoseconds at) {
  Output& output = outputs_[index];
  const auto refused = [&](const absl::Status& status) {
    return absl::UnavailableError(fmt::format("monitor \"{}\" accepts no picture: {}", screens_[index].name,
                                              std::string(status.message())));
  };
  const absl::StatusOr<DrmCard::Refresh> last = output.card->last_refresh(output.pipe);
  if (!last.ok()) return refused(last.status());
  // A framebuffer that the kernel gets after a refresh has begun appears at the next one at the earliest.
  const double refreshes =
      std::ceil(static_cast<double>((at - last->start).count()) * screens_[index].refresh_hz / 1e9);
  output.serial = ++serial_;
  output.stage = refreshes > 1.0 ? Stage::kWaiting : Stage::kFlipping;
  const absl::Status status =
      refreshes > 1.0
          ? output.card->ask_for(output.pipe, last->number + static_cast<std::uint64_t>(refreshes) - 1,
                                 output.serial)
          : output.card->flip(output.pipe, output.buffers[1 - output.on_screen].memory, output.serial);
  if (status.ok()) return status;
  output.stage = Stage::kShown;
  return refused(status);
}

absl::Status KmsDisplay::take_events(DrmCard& card, nanoseconds at) {
  GW_ASSIGN_OR_RETURN(const std::vector<DrmCard::Event> events, card.read_events());
  for (const DrmCard::Event& event : events) {
    const auto output = std::find_if(outputs_.begin(), outputs_.end(), [&](const Output& each) {
      return each.serial == event.serial && each.stage != Stage::kShown;
    });
    if (output == outputs_.end()) continue;
    if (output->stage == Stage::kWaiting) {
      GW_RETURN_IF_ERROR(advance(static_cast<size_t>(output - outputs_.begin()), at));
    } else {
      output->stage = Stage::kShown;
      output->on_screen = 1 - output->on_screen;
      output->shown_start = event.refresh_start;
    }
  }
  return absl::OkStatus();
}

absl::Status KmsDisplay::wait_for_all(nanoseconds at) {
  const nanoseconds deadline = std::max(at, monotonic_now()) + kFlipTimeout;
  for (;;) {
    const auto awaited = std::find_if(outputs_.begin(), outputs_.end(),
                                      [](const Output& output) { return output.stage != Stage::kShown; });
    if (awaited == outputs_.end()) return absl::OkStatus();
    if (monotonic_now() > deadline) {
      const size_t index = awaited - outputs_.begin();
      GW_RETURN_IF_ERROR(check_plugged_in(index));
      return absl::UnavailableError(
          fmt::format("monitor \"{}\" has not refreshed for {} s: is it switched on?", screens_[index].name,
                      kFlipTimeout.count()));
    }
    std::vector<pollfd> readable;
    for (const auto& card : cards_)
      readable.push_back({.fd = card->events_fd(), .events = POLLIN, .revents = 0});
    (void)::poll(readable.data(), readable.size(), 20);
    for (size_t i = 0; i < cards_.size(); ++i) {
      if (readable[i].revents != 0) GW_RETURN_IF_ERROR(take_events(*cards_[i], at));
    }
  }
}

absl::StatusOr<std::vector<Scanout>> KmsDisplay::show(const std::vector<Picture>& pictures, nanoseconds at) {
  // After a failure a flip may still be pending, and only its end tells which buffer is free.
  for (Output& output : outputs_) {
    if (output.stage == Stage::kWaiting) output.stage = Stage::kShown;
  }
  GW_RETURN_IF_ERROR(wait_for_all(monotonic_now()));
  for (size_t i = 0; i < outputs_.size(); ++i) {
    fill(outputs_[i].buffers[1 - outputs_[i].on_screen], screens_[i],
         i < pictures.size() ? pictures[i] : nullptr);
  }
  const nanoseconds earliest = std::max(at, monotonic_now());
  for (size_t i = 0; i < outputs_.size(); ++i) GW_RETURN_IF_ERROR(advance(i, earliest));
  GW_RETURN_IF_ERROR(wait_for_all(earliest));
  std::vector<Scanout> scanouts;
  for (size_t i = 0; i < outputs_.size(); ++i) {
    GW_RETURN_IF_ERROR(check_plugged_in(i));
    // A driver that does not know its scan-out position takes the time of its interrupt, anywhere in the
    // blanking before the first row; nothing tells which kind of driver it is.
    scanouts.push_back({.start = outputs_[i].shown_start, .uncertainty = outputs_[i].blanking + kStampError});
  }
  return scanouts;
}

}  // namespace glasswing
