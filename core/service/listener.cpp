#include "core/service/listener.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

#include <cerrno>
#include <chrono>
#include <cstring>

#include "core/base/address.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr int kBacklog = 512;
constexpr int kUnanswered_ms = 20000;  // until the kernel drops a peer that acknowledges nothing

absl::StatusOr<SocketAddresses> addresses_of(const std::string& address) {
  absl::StatusOr<SocketAddresses> found = socket_addresses(address, AI_PASSIVE);
  if (found.ok()) return found;
  return absl::InvalidArgumentError(fmt::format("--listen is {}; it must be HOST:PORT of this machine: {}",
                                                address, std::string(found.status().message())));
}

int port_of(const sockaddr_storage& name) {
  return ntohs(name.ss_family == AF_INET6 ? reinterpret_cast<const sockaddr_in6&>(name).sin6_port
                                          : reinterpret_cast<const sockaddr_in&>(name).sin_port);
}

void set_port(sockaddr* name, int port) {
  auto& field = name->sa_family == AF_INET6 ? reinterpret_cast<sockaddr_in6*>(name)->sin6_port
                                            : reinterpret_cast<sockaddr_in*>(name)->sin_port;
  field = htons(static_cast<std::uint16_t>(port));
}

// Not open on failure; the reason is in errno.
Descriptor listening_socket(const addrinfo& at) {
  Descriptor socket(::socket(at.ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!socket.is_open()) return socket;
  const int on = 1, off = 0;
  // A restarted daemon gets its port back at once; a second daemon on the same port still fails.
  ::setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (at.ai_family == AF_INET6) ::setsockopt(socket.get(), IPPROTO_IPV6, IPV6_V6ONLY, &off, sizeof off);
  // Accepted sockets inherit these.
  ::setsockopt(socket.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  ::setsockopt(socket.get(), IPPROTO_TCP, TCP_USER_TIMEOUT, &kUnanswered_ms, sizeof kUnanswered_ms);
  if (::bind(socket.get(), at.ai_addr, at.ai_addrlen) != 0 || ::listen(socket.get(), kBacklog) != 0)
    return Descriptor();
  return socket;
}

Descriptor spare_descriptor() {
  return Descriptor(::open("/dev/null", O_RDONLY | O_CLOEXEC));
}

}  // namespace

absl::StatusOr<std::unique_ptr<Listener>> Listener::open(const std::string& address) {
  GW_ASSIGN_OR_RETURN(const SocketAddresses addresses, addresses_of(address));
  std::unique_ptr<Listener> self(new Listener);
  int error_number = 0;
  for (addrinfo* at = addresses.get(); at != nullptr; at = at->ai_next) {
    if (self->port_ != 0) set_port(at->ai_addr, self->port_);
    Descriptor socket = listening_socket(*at);
    if (!socket.is_open()) {
      error_number = errno;
      if (error_number == EADDRINUSE) break;
      continue;  // such as ::1 where there is no IPv6
    }
    sockaddr_storage name{};
    socklen_t size = sizeof name;
    ::getsockname(socket.get(), reinterpret_cast<sockaddr*>(&name), &size);
    self->port_ = port_of(name);
    self->sockets_.push_back(std::move(socket));
    error_number = 0;
  }
  if (self->sockets_.empty() || error_number == EADDRINUSE) {
    return absl::UnavailableError(
        error_number == EADDRINUSE
            ? fmt::format("cannot listen on {}; is another daemon running there?", address)
            : fmt::format("cannot listen on {}: {}", address, std::strerror(error_number)));
  }
  self->wake_ = Descriptor(::eventfd(0, EFD_CLOEXEC));
  self->spare_ = spare_descriptor();
  return self;
}

Listener::~Listener() {
  stop();
}

bool Listener::takes_connections(std::chrono::milliseconds within) const {
  sockaddr_storage name{};
  socklen_t size = sizeof name;
  ::getsockname(sockets_.front().get(), reinterpret_cast<sockaddr*>(&name), &size);
  const Descriptor connection(::socket(name.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!connection.is_open()) return true;  // out of descriptors: a restart would not help
  const int within_ms = static_cast<int>(within.count());
  pollfd polled{connection.get(), POLLOUT, 0};
  if (::connect(connection.get(), reinterpret_cast<const sockaddr*>(&name), size) != 0 &&
      (errno != EINPROGRESS || ::poll(&polled, 1, within_ms) != 1))
    return false;
  ::shutdown(connection.get(), SHUT_WR);
  polled.events = POLLIN;
  return ::poll(&polled, 1, within_ms) == 1;
}

void Listener::start(std::unique_ptr<Acceptor> acceptor, std::shared_ptr<ConnectionWatch> watch,
                     int max_descriptors) {
  acceptor_ = std::move(acceptor);
  watch_ = std::move(watch);
  max_descriptors_ = max_descriptors;
  thread_ = std::jthread([this](std::stop_token stop) {
    std::vector<pollfd> polled;
    for (const Descriptor& socket : sockets_) polled.push_back({socket.get(), POLLIN, 0});
    polled.push_back({wake_.get(), POLLIN, 0});
    while (!stop.stop_requested()) {
      if (::poll(polled.data(), polled.size(), -1) <= 0) continue;
      for (size_t i = 0; i < sockets_.size(); ++i)
        if ((polled[i].revents & POLLIN) != 0) take(sockets_[i]);
    }
  });
}

void Listener::stop() {
  if (!thread_.joinable()) return;
  thread_.request_stop();
  ::eventfd_write(wake_.get(), 1);
  thread_.join();
  sockets_.clear();
}

void Listener::take(const Descriptor& listening) {
  Descriptor connection(::accept4(listening.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
  if (!connection.is_open()) {
    if (errno == EMFILE || errno == ENFILE) turn_away(listening);
    return;
  }
  // accept() returns the lowest free number, so this is how many are open.
  const bool too_many = connection.get() >= max_descriptors_;
  if (too_many && !told_) {
    spdlog::warn("connections are turned away: {} descriptors are open, the maximum for connections",
                 max_descriptors_);
  }
  told_ = too_many;
  if (too_many) return;
  watch_->add(connection.get());
  Acceptor::NewConnectionParameters parameters;
  parameters.listener_fd = listening.get();
  parameters.fd = connection.release();
  acceptor_->HandleNewConnection(&parameters);
}

void Listener::turn_away(const Descriptor& listening) {
  if (!told_) spdlog::warn("connections are turned away: the process has no descriptor left");
  told_ = true;
  spare_.reset();
  Descriptor(::accept4(listening.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC)).reset();
  spare_ = spare_descriptor();
  std::this_thread::sleep_for(std::chrono::milliseconds(10));  // slows down peers that retry at once
}

}  // namespace glasswing
