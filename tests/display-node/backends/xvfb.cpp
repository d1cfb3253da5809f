#include "tests/display-node/backends/xvfb.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>
#include <xcb/xcb.h>

#include <chrono>
#include <cstdlib>
#include <thread>

namespace glasswing {
namespace {

bool answers(const std::string& name) {
  xcb_connection_t* connection = xcb_connect(name.c_str(), nullptr);
  const bool connected = xcb_connection_has_error(connection) == 0;
  xcb_disconnect(connection);
  return connected;
}

}  // namespace

std::unique_ptr<Xvfb> Xvfb::start(int depth) {
  static int started = 0;
  std::unique_ptr<Xvfb> server(new Xvfb());
  // A different number for every process and start.
  server->name_ = fmt::format(":{}", 1000 + (::getpid() * 4 + started++) % 30000);
  const std::string screen = fmt::format("640x400x{}", depth);
  server->process_ = ::fork();
  if (server->process_ == 0) {
    const int nowhere = ::open("/dev/null", O_RDWR);
    for (const int stream : {0, 1, 2}) ::dup2(nowhere, stream);
    ::execlp("Xvfb", "Xvfb", server->name_.c_str(), "-screen", "0", screen.c_str(), "-nolisten", "tcp",
             "-noreset", nullptr);
    ::_exit(127);
  }
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!answers(server->name_)) {
    const bool ended = ::waitpid(server->process_, nullptr, WNOHANG) != 0;
    if (ended) server->process_ = -1;
    if (ended || std::chrono::steady_clock::now() > deadline) return nullptr;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return server;
}

Xvfb::~Xvfb() {
  kill();
}

void Xvfb::kill() {
  if (process_ < 0) return;
  ::kill(process_, SIGKILL);
  ::waitpid(process_, nullptr, 0);
  process_ = -1;
  const std::string number = name_.substr(1);
  ::unlink(("/tmp/.X11-unix/X" + number).c_str());
  ::unlink(("/tmp/.X" + number + "-lock").c_str());
}

bool Xvfb::set_monitors(const std::vector<Monitor>& monitors) const {
  for (size_t i = 0; i < monitors.size(); ++i) {
    const Monitor& m = monitors[i];
    // The server's only output goes to the first.
    const std::string command =
        fmt::format("timeout 60 xrandr -d {} --setmonitor {} {}/100x{}/100+{}+{} {} > /dev/null", name_,
                    m.name, m.width, m.height, m.x, m.y, i == 0 ? "screen" : "none");
    if (std::system(command.c_str()) != 0) return false;
  }
  return true;
}

}  // namespace glasswing
