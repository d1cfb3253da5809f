#include "core/service/connection_watch.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <grpcpp/server_context.h>
#include <linux/sockios.h>
#include <linux/tcp.h>
#include <malloc.h>
#include <netinet/in.h>
#include <spdlog/spdlog.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <condition_variable>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "core/telemetry/metrics.h"

namespace glasswing {
namespace {

constexpr std::chrono::milliseconds kInterval(50);
constexpr int kLooksBetweenTrims = 10;

// Null: it is no longer a connection.
std::optional<std::uint64_t> cookie_of(int fd) {
  std::uint64_t cookie = 0;
  socklen_t size = sizeof cookie;
  if (::getsockopt(fd, SOL_SOCKET, SO_COOKIE, &cookie, &size) != 0) return std::nullopt;
  return cookie;
}

// Bytes that the program has read from a connection.
std::int64_t read_from(int fd) {
  tcp_info info{};
  socklen_t size = sizeof info;
  int waiting = 0;  // asked second: what arrives meanwhile must not count as read
  if (::getsockopt(fd, IPPROTO_TCP, TCP_INFO, &info, &size) != 0 || ::ioctl(fd, SIOCINQ, &waiting) != 0)
    return 0;
  return static_cast<std::int64_t>(info.tcpi_bytes_received) - waiting;
}

// What a peer sent since its last progress.
using Unfinished = std::pair<std::int64_t, std::string>;

// The peer's address as gRPC writes it.
std::string peer_of(int fd) {
  sockaddr_storage name{};
  socklen_t size = sizeof name;
  if (::getpeername(fd, reinterpret_cast<sockaddr*>(&name), &size) != 0) return "";
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (name.ss_family == AF_INET) {
    const auto& ip = reinterpret_cast<const sockaddr_in&>(name);
    ::inet_ntop(AF_INET, &ip.sin_addr, text.data(), text.size());
    return fmt::format("ipv4:{}:{}", text.data(), ntohs(ip.sin_port));
  }
  const auto& ip = reinterpret_cast<const sockaddr_in6&>(name);
  if (IN6_IS_ADDR_V4MAPPED(&ip.sin6_addr)) {
    ::inet_ntop(AF_INET, &ip.sin6_addr.s6_addr[12], text.data(), text.size());
    return fmt::format("ipv4:{}:{}", text.data(), ntohs(ip.sin6_port));
  }
  ::inet_ntop(AF_INET6, &ip.sin6_addr, text.data(), text.size());
  return fmt::format("ipv6:%5B{}%5D:{}", text.data(), ntohs(ip.sin6_port));
}

class Progress final : public grpc::experimental::Interceptor {
 public:
  Progress(std::shared_ptr<ConnectionWatch> watch, grpc::experimental::ServerRpcInfo* info)
      : watch_(std::move(watch)), info_(info) {}
  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    using grpc::experimental::InterceptionHookPoints;
    const auto at = [&](InterceptionHookPoints point) { return methods->QueryInterceptionHookPoint(point); };
    const bool begins = at(InterceptionHookPoints::POST_RECV_INITIAL_METADATA);
    if (begins) peer_ = info_->server_context()->peer();
    // Sent messages count because their acknowledgements are received.
    if (begins || at(InterceptionHookPoints::POST_RECV_MESSAGE) ||
        at(InterceptionHookPoints::POST_SEND_MESSAGE))
      watch_->note_progress(peer_);
    methods->Proceed();
  }

 private:
  const std::shared_ptr<ConnectionWatch> watch_;
  grpc::experimental::ServerRpcInfo* const info_;
  std::string peer_;
};

}  // namespace

ConnectionWatch::ConnectionWatch(std::int64_t max_bytes)
    : max_bytes_(max_bytes), thread_([this](const std::stop_token& stop) {
        std::mutex mutex;
        std::condition_variable_any woken;
        std::unique_lock lock(mutex);
        while (!woken.wait_for(lock, stop, kInterval, [&] { return stop.stop_requested(); })) {
          look();
          give_back_memory();
        }
      }) {}

ConnectionWatch::~ConnectionWatch() = default;

void ConnectionWatch::add(int fd) {
  const std::string peer = peer_of(fd);
  const std::optional<std::uint64_t> cookie = cookie_of(fd);
  if (peer.empty() || !cookie) return;
  const std::lock_guard lock(mutex_);
  connections_[peer] = {.fd = fd, .cookie = *cookie};
}

void ConnectionWatch::note_progress(const std::string& peer) {
  const std::lock_guard lock(mutex_);
  const auto found = connections_.find(peer);
  if (found != connections_.end()) found->second.progressed = true;
}

void ConnectionWatch::look() {
  const std::lock_guard lock(mutex_);
  std::map<std::string, std::vector<Unfinished>> addresses;
  for (auto at = connections_.begin(); at != connections_.end();) {
    Connection& each = at->second;
    if (cookie_of(each.fd) != each.cookie) {
      at = connections_.erase(at);
      continue;
    }
    const std::int64_t read = read_from(each.fd);
    if (std::exchange(each.progressed, false)) each.read = read;
    if (read > each.read)
      addresses[at->first.substr(0, at->first.rfind(':'))].push_back({read - each.read, at->first});
    ++at;
  }
  for (auto& [address, unfinished] : addresses) {
    std::sort(unfinished.begin(), unfinished.end(), std::greater());
    std::int64_t of_address = 0;
    for (const auto& [bytes, peer] : unfinished) of_address += bytes;
    for (const auto& [bytes, peer] : unfinished) {
      if (bytes <= max_bytes_ && of_address <= 2 * max_bytes_) break;
      of_address -= bytes;
      drop(peer, bytes);
    }
  }
}

// gRPC frees the data of a dropped connection when it notices.
void ConnectionWatch::give_back_memory() {
  if (looks_to_trim_ > 0 && --looks_to_trim_ % kLooksBetweenTrims == 0) ::malloc_trim(0);
}

void ConnectionWatch::drop(const std::string& peer, std::int64_t bytes) {
  spdlog::warn("a connection is dropped: it sent {} bytes without a call or a whole message peer={}", bytes,
               peer);
  counter("glasswing_connections_dropped_total", "Connections that sent too much without a call or message.")
      .Increment();
  // Resets the connection, and drops what was received but not read. After shutdown() alone the peer could
  // wait for minutes with the data that it still has to send.
  const sockaddr nobody{.sa_family = AF_UNSPEC, .sa_data = {}};
  static_cast<void>(::connect(connections_.at(peer).fd, &nobody, sizeof nobody));
  connections_.erase(peer);
  looks_to_trim_ = 4 * kLooksBetweenTrims;
}

grpc::experimental::Interceptor* ProgressFactory::CreateServerInterceptor(
    grpc::experimental::ServerRpcInfo* info) {
  return new Progress(watch_, info);
}

}  // namespace glasswing
