// One streaming call of an ArchiveService, whose messages are received as raw bytes.
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/message_lite.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>

namespace glasswing {

class RawCall {
 public:
  // `method`: its name, such as "ReadRows". A node that sends nothing for `patience` counts as unreachable.
  // Requesting `stop` ends the call.
  RawCall(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
          const google::protobuf::MessageLite& request, std::chrono::milliseconds patience,
          std::stop_token stop);
  ~RawCall();
  RawCall(const RawCall&) = delete;
  RawCall& operator=(const RawCall&) = delete;

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
