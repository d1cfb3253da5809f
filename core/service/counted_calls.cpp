#include "core/service/counted_calls.h"

#include <grpcpp/server_context.h>

#include <optional>
#include <string>

#include "core/security/call_shares.h"
#include "core/security/peer.h"

namespace glasswing {
namespace {

// The caller is known once the call's metadata are there.
class CountedCall final : public grpc::experimental::Interceptor {
 public:
  explicit CountedCall(grpc::experimental::ServerRpcInfo* info) : info_(info) {}
  ~CountedCall() override {
    if (caller_) call_shares().end(*caller_);
  }
  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(
            grpc::experimental::InterceptionHookPoints::POST_RECV_INITIAL_METADATA))
      begin(*info_->server_context()->auth_context());
    methods->Proceed();
  }

 private:
  void begin(const grpc::AuthContext& caller) {
    if (!shows_certificate(caller)) return;  // the gate counts no such calls
    caller_ = name_of(caller);
    call_shares().begin(*caller_, roles_of(caller));
  }

  grpc::experimental::ServerRpcInfo* const info_;
  std::optional<std::string> caller_;
};

}  // namespace

grpc::experimental::Interceptor* CountedCallsFactory::CreateServerInterceptor(
    grpc::experimental::ServerRpcInfo* info) {
  return new CountedCall(info);
}

}  // namespace glasswing
