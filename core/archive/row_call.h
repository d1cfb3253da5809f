// One ReadRows call that receives messages as raw bytes.
#pragma once

#include <absl/status/status.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <functional>
#include <memory>
#include <stop_token>

#include "glasswing/v1/archive_service.pb.h"

namespace glasswing {

class RowCall {
 public:
  // A node that sends nothing for `patience` counts as gone. Requesting `stop` ends the call.
  RowCall(const std::shared_ptr<grpc::Channel>& channel, const v1::ReadRowsRequest& request,
          std::chrono::milliseconds patience, std::stop_token stop);
  ~RowCall();
  RowCall(const RowCall&) = delete;
  RowCall& operator=(const RowCall&) = delete;

  // False: no more messages; finish() returns the reason.
  bool next(grpc::ByteBuffer& message);
  grpc::Status finish();

 private:
  bool wait();  // waits for the pending operation; true if it succeeded

  const std::chrono::milliseconds patience_;
  grpc::ClientContext context_;
  grpc::CompletionQueue queue_;
  std::unique_ptr<grpc::GenericClientAsyncReaderWriter> call_;
  std::stop_callback<std::function<void()>> cancel_;
  bool silent_ = false, open_ = true;
};

}  // namespace glasswing
