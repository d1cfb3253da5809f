#include "core/service/rpc_metrics.h"

#include <absl/status/status.h>

#include <chrono>
#include <string>

#include "core/telemetry/metrics.h"

namespace glasswing {
namespace {

using Clock = std::chrono::steady_clock;
using grpc::experimental::InterceptionHookPoints;

// "/glasswing.v1.WorkService/ClaimTile" becomes "WorkService/ClaimTile".
std::string short_name(const std::string& method) {
  static const std::string kOurs = "/glasswing.v1.";
  if (method.rfind(kOurs, 0) == 0) return method.substr(kOurs.size());
  return method.rfind('/', 0) == 0 ? method.substr(1) : method;
}

class RpcMetrics final : public grpc::experimental::Interceptor {
 public:
  explicit RpcMetrics(const std::string& method)
      : method_(short_name(method)),
        running_(gauge("glasswing_rpcs_running", "Calls that are being answered.", {{"method", method_}})) {
    running_.Increment();
  }

  // A call whose status was never sent was cancelled by its caller.
  ~RpcMetrics() override {
    if (!ended_) note_end(absl::StatusCode::kCancelled);
    running_.Decrement();
  }

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_STATUS))
      note_end(static_cast<absl::StatusCode>(methods->GetSendStatus().error_code()));
    methods->Proceed();
  }

 private:
  void note_end(absl::StatusCode code) {
    ended_ = true;
    counter("glasswing_rpcs_total", "Calls answered, by the code of the answer.",
            {{"method", method_}, {"code", absl::StatusCodeToString(code)}})
        .Increment();
    histogram("glasswing_rpc_seconds", "From a call's arrival to its answer; a stream's to its end.",
              {0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 60},
              {{"method", method_}})
        .Observe(std::chrono::duration<double>(Clock::now() - begun_).count());
  }

  const std::string method_;
  prometheus::Gauge& running_;
  const Clock::time_point begun_ = Clock::now();
  bool ended_ = false;
};

}  // namespace

grpc::experimental::Interceptor* RpcMetricsFactory::CreateServerInterceptor(
    grpc::experimental::ServerRpcInfo* info) {
  return new RpcMetrics(info->method());
}

}  // namespace glasswing
