// MatteService: mattes that were solved elsewhere.
#pragma once

#include "glasswing/v1/matte_service.grpc.pb.h"
#include "server/services/server.h"

namespace glasswing {

class MatteServiceImpl final : public v1::MatteService::Service {
 public:
  explicit MatteServiceImpl(Server& server) : server_(server) {}
  grpc::Status PutMatte(grpc::ServerContext*, grpc::ServerReader<v1::PutMatteRequest>*,
                        v1::PutMatteResponse*) override;

 private:
  Server& server_;
};

}  // namespace glasswing
