#include "camera-node/services/stage_service.h"

namespace glasswing {

grpc::Status StageServiceImpl::MoveObject(grpc::ServerContext*, const v1::MoveObjectRequest* request,
                                          v1::MoveObjectResponse* response) {
  response->set_needs_operator(!stage_.move(request->present()));
  return grpc::Status::OK;
}

}  // namespace glasswing
