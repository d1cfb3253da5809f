#include "tests/faults/capture/delay_relay.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <deque>
#include <memory>
#include <random>
#include <system_error>

namespace glasswing {
namespace {

constexpr int kPoll_ms = 20;

class Socket {
 public:
  explicit Socket(int fd) : fd_(fd) {}
  ~Socket() { ::close(fd_); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  int fd() const { return fd_; }

 private:
  const int fd_;
};

sockaddr_in loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  return address;
}

int port_of(const std::string& address) {
  return std::stoi(address.substr(address.rfind(':') + 1));
}

// Returns false if the connection is gone.
bool send_all(int fd, const std::string& bytes) {
  for (size_t at = 0; at < bytes.size();) {
    const ssize_t sent = ::send(fd, bytes.data() + at, bytes.size() - at, MSG_NOSIGNAL);
    if (sent <= 0) return false;
    at += static_cast<size_t>(sent);
  }
  return true;
}

}  // namespace

DelayRelay::DelayRelay(const std::string& target, nanoseconds max_delay, std::uint64_t seed)
    : target_(target),
      max_delay_(max_delay),
      seed_(seed),
      listener_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in address = loopback(0);
  socklen_t size = sizeof address;
  if (::bind(listener_, reinterpret_cast<sockaddr*>(&address), size) != 0 || ::listen(listener_, 16) != 0 ||
      ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) != 0)
    throw std::system_error(errno, std::generic_category(), "the relay cannot listen");
  address_ = fmt::format("127.0.0.1:{}", ntohs(address.sin_port));
  accepting_ = std::jthread([this](std::stop_token stop) { accept_all(stop); });
}

DelayRelay::~DelayRelay() {
  accepting_ = {};
  passing_.clear();
  ::close(listener_);
}

void DelayRelay::accept_all(std::stop_token stop) {
  while (!stop.stop_requested()) {
    pollfd ready{.fd = listener_, .events = POLLIN, .revents = 0};
    if (::poll(&ready, 1, kPoll_ms) <= 0) continue;
    const auto client = std::make_shared<Socket>(::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC));
    const auto node = std::make_shared<Socket>(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    const sockaddr_in address = loopback(port_of(target_));
    if (::connect(node->fd(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) continue;
    const int yes = 1;
    for (const auto& socket : {client, node})
      ::setsockopt(socket->fd(), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    const std::lock_guard lock(mutex_);
    for (const auto& [from, to] : {std::pair{client, node}, std::pair{node, client}}) {
      passing_.emplace_back([this, from, to, seed = seed_++](std::stop_token ending) {
        pass(from->fd(), to->fd(), seed, ending);
      });
    }
  }
}

void DelayRelay::pass(int from, int to, std::uint64_t seed, std::stop_token stop) {
  struct Parcel {
    nanoseconds due;
    std::string bytes;
  };
  std::mt19937_64 random(seed);
  std::uniform_int_distribution<std::int64_t> delay_ns(0, max_delay_.count());
  std::deque<Parcel> parcels;
  std::array<char, 1 << 16> buffer{};
  while (!stop.stop_requested()) {
    nanoseconds wait = std::chrono::milliseconds(kPoll_ms);
    if (!parcels.empty()) wait = std::clamp(parcels.front().due - monotonic_now(), nanoseconds(0), wait);
    const timespec until{.tv_sec = 0, .tv_nsec = wait.count()};
    pollfd ready{.fd = from, .events = POLLIN, .revents = 0};
    if (::ppoll(&ready, 1, &until, nullptr) > 0) {
      const ssize_t got = ::recv(from, buffer.data(), buffer.size(), 0);
      if (got <= 0) break;
      const nanoseconds due = monotonic_now() + nanoseconds(delay_ns(random));
      parcels.push_back({.due = parcels.empty() ? due : std::max(due, parcels.back().due),
                         .bytes = std::string(buffer.data(), got)});
    }
    while (!parcels.empty() && parcels.front().due <= monotonic_now()) {
      if (!send_all(to, parcels.front().bytes)) return;
      parcels.pop_front();
    }
  }
  ::shutdown(from, SHUT_RDWR);
  ::shutdown(to, SHUT_RDWR);
}

}  // namespace glasswing
