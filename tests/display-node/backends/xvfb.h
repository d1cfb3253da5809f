// An X server without a screen, for one test program.
#pragma once

#include <memory>
#include <string>
#include <vector>

namespace glasswing {

class Xvfb {
 public:
  // 640 x 400 px. Null if Xvfb is not installed, lacks that depth, or does not start within ten seconds.
  static std::unique_ptr<Xvfb> start(int depth = 24);
  ~Xvfb();
  Xvfb(const Xvfb&) = delete;
  Xvfb& operator=(const Xvfb&) = delete;

  const std::string& name() const { return name_; }  // ":57"
  struct Monitor {
    std::string name;
    int x, y, width, height;  // px
  };
  // Replaces its monitor; false if xrandr is missing.
  bool set_monitors(const std::vector<Monitor>& monitors) const;
  void kill();

 private:
  Xvfb() = default;
  int process_ = -1;
  std::string name_;
};

}  // namespace glasswing
