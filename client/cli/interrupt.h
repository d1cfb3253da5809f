// Ctrl-C during work that has to be left in order.
#pragma once

#include <functional>
#include <thread>

namespace glasswing {

// While one lives, the first Ctrl-C only asks: interrupted() is true from then on, and `cancel` is called, on
// a thread of its own. A second one ends the process at once, as the first does where none lives.
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

// Whether Ctrl-C came while the Interruptible lived that began last, with those within it.
bool interrupted();

}  // namespace glasswing
