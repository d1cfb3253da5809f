#include "core/file/fault_point.h"

#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

namespace glasswing {
namespace {

struct Fault {
  std::string point;
  int signal = 0;
  int left = 1;  // visits until the fault triggers
};

Fault parse() {
  const char* text = std::getenv("GLASSWING_FAULT");
  if (text == nullptr) return {};
  const std::string fault = text;
  const size_t equals = fault.find('='), at = fault.find('@', equals);
  if (equals == std::string::npos) return {};
  const std::string action = fault.substr(equals + 1, at == std::string::npos ? at : at - equals - 1);
  return {.point = fault.substr(0, equals),
          .signal = action == "kill"   ? SIGKILL
                    : action == "stop" ? SIGSTOP
                                       : 0,
          .left = at == std::string::npos ? 1 : std::atoi(fault.c_str() + at + 1)};
}

using Act = std::function<void(std::string_view)>;

std::atomic<bool> acting = false;
std::mutex act_mutex;
std::shared_ptr<const Act> act_at;  // guarded by act_mutex

void act(std::string_view name) {
  std::shared_ptr<const Act> now;
  {
    const std::lock_guard lock(act_mutex);
    now = act_at;
  }
  if (now != nullptr) (*now)(name);
}

}  // namespace

void at_fault_points(Act wanted) {
  const std::lock_guard lock(act_mutex);
  acting = wanted != nullptr;
  act_at = wanted == nullptr ? nullptr : std::make_shared<const Act>(std::move(wanted));
}

void fault_point(std::string_view name) {
  if (acting) act(name);
  static const Fault fault = parse();
  static std::atomic<int> left = fault.left;
  if (name == fault.point && --left == 0) ::kill(::getpid(), fault.signal);
}

}  // namespace glasswing
