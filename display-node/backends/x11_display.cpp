#include "display-node/backends/x11_display.h"

#include <fmt/format.h>
#include <poll.h>
#include <xcb/randr.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>

#include "core/base/name.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr std::chrono::seconds kPresentTimeout(2);
constexpr std::uint64_t kMeasured = 30;  // refreshes
// The server copies soon after the refresh begins, and some drivers record the refresh's time anywhere in the
// blanking before it.
constexpr nanoseconds kUncertainty = std::chrono::milliseconds(1);
// A picture requested later than this before a refresh may miss it.
constexpr nanoseconds kHaste = std::chrono::microseconds(500);

// xcb's replies and events are malloc'd.
struct Free {
  void operator()(void* memory) const { std::free(memory); }
};
template <typename Reply>
std::unique_ptr<Reply, Free> owned(Reply* reply) {
  return std::unique_ptr<Reply, Free>(reply);
}

bool has_extension(xcb_connection_t* connection, xcb_extension_t* extension) {
  const xcb_query_extension_reply_t* reply = xcb_get_extension_data(connection, extension);
  return reply != nullptr && reply->present != 0;
}

}  // namespace

absl::StatusOr<std::unique_ptr<X11Display>> X11Display::open(const Options& options) {
  std::unique_ptr<X11Display> display(new X11Display());
  GW_RETURN_IF_ERROR(display->connect(options));
  GW_RETURN_IF_ERROR(display->find_monitors(options));
  for (size_t i = 0; i < display->outputs_.size(); ++i) GW_RETURN_IF_ERROR(display->open_window(i));
  GW_RETURN_IF_ERROR(display->measure_refresh());
  return display;
}

X11Display::~X11Display() {
  if (connection_ == nullptr) return;
  for (const Output& output : outputs_) {
    if (output.events != nullptr) xcb_unregister_for_special_event(connection_, output.events);
  }
  xcb_disconnect(connection_);
}

absl::Status X11Display::connect(const Options& options) {
  const std::string& server = options.server;
  int number = 0;
  connection_ = xcb_connect(server.empty() ? nullptr : server.c_str(), &number);
  const char* const named = server.empty() ? std::getenv("DISPLAY") : server.c_str();
  if (xcb_connection_has_error(connection_) != 0) {
    return absl::UnavailableError(
        fmt::format("no X server answers at \"{}\"; name one with --x11-server, such as :0",
                    named == nullptr ? "" : named));
  }
  xcb_screen_iterator_t screens = xcb_setup_roots_iterator(xcb_get_setup(connection_));
  for (int i = 0; i < number && screens.rem > 0; ++i) xcb_screen_next(&screens);
  screen_ = screens.data;
  if (!has_extension(connection_, &xcb_present_id) || !has_extension(connection_, &xcb_randr_id)) {
    return absl::FailedPreconditionError(
        fmt::format("the X server {} lacks the Present or the RANDR extension; both are needed", named));
  }
  const std::uint32_t blue = (1u << options.bits) - 1, green = blue << options.bits,
                      red = green << options.bits;
  for (auto depths = xcb_screen_allowed_depths_iterator(screen_); depths.rem > 0; xcb_depth_next(&depths)) {
    for (auto visuals = xcb_depth_visuals_iterator(depths.data); visuals.rem > 0;
         xcb_visualtype_next(&visuals)) {
      const xcb_visualtype_t& visual = *visuals.data;
      if (visual.visual_id == screen_->root_visual && depths.data->depth == 3 * options.bits &&
          visual.red_mask == red && visual.green_mask == green && visual.blue_mask == blue) {
        context_ = xcb_generate_id(connection_);
        const std::uint32_t no_exposures = 0;
        xcb_create_gc(connection_, context_, screen_->root, XCB_GC_GRAPHICS_EXPOSURES, &no_exposures);
        // Negotiates versions; a server assumes the oldest for a client that does not.
        owned(
            xcb_randr_query_version_reply(connection_, xcb_randr_query_version(connection_, 1, 5), nullptr));
        owned(xcb_present_query_version_reply(connection_, xcb_present_query_version(connection_, 1, 0),
                                              nullptr));
        xcb_set_screen_saver(connection_, 0, 0, XCB_BLANKING_NOT_PREFERRED, XCB_EXPOSURES_NOT_ALLOWED);
        return absl::OkStatus();
      }
    }
  }
  return absl::FailedPreconditionError(
      fmt::format("the X server {} has a colour depth of {} bits; codes of {} bits need {}", named,
                  screen_->root_depth, options.bits, 3 * options.bits));
}

absl::Status X11Display::find_monitors(const Options& options) {
  const auto reply = owned(xcb_randr_get_monitors_reply(
      connection_, xcb_randr_get_monitors(connection_, screen_->root, 0), nullptr));
  struct Monitor {
    std::string name;
    xcb_randr_monitor_info_t info;
  };
  std::vector<Monitor> found;
  std::string listed;
  if (reply != nullptr) {
    for (auto it = xcb_randr_get_monitors_monitors_iterator(reply.get()); it.rem > 0;
         xcb_randr_monitor_info_next(&it)) {
      const auto name =
          owned(xcb_get_atom_name_reply(connection_, xcb_get_atom_name(connection_, it.data->name), nullptr));
      if (name == nullptr) continue;
      found.push_back({.name = {xcb_get_atom_name_name(name.get()),
                                static_cast<size_t>(xcb_get_atom_name_name_length(name.get()))},
                       .info = *it.data});
      listed += fmt::format("{}{} ({} x {} px)", listed.empty() ? "" : ", ", found.back().name,
                            it.data->width, it.data->height);
    }
  }
  if (found.empty()) return absl::NotFoundError("the X server has no monitor");
  std::vector<std::pair<std::string, std::string>> wanted = options.monitors;
  if (wanted.empty()) {
    for (const Monitor& monitor : found) wanted.emplace_back(monitor.name, monitor.name);
  }
  for (const auto& [name, output] : wanted) {
    GW_RETURN_IF_ERROR(check_name("monitor", name));
    const auto monitor = std::ranges::find(found, output, &Monitor::name);
    if (monitor == found.end()) {
      return absl::NotFoundError(fmt::format("no monitor is called \"{}\"; there is: {}", output, listed));
    }
    screens_.push_back({.name = name,
                        .width_px = monitor->info.width,
                        .height_px = monitor->info.height,
                        .bits = options.bits,
                        .refresh_hz = 0.0,
                        .scanout = {},
                        .lag = options.lag,
                        .settle = options.settle});
    Output& own = outputs_.emplace_back();
    own.x = monitor->info.x, own.y = monitor->info.y;
  }
  return absl::OkStatus();
}

absl::Status X11Display::open_window(size_t index) {
  Output& output = outputs_[index];
  const auto width = static_cast<std::uint16_t>(screens_[index].width_px),
             height = static_cast<std::uint16_t>(screens_[index].height_px);
  // Hides the pointer: an empty bitmap as its cursor.
  const xcb_pixmap_t nothing = xcb_generate_id(connection_);
  xcb_create_pixmap(connection_, 1, nothing, screen_->root, 1, 1);
  const xcb_gcontext_t bits = xcb_generate_id(connection_);
  const std::uint32_t off = 0;
  xcb_create_gc(connection_, bits, nothing, XCB_GC_FOREGROUND, &off);
  const xcb_rectangle_t pixel{.x = 0, .y = 0, .width = 1, .height = 1};
  xcb_poly_fill_rectangle(connection_, nothing, bits, 1, &pixel);
  const xcb_cursor_t cursor = xcb_generate_id(connection_);
  xcb_create_cursor(connection_, cursor, nothing, nothing, 0, 0, 0, 0, 0, 0, 0, 0);

  output.window = xcb_generate_id(connection_);
  const std::uint32_t values[] = {screen_->black_pixel, 1, cursor};  // no window manager moves or frames it
  xcb_create_window(connection_, screen_->root_depth, output.window, screen_->root,
                    static_cast<std::int16_t>(output.x), static_cast<std::int16_t>(output.y), width, height,
                    0, XCB_WINDOW_CLASS_INPUT_OUTPUT, screen_->root_visual,
                    XCB_CW_BACK_PIXEL | XCB_CW_OVERRIDE_REDIRECT | XCB_CW_CURSOR, values);
  const std::uint32_t events = xcb_generate_id(connection_);
  xcb_present_select_input(connection_, events, output.window, XCB_PRESENT_EVENT_MASK_COMPLETE_NOTIFY);
  output.events = xcb_register_for_special_xge(connection_, &xcb_present_id, events, nullptr);
  xcb_map_window(connection_, output.window);
  for (Buffer& buffer : output.buffers) {
    buffer.pixmap = xcb_generate_id(connection_);
    const auto made = owned(xcb_request_check(
        connection_, xcb_create_pixmap_checked(connection_, screen_->root_depth, buffer.pixmap, output.window,
                                               width, height)));
    if (made != nullptr) {
      return absl::ResourceExhaustedError(
          fmt::format("the X server has no memory for pictures of {} x {} px", width, height));
    }
  }
  return absl::OkStatus();
}

void X11Display::ask_for(Output& output, std::uint64_t msc) {
  xcb_present_notify_msc(connection_, output.window, ++output.serial, msc, 0, 0);
}

absl::Status X11Display::measure_refresh() {
  for (Output& output : outputs_) ask_for(output, 0);
  GW_ASSIGN_OR_RETURN(const std::vector<Completion> first, wait_for_all(monotonic_now()));
  for (size_t i = 0; i < outputs_.size(); ++i) ask_for(outputs_[i], first[i].refresh.msc + 2);
  // Measures between two events: the time in an immediate answer may lie anywhere in a refresh.
  GW_ASSIGN_OR_RETURN(const std::vector<Completion> from, wait_for_all(monotonic_now()));
  for (size_t i = 0; i < outputs_.size(); ++i) ask_for(outputs_[i], from[i].refresh.msc + kMeasured);
  GW_ASSIGN_OR_RETURN(const std::vector<Completion> to, wait_for_all(monotonic_now()));
  for (size_t i = 0; i < outputs_.size(); ++i) {
    const double refreshes =
        static_cast<double>(to[i].refresh.msc) - static_cast<double>(from[i].refresh.msc);
    const auto taken = static_cast<double>((to[i].refresh.time - from[i].refresh.time).count());
    const double hz = 1e9 * refreshes / taken;
    if (!(refreshes > 0.0 && hz >= 10.0 && hz <= 1000.0)) {
      return absl::FailedPreconditionError(fmt::format(
          "monitor \"{}\" seems to refresh {} times a second; 10 to 1000 can be used", screens_[i].name, hz));
    }
    screens_[i].refresh_hz = hz;
    screens_[i].scanout = nanoseconds(static_cast<std::int64_t>(1e9 / hz));
  }
  return absl::OkStatus();
}

void X11Display::fill(Buffer& buffer, const ScreenInfo& screen, const Picture& picture) {
  if (buffer.filled && buffer.held == picture) return;
  const auto width = static_cast<size_t>(screen.width_px), height = static_cast<size_t>(screen.height_px);
  std::vector<std::uint32_t> pixels(width * height, 0);
  if (picture != nullptr) {
    for (size_t i = 0; i < pixels.size(); ++i) pixels[i] = packed(&picture->samples[3 * i], screen.bits);
  }
  // In strips that fit a request.
  const size_t row = width * 4, max_bytes = size_t{4} * xcb_get_maximum_request_length(connection_) - 64;
  const size_t rows = std::clamp<size_t>(max_bytes / row, 1, height);
  for (size_t y = 0; y < height; y += rows) {
    const size_t count = std::min(rows, height - y);
    xcb_put_image(connection_, XCB_IMAGE_FORMAT_Z_PIXMAP, buffer.pixmap, context_,
                  static_cast<std::uint16_t>(width), static_cast<std::uint16_t>(count), 0,
                  static_cast<std::int16_t>(y), 0, screen_->root_depth,
                  static_cast<std::uint32_t>(count * row),
                  reinterpret_cast<const std::uint8_t*>(pixels.data() + y * width));
  }
  buffer.held = picture;
  buffer.filled = true;
}

void X11Display::present(size_t index, const Buffer& buffer, nanoseconds at) {
  Output& output = outputs_[index];
  const auto period = static_cast<double>(period_of(screens_[index]).count());
  const nanoseconds earliest = std::max(at, monotonic_now() + kHaste);
  const double refreshes = std::ceil(static_cast<double>((earliest - output.last.time).count()) / period);
  const std::uint64_t target = output.last.msc + static_cast<std::uint64_t>(std::max(refreshes, 1.0));
  xcb_present_pixmap(connection_, output.window, buffer.pixmap, ++output.serial, 0, 0, 0, 0, 0, 0, 0,
                     XCB_PRESENT_OPTION_NONE, target, 0, 0, 0, nullptr);
}

absl::StatusOr<std::vector<X11Display::Completion>> X11Display::wait_for_all(nanoseconds due) {
  xcb_flush(connection_);
  std::vector<std::optional<Completion>> answers(outputs_.size());
  const nanoseconds deadline = std::max(due, monotonic_now()) + kPresentTimeout;
  for (;;) {
    bool all = true;
    for (size_t i = 0; i < outputs_.size(); ++i) {
      Output& output = outputs_[i];
      while (!answers[i]) {
        const auto event = owned(xcb_poll_for_special_event(connection_, output.events));
        if (event == nullptr) break;
        const auto* generic = reinterpret_cast<const xcb_present_generic_event_t*>(event.get());
        if (generic->evtype != XCB_PRESENT_COMPLETE_NOTIFY) continue;
        const auto* complete = reinterpret_cast<const xcb_present_complete_notify_event_t*>(event.get());
        if (complete->serial != output.serial) continue;
        output.last = {.msc = complete->msc,
                       .time = std::chrono::microseconds(static_cast<std::int64_t>(complete->ust))};
        answers[i] =
            Completion{.refresh = output.last, .skipped = complete->mode == XCB_PRESENT_COMPLETE_MODE_SKIP};
      }
      if (answers[i]) continue;
      all = false;
      if (monotonic_now() > deadline) {
        return absl::UnavailableError(
            fmt::format("monitor \"{}\" has not refreshed for {} s: is it switched on?", screens_[i].name,
                        kPresentTimeout.count()));
      }
    }
    if (all) break;
    // Drops all other events.
    while (owned(xcb_poll_for_event(connection_)) != nullptr) {
    }
    pollfd readable{.fd = xcb_get_file_descriptor(connection_), .events = POLLIN, .revents = 0};
    (void)::poll(&readable, 1, 20);
    if (xcb_connection_has_error(connection_) != 0)
      return absl::UnavailableError("the X server has disappeared");
  }
  std::vector<Completion> completions;
  for (const auto& answer : answers) completions.push_back(*answer);
  return completions;
}

absl::StatusOr<std::vector<Scanout>> X11Display::show(const std::vector<Picture>& pictures, nanoseconds at) {
  for (size_t i = 0; i < outputs_.size(); ++i) {
    Output& output = outputs_[i];
    const Picture picture = i < pictures.size() ? pictures[i] : nullptr;
    // The server may still read the pixmap on screen; the other one is free.
    fill(output.buffers[1 - output.on_screen], screens_[i], picture);
  }
  for (size_t i = 0; i < outputs_.size(); ++i) present(i, outputs_[i].buffers[1 - outputs_[i].on_screen], at);
  GW_ASSIGN_OR_RETURN(const std::vector<Completion> completions, wait_for_all(at));
  std::vector<Scanout> scanouts;
  for (size_t i = 0; i < outputs_.size(); ++i) {
    if (completions[i].skipped) {
      return absl::UnavailableError(
          fmt::format("the X server skipped a picture of monitor \"{}\": does another program show pictures "
                      "there?",
                      screens_[i].name));
    }
    outputs_[i].on_screen = 1 - outputs_[i].on_screen;
    scanouts.push_back({.start = completions[i].refresh.time, .uncertainty = kUncertainty});
  }
  return scanouts;
}

}  // namespace glasswing
