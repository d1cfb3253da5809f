// One ReadRows call, as bytes: what a node sends, message by message.
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
  // A node that sends nothing for `patience` is taken for gone. Once `stop` was asked for, the call ends.
  RowCall(const std::shared_ptr<grpc::Channel>& channel, const v1::ReadRowsRequest& request,
          std::chrono::milliseconds patience, std::stop_token stop);
  ~RowCall();
  RowCall(const RowCall&) = delete;
  RowCall& operator=(const RowCall&) = delete;

  // False: there are no more; finish() says why.
  bool next(grpc::ByteBuffer& message);
  grpc::Status finish();

 private:
  bool wait();  // for the one operation under way; whether it succeeded

  const std::chrono::milliseconds patience_;
  grpc::ClientContext context_;
  grpc::CompletionQueue queue_;
  std::unique_ptr<grpc::GenericClientAsyncReaderWriter> call_;
  std::stop_callback<std::function<void()>> cancel_;
  bool silent_ = false, open_ = true;
};

}  // namespace glasswing
