// Calls of any service, with messages in protobuf's JSON mapping, as a browser sends and receives them.
#pragma once

#include <absl/status/statusor.h>
#include <google/protobuf/message.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <memory>
#include <string>

#include "console/routes/server_link.h"

namespace glasswing {

// A method that people may call.
struct JsonMethod {
  const google::protobuf::MethodDescriptor* descriptor = nullptr;

  std::string name() const;  // "SessionService/GetSession"
  bool streams() const { return descriptor->server_streaming(); }

  // NOT_FOUND: no such method. UNIMPLEMENTED: it takes a stream of requests.
  static absl::StatusOr<JsonMethod> find(const std::string& service, const std::string& method);
};

// One call, cancelled on destruction if still running.
class JsonCall {
 public:
  // `login`: of the person for whom the server is called; null for calls to nodes. `hold`: the token of the
  // hold that the call belongs to; empty: none. INVALID_ARGUMENT: `request` is not the method's message; says
  // where.
  static absl::StatusOr<std::unique_ptr<JsonCall>> start(const std::shared_ptr<grpc::Channel>& channel,
                                                         const JsonMethod& method, const std::string& request,
                                                         const Login* login, const std::string& hold,
                                                         std::chrono::milliseconds timeout);
  ~JsonCall();

  enum class Got { kMessage, kNothingYet, kEnd };
  // Waits for the next answer and stores it to `message`.
  Got next(std::chrono::milliseconds wait, std::string& message);
  // The final status, after kEnd. `peer` names the called program.
  absl::Status outcome(const std::string& peer) const;

 private:
  JsonCall(const std::shared_ptr<grpc::Channel>& channel, const JsonMethod& method);
  // Waits for the pending operation; false on timeout. `ok`: the operation succeeded.
  bool is_through(std::chrono::system_clock::time_point deadline, bool& ok);
  void finish();

  const JsonMethod method_;
  grpc::GenericStub stub_;
  grpc::ClientContext context_;
  grpc::CompletionQueue queue_;
  std::unique_ptr<grpc::GenericClientAsyncReaderWriter> call_;
  grpc::ByteBuffer buffer_;
  bool reading_ = false, finished_ = false;
  grpc::Status status_;
};

}  // namespace glasswing
