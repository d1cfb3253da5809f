// StageService over a Stage.
#pragma once

#include <mutex>

#include "camera-node/camera.h"
#include "core/service/joined_calls.h"
#include "glasswing/v1/stage_service.grpc.pb.h"

namespace glasswing {

class StageServiceImpl final : public v1::StageService::Service {
 public:
  explicit StageServiceImpl(Stage& stage) : stage_(stage) {}
  grpc::Status MoveObject(grpc::ServerContext*, const v1::MoveObjectRequest*,
                          v1::MoveObjectResponse*) override;

 private:
  Stage& stage_;
  std::mutex moving_;
  JoinedCalls<v1::MoveObjectResponse> moves_;
};

}  // namespace glasswing
