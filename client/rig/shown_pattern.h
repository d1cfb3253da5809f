// A test pattern on the rig's monitors.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <string>
#include <vector>

#include "client/cli/rpc.h"
#include "glasswing/v1/node_service.grpc.pb.h"
#include "glasswing/v1/rig_service.grpc.pb.h"

namespace glasswing {

// Shows the pattern, which holds the rig, until destroyed; then the rig is free.
class ShownPattern {
 public:
  // `monitors`: names; empty: all.
  ShownPattern(const Client& client, const std::string& pattern, const std::vector<std::string>& monitors);
  ~ShownPattern();
  ShownPattern(const ShownPattern&) = delete;
  ShownPattern& operator=(const ShownPattern&) = delete;

  // Waits until the pattern is visible, and returns the monitors that show it. Errors are those of
  // ShowPattern.
  absl::StatusOr<std::vector<std::string>> wait();
  // Waits until the server ends the pattern, and returns why.
  absl::Status wait_for_end();

 private:
  // A cancelled call ends here before the server notices and frees the rig.
  void wait_until_free() const;

  const Peer<v1::RigService> server_;
  const Peer<v1::NodeService> nodes_;
  const std::string pattern_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::ShowPatternResponse>> reader_;
  bool ended_ = false;
};

}  // namespace glasswing
