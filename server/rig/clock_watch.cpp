#include "server/rig/clock_watch.h"

#include "core/base/time.h"

namespace glasswing {
namespace {

constexpr std::chrono::seconds kEvery(1);

}  // namespace

ClockWatch::ClockWatch(NodeRegistry& rig)
    : rig_(rig), thread_([this](std::stop_token stop) { run(std::move(stop)); }) {}

ClockWatch::~ClockWatch() = default;

void ClockWatch::look() {
  for (const v1::Node& node : rig_.nodes()) {
    if (node.kind() == v1::NODE_KIND_SOLVER) continue;
    std::unique_ptr<NodeLink>& link = links_[node.name()];
    if (!node.up()) {
      link.reset();  // its clock may be different when it comes back
      continue;
    }
    if (link == nullptr || link->address() != node.address()) link = std::make_unique<NodeLink>(node);
    if (!link->exchange_clocks(1).ok()) continue;
    const nanoseconds now = monotonic_now();
    const ClockReading reading = link->node_from_rig(now);
    rig_.note_clock(node.name(), reading.time - now, reading.error);
  }
}

void ClockWatch::run(std::stop_token stop) {
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    look();
    wake_.wait_for(lock, stop, kEvery, [] { return false; });
  }
}

}  // namespace glasswing
