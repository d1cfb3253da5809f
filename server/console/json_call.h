// Any call of any service in protobuf's JSON mapping: what a browser sends and gets.
#pragma once

#include <absl/status/statusor.h>
#include <google/protobuf/message.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <memory>
#include <string>

namespace glasswing {

// Of all that this program knows.
struct JsonMethod {
  const google::protobuf::MethodDescriptor* descriptor = nullptr;

  std::string name() const;  // "SessionService/GetSession"
  bool streams() const { return descriptor->server_streaming(); }

  // NOT_FOUND: there is none. UNIMPLEMENTED: it takes a stream of requests.
  static absl::StatusOr<JsonMethod> find(const std::string& service, const std::string& method);
};

// One call. It is cancelled if it still runs when this ends.
class JsonCall {
 public:
  // INVALID_ARGUMENT: `request` is not the method's message; says where. `client`: who calls, for people.
  static absl::StatusOr<std::unique_ptr<JsonCall>> start(const std::shared_ptr<grpc::Channel>& channel,
                                                         const JsonMethod& method, const std::string& request,
                                                         const std::string& client,
                                                         std::chrono::milliseconds timeout);
  ~JsonCall();

  enum class Got { kMessage, kNothingYet, kEnd };
  // The next answer goes to `message`.
  Got next(std::chrono::milliseconds wait, std::string& message);
  // How it ended, after kEnd. `peer` names who was called.
  absl::Status outcome(const std::string& peer) const;

 private:
  JsonCall(const std::shared_ptr<grpc::Channel>& channel, const JsonMethod& method);
  // Whether what was begun is through; `ok`, if it went well.
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

// {"code": "NOT_FOUND", "message": "…"}, and the status of HTTP that comes nearest.
std::string json_of(const absl::Status& status);
int http_status(const absl::Status& status);

}  // namespace glasswing
