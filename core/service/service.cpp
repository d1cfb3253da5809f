#include "core/service/service.h"

#include <fmt/format.h>
#include <grpc/compression.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/impl/server_builder_option.h>
#include <grpcpp/impl/server_builder_plugin.h>
#include <grpcpp/resource_quota.h>
#include <sys/resource.h>

#include <algorithm>

#include "core/base/address.h"
#include "core/base/status.h"
#include "core/security/call_shares.h"
#include "core/security/tls.h"
#include "core/service/connection_watch.h"
#include "core/service/counted_calls.h"
#include "core/service/listener.h"
#include "core/service/rpc_metrics.h"
#include "core/service/stalled_calls.h"
#include "core/telemetry/logs.h"
#include "glasswing/v1/clock_service.grpc.pb.h"
#include "glasswing/v1/log_service.grpc.pb.h"

namespace glasswing {
namespace {

// The library of the reflection service adds it to every server of a process that it is linked to.
class WithoutReflection final : public grpc::ServerBuilderOption {
 public:
  void UpdateArguments(grpc::ChannelArguments*) override {}
  void UpdatePlugins(std::vector<std::unique_ptr<grpc::ServerBuilderPlugin>>* plugins) override {
    std::erase_if(*plugins, [](const auto& plugin) { return plugin->name() == "proto_server_reflection"; });
  }
};

class NodeClockService final : public v1::ClockService::Service {
 public:
  explicit NodeClockService(const NodeClock& clock) : clock_(clock) {}

 private:
  grpc::Status Exchange(grpc::ServerContext*, const v1::ExchangeRequest*,
                        v1::ExchangeResponse* response) override {
    response->set_received_ns(clock_.now().count());
    response->set_sent_ns(clock_.now().count());
    return grpc::Status::OK;
  }

  const NodeClock clock_;
};

class DaemonLogService final : public v1::LogService::Service {
  grpc::Status ListWarnings(grpc::ServerContext*, const v1::ListWarningsRequest*,
                            v1::ListWarningsResponse* response) override {
    for (LoggedLine& logged : logged_warnings()) {
      v1::LogLine& line = *response->add_lines();
      line.set_time(std::move(logged.time));
      line.set_level(std::move(logged.level));
      line.set_text(std::move(logged.text));
    }
    return grpc::Status::OK;
  }
};

bool is_every_host(const std::string& host) {
  return host == "0.0.0.0" || host == "::";
}

constexpr int kMaxMetadataBytes = 16 << 10;  // of a call; its path and our own metadata have some hundred
// Only "identity": gRPC expands a compressed message before it looks at its size.
constexpr int kUncompressed = 1 << GRPC_COMPRESS_NONE;

void set_limits(grpc::ServerBuilder& builder, const ServiceLimits& limits) {
  builder.AddChannelArgument(GRPC_ARG_MAX_METADATA_SIZE, kMaxMetadataBytes);
  builder.AddChannelArgument(GRPC_COMPRESSION_CHANNEL_ENABLED_ALGORITHMS_BITSET, kUncompressed);
  // A client may ping once in ten seconds while it has calls (dial() does in 20); after two pings too many it
  // is disconnected.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 10000);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PING_STRIKES, 2);
  // For peers that connect and stay silent; without TLS, that send no settings.
  builder.AddChannelArgument("grpc.server_handshake_timeout_ms", static_cast<int>(limits.handshake.count()));
  // A peer whose machine vanished is detected within 20 s, and its calls end.
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, 10000);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10000);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, static_cast<int>(limits.idle.count()));
  // Otherwise windows grow to megabytes that a busy daemon holds unread, and ConnectionWatch cannot tell from
  // a flood. A message that is waited for gets a window of its size all the same.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_BDP_PROBE, 0);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, limits.calls_of_a_connection);
  builder.SetMaxReceiveMessageSize(limits.message_bytes);
  grpc::ResourceQuota quota("service");
  quota.Resize(limits.buffer_bytes).SetMaxThreads(limits.calls);
  builder.SetResourceQuota(quota);
}

// Raises the limit of open files as far as the system allows, up to more than any rig needs. Returns the
// limit.
int allow_descriptors() {
  constexpr rlim_t kEnough = 65536;
  rlimit limit{};
  ::getrlimit(RLIMIT_NOFILE, &limit);
  if (limit.rlim_cur < kEnough) {
    limit.rlim_cur = std::min(limit.rlim_max, kEnough);
    ::setrlimit(RLIMIT_NOFILE, &limit);
  }
  return static_cast<int>(std::min(limit.rlim_cur, kEnough));
}

}  // namespace

absl::Status check_advertised(const ListenOptions& options) {
  const std::string& advertised = options.advertised;
  const absl::StatusOr<Address> listening = parse_address(options.address);
  if (!listening.ok()) {
    return absl::InvalidArgumentError(fmt::format("--listen: {}", std::string(listening.status().message())));
  }
  if (advertised.empty()) {
    if (!is_every_host(listening->host)) return absl::OkStatus();
    return absl::InvalidArgumentError(
        fmt::format("--listen is {}, which is every address of this machine; set --advertise HOST:PORT, by "
                    "which the others call it",
                    options.address));
  }
  const absl::StatusOr<Address> called = parse_address(advertised);
  if (called.ok() && called->port > 0 && !is_every_host(called->host)) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format(
      "--advertise is {}; it must be the HOST:PORT by which the others call this machine", advertised));
}

grpc::Status to_grpc(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  return grpc::Status(static_cast<grpc::StatusCode>(status.code()), std::string(status.message()));
}

absl::Status from_grpc(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  return absl::Status(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
}

absl::Status from_grpc(const grpc::Status& status, const std::string& peer) {
  if (const std::string failure = tls_failure(status, peer); !failure.empty())
    return absl::UnavailableError(failure);
  // gRPC's messages about an unreachable peer speak of sockets; ours name the peer.
  switch (status.error_code()) {
    case grpc::StatusCode::OK:
      return absl::OkStatus();
    case grpc::StatusCode::UNAVAILABLE:
      return absl::UnavailableError(peer + " does not answer");
    case grpc::StatusCode::DEADLINE_EXCEEDED:
      if (status.error_message().find("Deadline Exceeded") != std::string::npos) {
        return absl::DeadlineExceededError(peer + " did not answer in time");
      }
      return from_grpc(status);
    default:
      return from_grpc(status);
  }
}

std::shared_ptr<grpc::Channel> dial(const std::string& address, Roles roles) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  // Despite its name this is the connection timeout; a busy machine, or TLS, takes a while.
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 2000);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 1000);
  // A restarted peer must not be called through a shared connection that is still backing off.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetInt(GRPC_ARG_MAX_METADATA_SIZE, kMaxMetadataBytes);
  arguments.SetInt(GRPC_COMPRESSION_CHANNEL_ENABLED_ALGORITHMS_BITSET, kUncompressed);
  // A call to a machine that vanished ends within 30 s. Not without calls, which servers treat as a flood.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 20000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10000);
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // With its scheme: a host such as "unix" is not one.
  return grpc::CreateCustomChannel("dns:///" + address, credentials_for(address, roles), arguments);
}

void set_deadline(grpc::ClientContext& context, std::chrono::milliseconds timeout) {
  context.set_deadline(std::chrono::system_clock::now() + timeout);
}

absl::StatusOr<std::unique_ptr<ServiceHost>> ServiceHost::start(const ListenOptions& options,
                                                                const std::vector<grpc::Service*>& services,
                                                                PrincipalOf principal_of) {
  GW_ASSIGN_OR_RETURN(const auto credentials,
                      listening_credentials(options.address, std::move(principal_of)));
  GW_RETURN_IF_ERROR(check_advertised(options));
  GW_ASSIGN_OR_RETURN(std::unique_ptr<Listener> listener, Listener::open(options.address));
  const ServiceLimits& limits = options.limits;
  call_shares().set_max_calls(limits.calls);
  std::unique_ptr<ServiceHost> self(new ServiceHost);
  self->clock_ = std::make_unique<NodeClockService>(options.clock);
  self->log_ = std::make_unique<DaemonLogService>();
  grpc::EnableDefaultHealthCheckService(true);
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();  // if it is not linked so
  grpc::ServerBuilder builder;
  if (!options.reflection) builder.SetOption(std::make_unique<WithoutReflection>());
  auto acceptor = builder.experimental().AddExternalConnectionAcceptor(
      grpc::ServerBuilder::experimental_type::ExternalConnectionType::FROM_FD, credentials);
  set_limits(builder, limits);
  builder.RegisterService(self->clock_.get());
  builder.RegisterService(self->log_.get());
  for (grpc::Service* service : services) builder.RegisterService(service);
  std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> interceptors;
  const auto watch = std::make_shared<ConnectionWatch>(std::int64_t{limits.message_bytes} * 5 / 4);
  interceptors.push_back(std::make_unique<ProgressFactory>(watch));
  interceptors.push_back(std::make_unique<CountedCallsFactory>());
  interceptors.push_back(std::make_unique<RpcMetricsFactory>());
  interceptors.push_back(std::make_unique<StalledCallsFactory>(limits.stalled));
  builder.experimental().SetInterceptorCreators(std::move(interceptors));
  self->server_ = builder.BuildAndStart();
  if (self->server_ == nullptr)
    return absl::InternalError(fmt::format("cannot serve on {}", options.address));
  self->listener_ = std::move(listener);
  self->listener_->start(std::move(acceptor), watch, std::min(limits.descriptors, allow_descriptors() / 2));
  self->address_ = text_of({.host = parse_address(options.address)->host, .port = self->listener_->port()});
  self->advertised_ = options.advertised.empty() ? self->address_ : options.advertised;
  self->server_->GetHealthCheckService()->SetServingStatus(true);
  return self;
}

bool ServiceHost::answers(std::chrono::milliseconds within) const {
  if (!listener_->takes_connections(within)) return false;
  grpc::ClientContext context;
  set_deadline(context, within);
  v1::ExchangeResponse response;
  const auto clock = v1::ClockService::NewStub(to_itself());
  // RESOURCE_EXHAUSTED is an answer too.
  return clock->Exchange(&context, {}, &response).error_code() != grpc::StatusCode::DEADLINE_EXCEEDED;
}

std::shared_ptr<grpc::Channel> ServiceHost::to_itself() const {
  return server_->InProcessChannel(grpc::ChannelArguments());
}

ServiceHost::~ServiceHost() {
  stop(std::chrono::milliseconds(0));
}

void ServiceHost::stop(std::chrono::milliseconds grace) {
  if (server_ == nullptr) return;
  server_->GetHealthCheckService()->SetServingStatus(false);
  listener_->stop();
  server_->Shutdown(std::chrono::system_clock::now() + grace);
  server_->Wait();
  server_ = nullptr;
}

}  // namespace glasswing
