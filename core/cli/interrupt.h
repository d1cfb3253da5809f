// Ctrl-C during work that must be cleaned up.
#pragma once

#include <functional>
#include <thread>

namespace glasswing {

// While one exists, the first Ctrl-C is a request: interrupted() becomes true and `cancel` is called on a
// separate thread. A second Ctrl-C ends the process at once, as any Ctrl-C does when none exists.
class Interruptible {
 public:
  explicit Interruptible(std::function<void()> cancel = nullptr);
  ~Interruptible();
  Interruptible(const Interruptible&) = delete;
  Interruptible& operator=(const Interruptible&) = delete;

 private:
  int ended_ = -1;
  std::jthread waiting_;
};

// True if Ctrl-C was pressed since the newest outermost Interruptible was made.
bool interrupted();

}  // namespace glasswing
