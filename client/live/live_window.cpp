#include "client/live/live_window.h"

#include <fmt/format.h>
#include <xcb/xcb.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <vector>

#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr xcb_keysym_t kEscape = 0xff1b, kQ = 'q';

struct Disconnect {
  void operator()(xcb_connection_t* connection) const { xcb_disconnect(connection); }
};
struct Free {
  void operator()(void* reply) const { std::free(reply); }
};
using Connection = std::unique_ptr<xcb_connection_t, Disconnect>;
template <typename Reply>
using Owned = std::unique_ptr<Reply, Free>;

absl::StatusOr<Connection> connect() {
  Connection connection(xcb_connect(nullptr, nullptr));
  if (xcb_connection_has_error(connection.get()) != 0) {
    const char* const display = std::getenv("DISPLAY");
    return absl::UnavailableError(
        fmt::format("there is no X display for a window (DISPLAY is {}); choose another --output: a file, a "
                    "directory DIR/, or - for a stream",
                    display == nullptr ? "not set" : display));
  }
  const xcb_screen_t* const screen = xcb_setup_roots_iterator(xcb_get_setup(connection.get())).data;
  if (screen->root_depth != 24)
    return absl::UnavailableError(
        fmt::format("the X display has {} bits a pixel; a window needs 24", screen->root_depth));
  return connection;
}

class Window final : public LiveOutput {
 public:
  Window(Connection connection, int width_px, int height_px)
      : connection_(std::move(connection)),
        width_px_(width_px),
        height_px_(height_px),
        pixels_(static_cast<size_t>(width_px) * height_px) {
    xcb_connection_t* const x = connection_.get();
    const xcb_screen_t* const screen = xcb_setup_roots_iterator(xcb_get_setup(x)).data;
    window_ = xcb_generate_id(x);
    graphics_ = xcb_generate_id(x);
    const std::uint32_t values[] = {screen->black_pixel, XCB_EVENT_MASK_KEY_PRESS};
    xcb_create_window(x, screen->root_depth, window_, screen->root, 0, 0,
                      static_cast<std::uint16_t>(width_px), static_cast<std::uint16_t>(height_px), 0,
                      XCB_WINDOW_CLASS_INPUT_OUTPUT, screen->root_visual,
                      XCB_CW_BACK_PIXEL | XCB_CW_EVENT_MASK, values);
    xcb_create_gc(x, graphics_, window_, 0, nullptr);
    constexpr std::string_view kTitle = "glasswing live";
    xcb_change_property(x, XCB_PROP_MODE_REPLACE, window_, XCB_ATOM_WM_NAME, XCB_ATOM_STRING, 8,
                        kTitle.size(), kTitle.data());
    const xcb_atom_t protocols = atom("WM_PROTOCOLS");
    delete_window_ = atom("WM_DELETE_WINDOW");
    xcb_change_property(x, XCB_PROP_MODE_REPLACE, window_, protocols, XCB_ATOM_ATOM, 32, 1, &delete_window_);
    const xcb_setup_t* const setup = xcb_get_setup(x);
    const auto count = static_cast<std::uint8_t>(setup->max_keycode - setup->min_keycode + 1);
    first_key_ = setup->min_keycode;
    keys_.reset(
        xcb_get_keyboard_mapping_reply(x, xcb_get_keyboard_mapping(x, setup->min_keycode, count), nullptr));
    xcb_map_window(x, window_);
    xcb_flush(x);
  }

  absl::Status show(std::span<const std::uint8_t> picture) override {
    for (size_t i = 0; i < pixels_.size(); ++i) {
      pixels_[i] =
          static_cast<std::uint32_t>(picture[3 * i] << 16 | picture[3 * i + 1] << 8 | picture[3 * i + 2]);
    }
    xcb_connection_t* const x = connection_.get();
    // As many rows per request as fit.
    const size_t row_bytes = 4 * static_cast<size_t>(width_px_);
    const size_t max_bytes = 4 * static_cast<size_t>(xcb_get_maximum_request_length(x)) - 64;
    const int rows = static_cast<int>(std::max<size_t>(1, max_bytes / row_bytes));
    for (int y = 0; y < height_px_; y += rows) {
      const int count = std::min(rows, height_px_ - y);
      const auto* const from =
          reinterpret_cast<const std::uint8_t*>(pixels_.data()) + row_bytes * static_cast<size_t>(y);
      xcb_put_image(x, XCB_IMAGE_FORMAT_Z_PIXMAP, window_, graphics_, static_cast<std::uint16_t>(width_px_),
                    static_cast<std::uint16_t>(count), 0, static_cast<std::int16_t>(y), 0, 24,
                    static_cast<std::uint32_t>(row_bytes * static_cast<size_t>(count)), from);
    }
    // The server answers in order, so this reply means that the picture is in the window.
    const Owned<xcb_get_input_focus_reply_t> done(
        xcb_get_input_focus_reply(x, xcb_get_input_focus(x), nullptr));
    if (done == nullptr) return absl::UnavailableError("the X display went away");
    return absl::OkStatus();
  }

  bool is_closed() override {
    while (const Owned<xcb_generic_event_t> event{xcb_poll_for_event(connection_.get())}) {
      const int kind = event->response_type & 0x7f;
      if (kind == XCB_CLIENT_MESSAGE) {
        const auto* const message = reinterpret_cast<const xcb_client_message_event_t*>(event.get());
        closed_ = closed_ || message->data.data32[0] == delete_window_;
      } else if (kind == XCB_KEY_PRESS) {
        const xcb_keysym_t key = key_of(reinterpret_cast<const xcb_key_press_event_t*>(event.get())->detail);
        closed_ = closed_ || key == kEscape || key == kQ;
      }
    }
    return closed_ || xcb_connection_has_error(connection_.get()) != 0;
  }

 private:
  xcb_atom_t atom(std::string_view name) {
    xcb_connection_t* const x = connection_.get();
    const Owned<xcb_intern_atom_reply_t> reply(xcb_intern_atom_reply(
        x, xcb_intern_atom(x, 0, static_cast<std::uint16_t>(name.size()), name.data()), nullptr));
    return reply == nullptr ? xcb_atom_t{XCB_ATOM_NONE} : reply->atom;
  }
  // The key's symbol without modifiers.
  xcb_keysym_t key_of(xcb_keycode_t code) const {
    if (keys_ == nullptr) return 0;
    return xcb_get_keyboard_mapping_keysyms(keys_.get())[(code - first_key_) * keys_->keysyms_per_keycode];
  }

  Connection connection_;
  const int width_px_, height_px_;
  std::vector<std::uint32_t> pixels_;
  xcb_window_t window_ = 0;
  xcb_gcontext_t graphics_ = 0;
  xcb_atom_t delete_window_ = 0;
  xcb_keycode_t first_key_ = 0;
  Owned<xcb_get_keyboard_mapping_reply_t> keys_;
  bool closed_ = false;
};

}  // namespace

absl::Status LiveWindow::check_display() {
  return connect().status();
}

absl::StatusOr<std::unique_ptr<LiveOutput>> LiveWindow::open(int width_px, int height_px) {
  GW_ASSIGN_OR_RETURN(Connection connection, connect());
  return std::make_unique<Window>(std::move(connection), width_px, height_px);
}

}  // namespace glasswing
