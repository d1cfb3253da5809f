// Measures the offsets of the display and camera nodes' clocks from rig time, continuously, so that people
// see a clock problem before it affects a capture. Captures make their own measurements.
#pragma once

#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "server/rig/node_registry.h"
#include "server/rig/rig_link.h"

namespace glasswing {

class ClockWatch {
 public:
  explicit ClockWatch(NodeRegistry& rig);
  ~ClockWatch();

 private:
  void run(std::stop_token stop);
  void look();

  NodeRegistry& rig_;
  std::map<std::string, std::unique_ptr<NodeLink>> links_;  // by name
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread thread_;
};

}  // namespace glasswing
